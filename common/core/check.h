#pragma once
// These checks guard what only a mistake in this program can violate; errors of input, files and networks are a Status
// instead. A failed check prints file, line, the expression and the values on both sides, and aborts.
//
//   LL_CHECK(condition), LL_CHECK(condition, text)
//   LL_CHECK_EQ(a, b), and the same with NE, LT, LE, GT, GE
//   LL_DCHECK...: the same in debug builds; no code at all where NDEBUG is defined

#include <string>
#include <string_view>
#include <type_traits>

namespace lightloom::check {

[[noreturn]] void fail(const char* file, int line, const char* expression, const std::string& details);

std::string text_of(bool value);
std::string text_of(double value);
std::string text_of(long long value);
std::string text_of(unsigned long long value);
std::string text_of(const void* value);
std::string text_of(std::string_view value);

/// The value as text, or "?" for a type that has no text; then the printed expression has to suffice.
template <typename T>
std::string describe(const T& value) {
    if constexpr (std::is_enum_v<T>) {
        return text_of(static_cast<long long>(value));
    } else if constexpr (std::is_same_v<T, bool>) {
        return text_of(value);
    } else if constexpr (std::is_integral_v<T>) {
        return text_of(static_cast<std::conditional_t<std::is_signed_v<T>, long long, unsigned long long>>(value));
    } else if constexpr (std::is_floating_point_v<T>) {
        return text_of(double(value));
    } else if constexpr (std::is_null_pointer_v<T>) {
        return "null";
    } else if constexpr (std::is_convertible_v<const T&, std::string_view>) {
        return text_of(std::string_view(value));
    } else if constexpr (std::is_pointer_v<T>) {
        return text_of(static_cast<const void*>(value));
    } else {
        return "?";
    }
}

/// This function is not inlined, so that a check costs its caller only a comparison and a call.
template <typename A, typename B>
[[noreturn, gnu::noinline, gnu::cold]] void fail_values(const char* file, int line, const char* expression, const A& a,
                                                        const B& b) {
    fail(file, line, expression, describe(a) + " and " + describe(b));
}

}  // namespace lightloom::check

#define LL_CHECK(condition, ...)                                                                  \
    do {                                                                                          \
        if (!(condition)) [[unlikely]]                                                            \
            ::lightloom::check::fail(__FILE__, __LINE__, #condition, ::std::string(__VA_ARGS__)); \
    } while (false)

#define LL_CHECK_VALUES(a, relation, b)                                                               \
    do {                                                                                              \
        const auto& ll_a = (a);                                                                       \
        const auto& ll_b = (b);                                                                       \
        if (!(ll_a relation ll_b)) [[unlikely]]                                                       \
            ::lightloom::check::fail_values(__FILE__, __LINE__, #a " " #relation " " #b, ll_a, ll_b); \
    } while (false)

#define LL_CHECK_EQ(a, b) LL_CHECK_VALUES(a, ==, b)
#define LL_CHECK_NE(a, b) LL_CHECK_VALUES(a, !=, b)
#define LL_CHECK_LT(a, b) LL_CHECK_VALUES(a, <, b)
#define LL_CHECK_LE(a, b) LL_CHECK_VALUES(a, <=, b)
#define LL_CHECK_GT(a, b) LL_CHECK_VALUES(a, >, b)
#define LL_CHECK_GE(a, b) LL_CHECK_VALUES(a, >=, b)

// Where a check generates no code, its expression is still compiled, so that it stays valid and its variables count as
// used.
#ifdef NDEBUG
#define LL_IN_DEBUG(check)     \
    do {                       \
        if constexpr (false) { \
            check;             \
        }                      \
    } while (false)
#else
#define LL_IN_DEBUG(check) check
#endif

#define LL_DCHECK(...) LL_IN_DEBUG(LL_CHECK(__VA_ARGS__))
#define LL_DCHECK_EQ(a, b) LL_IN_DEBUG(LL_CHECK_EQ(a, b))
#define LL_DCHECK_NE(a, b) LL_IN_DEBUG(LL_CHECK_NE(a, b))
#define LL_DCHECK_LT(a, b) LL_IN_DEBUG(LL_CHECK_LT(a, b))
#define LL_DCHECK_LE(a, b) LL_IN_DEBUG(LL_CHECK_LE(a, b))
#define LL_DCHECK_GT(a, b) LL_IN_DEBUG(LL_CHECK_GT(a, b))
#define LL_DCHECK_GE(a, b) LL_IN_DEBUG(LL_CHECK_GE(a, b))
