// Checks print what they compared and abort; those for debug builds are not there in others.

#include "common/core/check.h"

#include <gtest/gtest.h>

#include "common/core/result.h"

namespace lightloom {
namespace {

enum class Fruit { kApple = 3, kPear };

TEST(Check, PassesWithoutAWord) {
    int evaluated = 0;
    LL_CHECK(++evaluated == 1);
    LL_CHECK(true, "never seen");
    LL_CHECK_EQ(++evaluated, 2);
    LL_CHECK_NE(1, 2);
    LL_CHECK_LT(-1, 0);
    LL_CHECK_LE(1.5, 1.5);
    LL_CHECK_GT(2u, 1u);
    LL_CHECK_GE('b', 'a');
    EXPECT_EQ(evaluated, 2);
}

TEST(CheckDeathTest, PrintsPlaceExpressionAndBothValues) {
    const int two = 2;
    EXPECT_DEATH(LL_CHECK(two == 3), "check_test.cpp:[0-9]+: check failed: two == 3");
    EXPECT_DEATH(LL_CHECK(two == 3, "after all"), "check failed: two == 3: after all");
    EXPECT_DEATH(LL_CHECK_EQ(two, 3), "check_test.cpp:[0-9]+: check failed: two == 3: 2 and 3");
    EXPECT_DEATH(LL_CHECK_NE(two, 2), "two != 2: 2 and 2");
    EXPECT_DEATH(LL_CHECK_LT(0.5, 0.25), "0.5 < 0.25: 0.5 and 0.25");
    EXPECT_DEATH(LL_CHECK_LE(two, 1), "two <= 1: 2 and 1");
    EXPECT_DEATH(LL_CHECK_GT(1u, 4294967295u), "1 and 4294967295");
    EXPECT_DEATH(LL_CHECK_GE(-1, two), "-1 >= two: -1 and 2");
    EXPECT_DEATH(LL_CHECK_EQ(Fruit::kApple, Fruit::kPear), "3 and 4");
    EXPECT_DEATH(LL_CHECK_EQ(std::string("a"), "b"), "\"a\" and \"b\"");
    EXPECT_DEATH(LL_CHECK_NE(static_cast<const int*>(nullptr), nullptr), " and null");
}

TEST(CheckDeathTest, OfDebugBuildsHaveNoCodeInOthers) {
    int evaluated = 0;
#ifdef NDEBUG
    LL_DCHECK(++evaluated < 0);
    LL_DCHECK_EQ(++evaluated, -1);
    EXPECT_EQ(evaluated, 0);
#else
    EXPECT_DEATH(LL_DCHECK(++evaluated < 0), "check failed");
    EXPECT_DEATH(LL_DCHECK_EQ(++evaluated, -1), "1 and -1");
#endif
}

TEST(CheckDeathTest, AResultWithoutAValueNamesItsStatus) {
#ifndef NDEBUG
    const Result<std::string> result = not_found("no such scene");
    EXPECT_DEATH((void)*result, "no such scene");
    EXPECT_DEATH((void)result->size(), "no such scene");
    EXPECT_DEATH((void)result.value(), "no such scene");
#endif
}

}  // namespace
}  // namespace lightloom
