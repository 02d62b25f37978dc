// The asset store: uploads that resume, stall and are verified; damage; trimming.

#include <dirent.h>
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "common/work/asset.h"
#include "tests/support/temp_directory.h"

namespace {
int reads_left = -1;  ///< Of directory entries before the next one fails; negative: none fails.
}  // namespace

/// Instead of the C library's.
extern "C" dirent* readdir(DIR* directory) {
    static const auto real = reinterpret_cast<dirent* (*)(DIR*)>(::dlsym(RTLD_NEXT, "readdir"));
    if (reads_left == 0) {
        errno = EIO;
        return nullptr;
    }
    if (reads_left > 0) --reads_left;
    return real(directory);
}

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using testing::TempDirectory;

TEST(AssetStore, UploadsResumeAndAreVerified) {
    const TempDirectory directory;
    AssetStore store(directory.path, 1 << 20);
    const std::string bytes(100000, 'q');
    const Digest digest = sha256(bytes);
    {
        auto upload = store.begin_upload(digest, bytes.size());
        ASSERT_TRUE(upload.ok());
        ASSERT_TRUE(upload->append(std::string_view(bytes).substr(0, 40000)).ok());
        EXPECT_EQ(store.begin_upload(digest, bytes.size()).status().code(), StatusCode::kAborted);
    }
    EXPECT_FALSE(store.contains(digest));
    EXPECT_EQ(store.committed_size(digest), 40000u);
    auto upload = store.begin_upload(digest, bytes.size());
    ASSERT_TRUE(upload.ok());
    ASSERT_EQ(upload->offset(), 40000u);
    ASSERT_TRUE(upload->append(std::string_view(bytes).substr(40000)).ok());
    EXPECT_EQ(upload->append("x").code(), StatusCode::kInvalidArgument);
    ASSERT_TRUE(upload->finish().ok());
    ASSERT_TRUE(store.contains(digest));
    EXPECT_EQ(*store.read(digest), bytes);

    const Digest wrong = sha256("something else");
    EXPECT_EQ(store.put(wrong, "not it").code(), StatusCode::kDataLoss);
    EXPECT_FALSE(store.contains(wrong));
    EXPECT_EQ(store.committed_size(wrong), 0u);
    EXPECT_EQ(store.begin_upload(wrong, 2 << 20).status().code(), StatusCode::kResourceExhausted);
}

TEST(AssetStore, DamageIsNoticedBeforeUse) {
    const TempDirectory directory;
    AssetStore store(directory.path / "store");
    const Digest digest = sha256("content");
    ASSERT_TRUE(store.put(digest, "content").ok());
    AssetManifest manifest{"a", {{"a", digest, 7}}};
    ASSERT_TRUE(store.materialise(manifest, directory.path / "out").ok());
    std::ofstream(store.path_of(digest)) << "c0ntent";
    const Digest other = sha256("other");
    ASSERT_TRUE(store.put(other, "other").ok());
    std::ofstream(store.path_of(other)) << "0ther";
    manifest.entries.push_back({"b", other, 5});
    const Status damaged = store.materialise(manifest, directory.path / "out2");
    EXPECT_EQ(damaged.code(), StatusCode::kDataLoss);
    EXPECT_NE(damaged.message().find("\"a\" of the scene was damaged"), std::string::npos) << damaged.message();
    EXPECT_FALSE(store.contains(digest));
    EXPECT_FALSE(store.contains(other)) << "all of them are noticed at once";
}

