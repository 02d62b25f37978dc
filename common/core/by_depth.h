#pragma once
// A number that may be another one at the camera's first hit than at the vertices behind it.

namespace lightloom {

/// The first hit makes up most of an image, and all other vertices of a camera sub-path cost a walk and matter less: what one
/// vertex gets of samples may therefore differ. As it depends on the number of camera vertices alone, it is a function of the path,
/// and weights may know it.
template <class T>
struct ByDepth {
    T at_first{1};  ///< At the camera's first hit.
    T later{1};     ///< At every later vertex.

    constexpr ByDepth() = default;
    constexpr ByDepth(T everywhere) : at_first(everywhere), later(everywhere) {}
    constexpr ByDepth(T first, T others) : at_first(first), later(others) {}

    /// At the last vertex of a camera sub-path of t vertices, t >= 2.
    constexpr T operator()(int t) const { return t == 2 ? at_first : later; }
    /// f of either number.
    template <class F>
    constexpr auto each(F&& f) const {
        return ByDepth<decltype(f(at_first))>(f(at_first), f(later));
    }
    friend constexpr bool operator==(const ByDepth&, const ByDepth&) = default;
};

}  // namespace lightloom
