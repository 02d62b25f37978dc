#pragma once
// The pyramid of an image [Veach 1997, figure 10.2]: a picture of what each technique finds, unweighted, and of what it gives to
// the image, weighted. It is gathered unit by unit from what Renderer::watch() shows, and written as a directory.

#include <compare>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "client/pyramid_page.h"
#include "common/film/accumulation.h"
#include "common/transport/renderer.h"

namespace lightloom::client {

/// Which picture a contribution goes to. Paths of more edges than the pyramid is deep share one for each kind of technique.
struct PyramidKey {
    static constexpr int kLonger = std::numeric_limits<int>::max();

    int k = 0;  ///< Edges, or kLonger.
    int s = 0;  ///< Of the technique; 0 where k is kLonger.
    TechniqueKind kind = TechniqueKind::kHit;

    static PyramidKey of(const SeenContribution& seen, int depth) {
        if (seen.view.k > depth) return {kLonger, 0, seen.found.technique.kind};
        return {seen.view.k, seen.found.technique.s, seen.found.technique.kind};
    }
    /// "k3-s2-connect"
    std::string name() const;
    friend auto operator<=>(const PyramidKey&, const PyramidKey&) = default;
};

/// What the contributions of one unit come to. Units may be watched at the same time, each into one of these.
class UnitPictures {
  public:
    UnitPictures(const Rect& crop, const Rect& tile, int depth) : crop_(crop), tile_(tile), depth_(depth) {}
    void add(const SeenContribution& seen);

  private:
    friend class Pyramid;
    struct PictureSplat {
        uint32_t pixel;
        Rgb weighted, unweighted;
    };
    Rect crop_, tile_;
    int depth_;
    std::map<PyramidKey, std::vector<double>> camera_;  // by pixel of the tile: 3 weighted, 3 unweighted
    std::map<PyramidKey, std::vector<PictureSplat>> splats_;
    uint64_t contributions_ = 0, not_finite_ = 0;
};

class Pyramid {
  public:
    /// `max_bytes` bounds the memory of the pictures.
    Pyramid(const FrameLayout& frame, int depth, const FilmResponse& response = {}, uint64_t max_bytes = uint64_t(4) << 30);

    /// A group of the plan: its units are added, in any fixed order, between these two.
    void begin_group(uint32_t iterations, uint64_t light_paths);
    /// kResourceExhausted if there would be too many pictures.
    Status add(const UnitPictures& unit);
    void end_group();

    int depth() const { return depth_; }
    uint64_t contributions() const { return contributions_; }
    /// Contributions that are left out of the pictures because they are NaN or infinite.
    uint64_t not_finite() const { return not_finite_; }

    std::vector<PyramidKey> keys() const;
    /// Normalised as the image is, and as the film responds to it. Of a key that there is.
    RgbImage weighted(const PyramidKey& key) const { return develop(key, 0); }
    RgbImage unweighted(const PyramidKey& key) const { return develop(key, 3); }
    /// Mean over the pixels of the variance of the weighted picture's luminance, from whole groups, over the squared luminance of
    /// `image` plus 0.01: what the technique adds to relMSE, but for how techniques vary together. NaN for fewer than two groups.
    double noise(const PyramidKey& key, const RgbImage& image) const;

  private:
    struct Picture {
        std::vector<double> sums;     // 6 per pixel as in UnitPictures: iterations times the mean
        std::vector<double> group;    // luminance of the open group's weighted mean, after white balance
        std::vector<double> squares;  // sum over groups of iterations times its square
    };
    Status find(const PyramidKey& key, Picture** picture);
    RgbImage develop(const PyramidKey& key, size_t first) const;

    FrameLayout frame_;
    int depth_;
    FilmResponse response_;
    uint64_t max_bytes_;
    std::map<PyramidKey, Picture> pictures_;
    uint64_t iterations_ = 0, contributions_ = 0, not_finite_ = 0;
    uint32_t groups_ = 0, group_iterations_ = 0;
    uint64_t group_light_paths_ = 0;
};

/// Sees to it that `directory` exists, can be written to, and is empty or holds a pyramid, which a later write_pyramid() replaces.
/// kInvalidArgument otherwise.
Status open_pyramid_directory(const std::string& directory);

/// EXR and PNG of every picture, image.exr and image.png of the whole, index.html that shows them and pyramid.json that describes
/// them. `page` says what was rendered and how; rows and pictures are filled in here. `image` is developed by the
/// pyramid's response.
Status write_pyramid(const std::string& directory, const Pyramid& pyramid, const FrameLayout& frame, const RgbImage& image,
                     PyramidPage page);

}  // namespace lightloom::client