TEST(AssetStore, AStalledUploadIsTakenOverWhereItStands) {
    const TempDirectory directory;
    AssetStore store(directory.path, 1 << 20, std::chrono::milliseconds(200));
    const std::string bytes(1000, 'q');
    const Digest digest = sha256(bytes);
    auto stalled = store.begin_upload(digest, bytes.size());
    ASSERT_TRUE(stalled.ok());
    ASSERT_TRUE(stalled->append(std::string(400, 'q')).ok());
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    auto second = store.begin_upload(digest, bytes.size());
    ASSERT_TRUE(second.ok()) << second.status().message();
    EXPECT_EQ(second->offset(), 400u);
    EXPECT_EQ(stalled->append("q").code(), StatusCode::kAborted);
    EXPECT_EQ(stalled->finish().code(), StatusCode::kAborted);
    ASSERT_TRUE(second->append(std::string(600, 'q')).ok());
    {
        const AssetStore::Upload gone = *std::move(stalled);  // its end leaves the other one alone
    }
    EXPECT_TRUE(second->finish().ok());
    EXPECT_EQ(*store.read(digest), bytes);
}

TEST(AssetStore, AProcessThatIsStoppedLosesItsUpload) {
    const TempDirectory directory;
    const std::string bytes(1000, 'q');
    const Digest digest = sha256(bytes);
    AssetStore theirs(directory.path), ours(directory.path, 1 << 20, std::chrono::milliseconds(200));
    auto stopped = theirs.begin_upload(digest, bytes.size());
    ASSERT_TRUE(stopped->append(std::string(400, 'q')).ok());
    EXPECT_EQ(ours.begin_upload(digest, bytes.size()).status().code(), StatusCode::kAborted) << "it may go on yet";
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    EXPECT_EQ(ours.begin_upload(digest, bytes.size()).status().code(), StatusCode::kAborted);
    EXPECT_TRUE(ours.put(digest, bytes).ok());
    ASSERT_TRUE(stopped->append(std::string(600, 'q')).ok());
    EXPECT_EQ(stopped->finish().code(), StatusCode::kAborted);
    EXPECT_EQ(*ours.read(digest), bytes);
}

TEST(AssetStore, WhatIsReadIsVerifiedAndRemovedIfDamaged) {
    const TempDirectory directory;
    AssetStore store(directory.path);
    std::string bytes(kMaxChunkBytes + 5, 'q');
    const Digest digest = sha256(bytes);
    std::string got;
    const auto collect = [&](uint64_t offset, std::string_view part) -> Status {
        EXPECT_EQ(offset, got.size());
        got += part;
        return {};
    };
    EXPECT_EQ(store.stream(digest, 0, collect).code(), StatusCode::kNotFound);
    ASSERT_TRUE(store.put(digest, bytes).ok());
    EXPECT_TRUE(store.stream(digest, 0, collect).ok());
    EXPECT_EQ(got, bytes);
    EXPECT_TRUE(store.stream(digest, bytes.size(), collect).ok());
    EXPECT_EQ(store.stream(digest, bytes.size() + 1, collect).code(), StatusCode::kOutOfRange);
    EXPECT_EQ(store.stream(digest, 0, [](uint64_t, std::string_view) { return internal_error("enough"); }).message(), "enough");
    for (const bool whole : {true, false}) {
        bytes[7] ^= 1;
        std::ofstream(store.path_of(digest), std::ios::binary) << bytes;
        got.clear();
        EXPECT_EQ(whole ? store.read(digest).status().code() : store.stream(digest, 0, collect).code(), StatusCode::kDataLoss);
        EXPECT_FALSE(store.contains(digest)) << "it can be stored again";
        bytes[7] ^= 1;
        ASSERT_TRUE(store.put(digest, bytes).ok());
    }
}

/// As when a network file system breaks off in the middle of a directory.
TEST(AssetStore, TrimmingEndsQuietlyWhereADirectoryCannotBeRead) {
    const TempDirectory directory;
    AssetStore store(directory.path / "store");
    const std::string newest = "newest";
    for (int reads = 0; reads < 20; ++reads) {
        for (const std::string& bytes : {newest, std::string("a"), std::string("b")})
            ASSERT_TRUE(store.put(sha256(bytes), bytes).ok());
        reads_left = reads;
        EXPECT_NO_THROW(store.trim(0, sha256(newest))) << reads;
        reads_left = -1;
        EXPECT_TRUE(store.contains(sha256(newest)));
    }
}

}  // namespace
}  // namespace lightloom
