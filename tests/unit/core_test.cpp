#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "common/core/digest.h"
#include "common/core/math.h"
#include "common/core/rng.h"
#include "common/core/transform.h"
#include "common/core/utf8.h"

namespace lightloom {
namespace {

TEST(Math, AgreesWithLibmToTwelveDigits) {
    Rng rng({1, Stage::kCamera, 0, 0});
    for (int i = 0; i < 20000; ++i) {
        const double x = (rng.uniform_double() - 0.5) * 40;
        EXPECT_NEAR(math::sin(x), std::sin(x), 1e-13);
        EXPECT_NEAR(math::cos(x), std::cos(x), 1e-13);
        EXPECT_NEAR(math::atan(x), std::atan(x), 1e-13);
        EXPECT_NEAR(math::exp(x) / std::exp(x), 1, 1e-13);
        EXPECT_NEAR(math::log(std::fabs(x)), std::log(std::fabs(x)), 1e-13);
        EXPECT_NEAR(math::pow(std::fabs(x), 0.7) / std::pow(std::fabs(x), 0.7), 1, 1e-12);
        const double u = rng.uniform_double();
        EXPECT_NEAR(math::sincos_turns(u).sin, std::sin(2 * kPiD * u), 1e-13);
        EXPECT_NEAR(math::acos(2 * u - 1), std::acos(2 * u - 1), 1e-12);
        EXPECT_NEAR(math::atan2(x, u - 0.5), std::atan2(x, u - 0.5), 1e-13);
    }
    EXPECT_EQ(math::exp(-1000), 0);
    EXPECT_TRUE(std::isinf(math::exp(1000)));
    EXPECT_TRUE(std::isinf(math::log(0)));
    EXPECT_TRUE(std::isnan(math::log(-1)));
}

TEST(Rng, IsAFunctionOfItsKeyAndUniform) {
    Rng a({7, Stage::kLight, 3, 9}), b({7, Stage::kLight, 3, 9}), c({7, Stage::kLight, 3, 10});
    int same = 0;
    for (int i = 0; i < 100; ++i) {
        const uint64_t x = a.next_u64();
        EXPECT_EQ(x, b.next_u64());
        same += x == c.next_u64();
    }
    EXPECT_EQ(same, 0);
    // Chi-square over first numbers of neighbouring streams: keys must decorrelate.
    int bins[64] = {};
    for (uint64_t i = 0; i < 64000; ++i) ++bins[int(Rng({1, Stage::kCamera, i / 1000, i % 1000}).uniform() * 64)];
    double chi2 = 0;
    for (const int n : bins) chi2 += (n - 1000.0) * (n - 1000.0) / 1000;
    EXPECT_LT(chi2, 120);  // 63 degrees of freedom: p = 2e-5.
}

TEST(Digest, MatchesThePublishedVector) {
    EXPECT_EQ(sha256("abc").hex(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_EQ(*Digest::from_hex(sha256("abc").hex()), sha256("abc"));
    EXPECT_FALSE(Digest::from_hex("xyz").ok());
}

TEST(Transform, InverseAndSingular) {
    const Mat4 m = translation(1, 2, 3) * rotation(30, 1, 1, 0) * scaling(2e-4, 3e-4, 1e-4);
    const Vec3 p = inverse(m)->point(m.point({0.3f, -0.2f, 5}));
    EXPECT_NEAR(p.x, 0.3f, 1e-3);
    EXPECT_NEAR(p.z, 5, 1e-2);
    EXPECT_FALSE(inverse(scaling(1, 0, 1)).has_value());
}

TEST(Utf8, CutsBetweenCharactersAndReplacesWhatIsNone) {
    EXPECT_EQ(clipped_utf8("abc", 10), "abc");
    EXPECT_EQ(clipped_utf8("abc", 2), "ab");
    EXPECT_EQ(clipped_utf8("a\xc3\xa4\xe2\x82\xac", 5), "a\xc3\xa4");
    EXPECT_EQ(clipped_utf8("a\xc3\xa4\xe2\x82\xac", 6), "a\xc3\xa4\xe2\x82\xac");
    EXPECT_EQ(clipped_utf8("caf\xe9!", 10), "caf\xef\xbf\xbd!");
    EXPECT_EQ(clipped_utf8("\xe2\x82", 10), "\xef\xbf\xbd\xef\xbf\xbd");
    for (const char* bad : {"\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\x80"}) {
        EXPECT_FALSE(is_utf8(bad));
        EXPECT_TRUE(is_utf8(clipped_utf8(bad, 100)));
    }
}

}  // namespace
}  // namespace lightloom
