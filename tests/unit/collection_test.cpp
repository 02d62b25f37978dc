// What goes of the data directory, and when.
#include "server/collection.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temp_directory.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using Kind = StoredItem::Kind;
using testing::TempDirectory;

constexpr double kHour = 3600, kDay = 24 * kHour;

StoredItem item(Kind kind, const std::string& name, uint64_t bytes, double age, bool in_use = false) {
    return {kind, name, name, bytes, age, in_use};
}

std::vector<std::string> names(const std::vector<StoredItem>& items) {
    std::vector<std::string> out;
    for (const StoredItem& i : items) out.push_back(i.name);
    return out;
}
using Names = std::vector<std::string>;

void write(const fs::path& path, const std::string& bytes) {
    fs::create_directories(path.parent_path());
    std::ofstream(path) << bytes;
}

TEST(Collection, KeepsEverythingWithoutARuleButLeftovers) {
    const std::vector<StoredItem> items{item(Kind::kJob, "old", 100, 1000 * kDay), item(Kind::kAsset, "a", 100, 1000 * kDay),
                                        item(Kind::kLeftover, "half", 100, 2 * kHour), item(Kind::kLeftover, "new", 100, 60)};
    EXPECT_EQ(names(what_goes(items, {})), Names{"half"});
}

TEST(Collection, ByAgeSparesWhatIsInUseOrYoung) {
    const std::vector<StoredItem> items{item(Kind::kJob, "young", 1, 6 * kDay), item(Kind::kJob, "old", 1, 8 * kDay),
                                        item(Kind::kAsset, "older", 1, 9 * kDay), item(Kind::kAsset, "used", 1, 90 * kDay, true),
                                        item(Kind::kJob, "running", 1, 90 * kDay, true)};
    EXPECT_EQ(names(what_goes(items, {.keep_days = 7})), (Names{"older", "old"}));
    EXPECT_EQ(names(what_goes({item(Kind::kJob, "fresh", 1, 60)}, {.keep_days = 1e-9})), Names{});
}

TEST(Collection, BySizeTakesTheLongestUnusedUntilTheRestFits) {
    const std::vector<StoredItem> items{item(Kind::kJob, "a", 40, 2 * kDay), item(Kind::kAsset, "b", 30, 3 * kDay),
                                        item(Kind::kJob, "used", 20, 9 * kDay, true), item(Kind::kAsset, "c", 10, 4 * kHour),
                                        item(Kind::kJob, "fresh", 50, 60)};
    EXPECT_EQ(names(what_goes(items, {.disk_limit = 150})), Names{});
    EXPECT_EQ(names(what_goes(items, {.disk_limit = 149})), Names{"b"});
    EXPECT_EQ(names(what_goes(items, {.disk_limit = 119})), (Names{"b", "a"}));
    EXPECT_EQ(names(what_goes(items, {.disk_limit = 1})), (Names{"b", "a", "c"})) << "what is used or fresh stays all the same";
    EXPECT_EQ(names(what_goes(items, {.keep_days = 2.5, .disk_limit = 100})), (Names{"b", "a"})) << "age first, then size";
}

TEST(Collection, FindsAndRemovesJobsFilesAndLeftovers) {
    const TempDirectory directory;
    const fs::path data = directory.path;
    AssetStore assets(data / "assets");
    const AssetManifest scene{"scene.pbrt", {{"scene.pbrt", sha256("scene"), 5}}};
    for (const std::string& bytes : {std::string("scene"), scene.canonical_text(), std::string("unused")})
        ASSERT_TRUE(assets.put(sha256(bytes), bytes).ok());
    for (const char* job : {"job-old", "job-live"})
        for (const char* file : {"image.exr", "manifest.json"}) write(data / "jobs" / job / file, "0123456789");
    for (const char* file : {"assets/incoming/half", "scratch/scene-x/scene.pbrt", "assets/ab/note", "tables/t.tables"})
        write(data / file, "0123");

    InUse in_use{{"job-live"}, files_of_scenes(assets, {scene.root(), sha256("no list")})};
    EXPECT_TRUE(in_use.assets.contains(sha256("scene")) && in_use.assets.contains(scene.root()));
    const auto later = fs::file_time_type::clock::now() + std::chrono::hours(24 * 40);
    const auto items = stored_items(data, in_use, later);
    const auto goes = what_goes(items, {.keep_days = 30});
    EXPECT_EQ(goes.size(), 4u);
    const Collected collected = remove_items(data, goes);
    EXPECT_EQ(collected.jobs, Names{"job-old"});
    EXPECT_EQ(collected.assets, 1u);
    EXPECT_EQ(collected.leftovers, 2u);
    EXPECT_EQ(collected.bytes, 20u + 6 + 4 + 4);
    EXPECT_FALSE(fs::exists(data / "jobs/job-old"));
    EXPECT_FALSE(assets.contains(sha256("unused")));
    EXPECT_TRUE(assets.contains(sha256("scene")) && assets.contains(scene.root()));
    for (const char* file : {"jobs/job-live/image.exr", "assets/ab/note", "tables/t.tables"}) EXPECT_TRUE(fs::exists(data / file));
    EXPECT_TRUE(fs::is_empty(data / "scratch"));
    EXPECT_TRUE(what_goes(stored_items(data / "nowhere", in_use), {.keep_days = 30}).empty());
}

}  // namespace
}  // namespace lightloom
