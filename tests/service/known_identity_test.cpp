// Golden units are rendered once per process, and not at all where an earlier process of the same code did so on this machine.

#include "server/known_identity.h"

#include <gtest/gtest.h>

#include <fstream>

#include "common/core/atomic_file.h"
#include "common/work/golden.h"
#include "common/work/identity.h"
#include "tests/service/process.h"
#include "tests/support/temp_directory.h"

namespace lightloom::testing {
namespace {

std::string content(const std::string& file) {
    const auto text = read_file(file);
    return text.ok() ? *text : std::string();
}

void write(const std::string& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

TEST(KnownIdentity, IsThatOfGoldenUnitsRenderedHereWhichHappensOncePerProcess) {
    const TempDirectory directory;
    const uint64_t before = golden_unit_digests_made();
    const auto proved = build_identity();
    ASSERT_TRUE(proved.ok()) << proved.status().message();
    EXPECT_EQ(*build_identity(), *proved);
    EXPECT_EQ(*known_identity({}), *proved);
    EXPECT_EQ(*known_identity(directory.path / "cache"), *proved);
    EXPECT_EQ(*known_identity(directory.path / "cache"), *proved);
    EXPECT_LE(golden_unit_digests_made() - before, 1u);
    EXPECT_EQ(golden_unit_digest().value(), proved->golden_digest);
}

TEST(KnownIdentity, IsOfThisCodeAndThisBoot) {
    const auto text = code_and_machine();
    if (!text) GTEST_SKIP() << "this system does not say which code and which boot this is";
    EXPECT_EQ(code_and_machine(), text);
    EXPECT_NE(text->find(kBuildId), std::string::npos);
    EXPECT_NE(text->find("\ncode "), std::string::npos);
    EXPECT_NE(text->find("\nboot " + content("/proc/sys/kernel/random/boot_id")), std::string::npos);
    ASSERT_EQ(::setenv("GLIBC_TUNABLES", "glibc.cpu.x86_memcpy=none", 1), 0);
    EXPECT_NE(code_and_machine(), text);
    ::unsetenv("GLIBC_TUNABLES");
    EXPECT_EQ(code_and_machine(), text);
}

TEST(GoldenCache, GivesBackWhatWasStoredAndNothingElse) {
    const TempDirectory directory;
    const GoldenCache cache(directory.path / "cache");
    const std::string file = directory.file("cache/golden-units");
    EXPECT_FALSE(cache.find(sha256("here")));
    cache.store(sha256("here"), sha256("a"));
    cache.store(sha256("there"), sha256("b"));
    EXPECT_EQ(cache.find(sha256("here")), sha256("a"));
    EXPECT_EQ(cache.find(sha256("there")), sha256("b"));
    EXPECT_FALSE(cache.find(sha256("elsewhere")));
    cache.store(sha256("here"), sha256("c"));
    EXPECT_EQ(cache.find(sha256("here")), sha256("c"));
    const std::string good = content(file);
    EXPECT_EQ(std::count(good.begin(), good.end(), '\n'), 2);

    // No changed or missing byte of a line gives another digest, and the other lines still count.
    const size_t line = good.find('\n') + 1;
    for (size_t i = 0; i < line; ++i) {
        std::string bad = good;
        bad[i] = bad[i] == '0' ? '1' : '0';
        write(file, bad);
        EXPECT_FALSE(cache.find(sha256("here"))) << i;
        EXPECT_EQ(cache.find(sha256("there")), i + 1 == line ? std::optional<Digest>() : sha256("b")) << i;
        write(file, good.substr(0, i));
        EXPECT_EQ(cache.find(sha256("here")), i + 1 == line ? sha256("c") : std::optional<Digest>()) << i;
    }
    for (const std::string& foreign : {std::string(), std::string("\n\n\n"), std::string(1 << 16, 'a'), std::string(200, '\0')}) {
        write(file, foreign);
        EXPECT_FALSE(cache.find(sha256("here")));
        cache.store(sha256("here"), sha256("d"));
        EXPECT_EQ(cache.find(sha256("here")), sha256("d"));
        const std::string mended = content(file);
        EXPECT_EQ(std::count(mended.begin(), mended.end(), '\n'), 1);
    }
}

TEST(GoldenCache, KeepsTheLastFew) {
    const TempDirectory directory;
    const GoldenCache cache(directory.path);
    for (int i = 0; i < 40; ++i) cache.store(sha256(std::to_string(i)), sha256("x"));
    for (int i = 0; i < 40; ++i)
        EXPECT_EQ(cache.find(sha256(std::to_string(i))).has_value(), i + int(GoldenCache::kMaxLines) >= 40);
}

TEST(GoldenCache, WhereNothingCanBeKeptNothingFails) {
    const TempDirectory directory;
    write(directory.file("file"), "x");
    const GoldenCache cache(directory.path / "file");
    cache.store(sha256("here"), sha256("a"));
    EXPECT_FALSE(cache.find(sha256("here")));
    EXPECT_EQ(content(directory.file("file")), "x");
}

/// A cost that came back would show here: a second render of the same program renders no golden unit, and a changed file is
/// seen.
TEST(KnownIdentity, RendersAfterTheFirstDoNotRenderGoldenUnits) {
    if (!code_and_machine()) GTEST_SKIP() << "this system does not say which code and which boot this is";
    const TempDirectory directory;
    const auto render = [&](const std::string& name, const std::string& cache) {
        const std::string scene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt";
        EXPECT_EQ(Process("lightloom",
                          {"--log", "info", "render", scene, "--spp", "1", "--resolution", "8x8", "-q", "-o",
                           directory.file(name + ".exr"), "--table-cache", cache},
                          directory.file(name + ".log"))
                      .wait(),
                  0)
            << content(directory.file(name + ".log"));
        return content(directory.file(name + ".log"));
    };
    const auto digest_line = [&](const std::string& name) {
        const std::string manifest = content(directory.file(name + ".manifest.json"));
        return manifest.substr(std::min(manifest.find("golden_digest"), manifest.size()), 100);
    };
    const std::string cache = directory.file("cache");
    EXPECT_NE(render("first", cache).find("golden units: rendered"), std::string::npos);
    EXPECT_NE(render("second", cache).find("golden units: an earlier process rendered them"), std::string::npos);
    EXPECT_EQ(digest_line("second"), digest_line("first"));
    EXPECT_EQ(content(directory.file("second.exr")), content(directory.file("first.exr")));
    write(directory.file("cache/golden-units"), "damaged");
    const std::string third = render("third", cache);
    EXPECT_NE(third.find("golden units: rendered"), std::string::npos);
    EXPECT_NE(third.find("1 damaged line(s)"), std::string::npos);
    EXPECT_EQ(digest_line("third"), digest_line("first"));
    EXPECT_EQ(render("off", "off").find("golden units: an earlier"), std::string::npos);
}

}  // namespace
}  // namespace lightloom::testing
