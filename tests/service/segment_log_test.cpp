// The segment log: what was flushed is read back as it was, what was torn is cut, what was damaged is noticed, and a write that
// failed has not been.

#include "server/store/segment_log.h"

#include <gtest/gtest.h>

#include <array>

#include "common/core/atomic_file.h"
#include "server/store/crc32c.h"
#include "tests/service/store_testing.h"
#include "tests/support/temp_directory.h"

namespace lightloom {
namespace {

using testing::FailingFiles;
using testing::TempDirectory;

Result<PayloadPlace> append(SegmentLog&& log, std::string_view payload) { return log.append(std::array{payload}); }
Result<PayloadPlace> append(SegmentLog& log, std::string_view payload) { return log.append(std::array{payload}); }

TEST(Crc32c, IsTheOneOfTheStandard) {
    EXPECT_EQ(crc32c("123456789"), 0xe3069283u);
    EXPECT_EQ(crc32c("56789", crc32c("1234")), 0xe3069283u);
    EXPECT_EQ(crc32c(""), 0u);
}

TEST(SegmentLog, RecordsAreReadBackAlsoAfterReopening) {
    const TempDirectory directory;
    std::vector<std::pair<PayloadPlace, std::string>> written;
    for (int run = 0; run < 3; ++run) {
        auto log = SegmentLog::open(directory.path, {}, 1000);
        ASSERT_TRUE(log.ok()) << log.status().message();
        for (size_t size : {0u, 1u, 200u, 900u, 5000u, 31u}) {
            const std::string payload(size, char('a' + run));
            const std::string_view view = payload;
            const auto place = log->append(std::array{view.substr(0, size / 3), std::string_view(), view.substr(size / 3)});
            ASSERT_TRUE(place.ok()) << place.status().message();
            EXPECT_EQ(place->length, size);
            written.emplace_back(*place, payload);
        }
        ASSERT_TRUE(log->sync().ok());
        for (const auto& [place, payload] : written) EXPECT_EQ(*log->read(place), payload);
    }
    auto log = SegmentLog::open(directory.path, {}, 1000);
    const auto segments = *log->segments();
    EXPECT_GT(segments.size(), 5u) << "they roll over";
    for (const uint32_t segment : segments) ASSERT_TRUE(log->remove(segment).ok());
    EXPECT_TRUE(log->segments()->empty());
    EXPECT_EQ(log->read(written[0].first).status().code(), StatusCode::kDataLoss);
    EXPECT_EQ(append(*log, "new")->segment, segments.back() + 1) << "a number is not given twice";
    EXPECT_EQ(append(*SegmentLog::open(directory.path, {99, 0, 1}), "new")->segment, 100u) << "nor one that only a reference knows";
}

TEST(SegmentLog, ATailTornAtAnyByteIsCut) {
    const TempDirectory directory;
    std::string whole;
    std::vector<PayloadPlace> places;
    {
        auto log = SegmentLog::open(directory.path);
        for (const char* payload : {"first", "second record", "x"}) places.push_back(*append(*log, payload));
        whole = *read_file(directory.file("000001.log"));
    }
    ASSERT_EQ(whole.size(), 3 * SegmentLog::kHeaderBytes + 5 + 13 + 1);
    for (size_t size = 0; size <= whole.size(); ++size) {
        for (const bool garbage : {false, true}) {
            std::string torn = whole.substr(0, size);
            if (garbage) torn.resize(whole.size(), '\0');  // what was not flushed may be zeros
            ASSERT_TRUE(write_file_atomically(directory.file("000001.log"), torn).ok());
            auto log = SegmentLog::open(directory.path);
            ASSERT_TRUE(log.ok()) << log.status().message();
            uint64_t kept = 0;
            for (const PayloadPlace& place : places) {
                const uint64_t end = place.offset + SegmentLog::kHeaderBytes + place.length;
                EXPECT_EQ(log->read(place).ok(), end <= size) << size;
                if (end <= size) kept = end;
            }
            EXPECT_EQ(std::filesystem::file_size(directory.file("000001.log")), kept);
            const auto next = append(*log, "after");
            ASSERT_TRUE(next.ok());
            EXPECT_EQ(next->offset, kept);
            EXPECT_EQ(*log->read(*next), "after");
        }
    }
}

TEST(SegmentLog, EveryFlippedBitOfARecordIsNoticed) {
    const TempDirectory directory;
    auto log = SegmentLog::open(directory.path);
    (void)append(*log, "before");
    const PayloadPlace place = *append(*log, "payload");
    const std::string name = directory.file("000001.log"), whole = *read_file(name);
    // The record's number is told by nobody else, but the header's checksum covers it.
    for (size_t byte = place.offset; byte < whole.size(); ++byte) {
        std::string damaged = whole;
        damaged[byte] = char(damaged[byte] ^ 4);
        ASSERT_TRUE(write_file_atomically(name, damaged).ok());
        const auto read = log->read(place);
        ASSERT_EQ(read.status().code(), StatusCode::kDataLoss) << byte;
        EXPECT_NE(read.status().message().find("000001.log: the record at byte 38 is damaged"), std::string::npos);
    }
    ASSERT_TRUE(write_file_atomically(name, whole).ok());
    EXPECT_EQ(*log->read(place), "payload");
    for (const PayloadPlace& wrong :
         {PayloadPlace{1, 0, 7}, PayloadPlace{1, 38, 6}, PayloadPlace{1, 37, 7}, PayloadPlace{1, 1000, 7}, PayloadPlace{2, 38, 7}})
        EXPECT_EQ(log->read(wrong).status().code(), StatusCode::kDataLoss);
}

/// Only what is known to be damaged may be thrown away.
TEST(SegmentLog, ARecordThatCannotBeReadIsNotDamaged) {
    const TempDirectory directory;
    auto log = SegmentLog::open(directory.path);
    const auto place = append(*log, "payload");
    ASSERT_TRUE(place.ok() && log->sync().ok());
    const std::filesystem::path segment = std::filesystem::directory_iterator(directory.path)->path();
    std::filesystem::remove(segment);
    std::filesystem::create_directory(segment);
    EXPECT_EQ(log->read(*place).status().code(), StatusCode::kInternal) << log->read(*place).status().message();
}

TEST(SegmentLog, NothingIsWrittenWhereADamagedRecordWas) {
    const TempDirectory directory;
    PayloadPlace last;
    {
        auto log = SegmentLog::open(directory.path);
        (void)append(*log, "damaged");
        last = *append(*log, "last");
    }
    const std::string name = directory.file("000001.log");
    std::string bytes = *read_file(name);
    bytes[SegmentLog::kHeaderBytes] ^= 1;
    ASSERT_TRUE(write_file_atomically(name, bytes).ok());
    auto log = SegmentLog::open(directory.path, last);
    ASSERT_TRUE(log.ok()) << log.status().message();
    EXPECT_EQ(append(*log, "new")->segment, 2u);
    EXPECT_EQ(*log->read(last), "last");
}

TEST(SegmentLog, AWriteWithoutRoomHasNotBeen) {
    const TempDirectory directory;
    for (int k = 1; k <= 6; ++k) {
        FailingFiles files;
        files.failing_write = k;
        const auto folder = directory.path / std::to_string(k);
        std::filesystem::create_directory(folder);
        auto log = SegmentLog::open(folder, {}, 200, files);
        std::vector<PayloadPlace> places;
        for (int i = 0; i < 6; ++i) {
            auto place = append(*log, std::string(70, char('a' + i)));
            if (!place.ok()) {
                EXPECT_EQ(place.status().code(), StatusCode::kResourceExhausted);
                EXPECT_EQ(i + 1, k);
                place = append(*log, std::string(70, char('a' + i)));  // there is room again
            }
            ASSERT_TRUE(place.ok()) << place.status().message();
            places.push_back(*place);
        }
        EXPECT_TRUE(log->sync().ok());
        EXPECT_FALSE(log->broken());
        auto again = SegmentLog::open(folder, {}, 200);
        for (int i = 0; i < 6; ++i) EXPECT_EQ(*again->read(places[size_t(i)]), std::string(70, char('a' + i)));
    }
}

TEST(SegmentLog, RewindForgetsAlsoWholeSegments) {
    const TempDirectory directory;
    auto log = SegmentLog::open(directory.path, {}, 100);
    const SegmentLog::Mark empty = log->mark();
    (void)append(*log, "gone");
    ASSERT_TRUE(log->rewind(empty).ok());
    EXPECT_TRUE(log->segments()->empty());
    const PayloadPlace first = *append(*log, "first");
    const SegmentLog::Mark mark = log->mark();
    for (int i = 0; i < 4; ++i) (void)append(*log, std::string(60, 'x'));
    EXPECT_EQ(log->segments()->size(), 5u);
    ASSERT_TRUE(log->rewind(mark).ok());
    EXPECT_EQ(*log->segments(), std::vector<uint32_t>{1});
    const PayloadPlace second = *append(*log, "second");
    EXPECT_EQ(second.segment, 1u);
    EXPECT_EQ(second.offset, SegmentLog::kHeaderBytes + 5);
    EXPECT_EQ(*log->read(first), "first");
    EXPECT_EQ(*log->read(second), "second");
}

TEST(SegmentLog, AfterAFlushThatFailedNothingIsBelieved) {
    const TempDirectory directory;
    FailingFiles files;
    files.failing_sync = 1;
    auto log = SegmentLog::open(directory.path, {}, SegmentLog::kSegmentBytes, files);
    ASSERT_TRUE(append(*log, "payload").ok());
    EXPECT_FALSE(log->sync().ok());
    ASSERT_TRUE(log->broken());
    EXPECT_FALSE(log->sync().ok()) << "a second flush would succeed, and mean nothing";
    EXPECT_FALSE(append(*log, "more").ok());
}

}  // namespace
}  // namespace lightloom
