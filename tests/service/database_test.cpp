// The database of the store: schemas, damage, and a disk that is full.

#include "server/store/database.h"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>

#include "common/core/atomic_file.h"
#include "tests/support/temp_directory.h"

namespace lightloom {
namespace {

using testing::TempDirectory;

constexpr std::string_view kFirst = "CREATE TABLE t(a INTEGER PRIMARY KEY, b BLOB)";
constexpr std::string_view kSecond = "ALTER TABLE t ADD COLUMN c TEXT DEFAULT 'new'; UPDATE t SET c='old'";
constexpr std::string_view kBoth[] = {kFirst, kSecond};

int64_t count(Database& database) {
    int64_t rows = -1;
    EXPECT_TRUE(database
                    .each("SELECT COUNT(*) FROM t", {},
                          [&](const SqlRow& row) {
                              rows = row.integer(0);
                              return Status();
                          })
                    .ok());
    return rows;
}

TEST(Database, ValuesComeBackAsTheyWere) {
    const TempDirectory directory;
    auto database = Database::open(directory.path / "d.db", kBoth);
    ASSERT_TRUE(database.ok()) << database.status().message();
    const std::string bytes("a\0b", 3);
    ASSERT_TRUE(database->run("INSERT INTO t VALUES(?,?,?)", {int64_t(-1) << 62, SqlBlob{bytes}, nullptr}).ok());
    ASSERT_TRUE(database->run("INSERT INTO t VALUES(?,?,?)", {7u, SqlBlob{}, std::string_view("text")}).ok());
    int rows = 0;
    ASSERT_TRUE(database
                    ->each("SELECT a, b, c FROM t ORDER BY a", {},
                           [&](const SqlRow& row) {
                               if (rows++ == 0) {
                                   EXPECT_EQ(row.integer(0), int64_t(-1) << 62);
                                   EXPECT_EQ(row.text(1), bytes);
                                   EXPECT_TRUE(row.is_null(2));
                               } else {
                                   EXPECT_EQ(row.text(1), "");
                                   EXPECT_EQ(row.text(2), "text");
                               }
                               return Status();
                           })
                    .ok());
    EXPECT_EQ(rows, 2);
}

TEST(Database, OldSchemasAreMigratedAndNewerOnesRefused) {
    const TempDirectory directory;
    const auto file = directory.path / "d.db";
    {
        auto old = Database::open(file, std::span(kBoth, 1));
        ASSERT_TRUE(old.ok()) << old.status().message();
        ASSERT_TRUE(old->run("INSERT INTO t VALUES(1, NULL)").ok());
    }
    {
        // One that fails half-way leaves version 1.
        const std::string_view wrong[] = {kFirst, "ALTER TABLE t ADD COLUMN c TEXT; INSERT INTO nothing VALUES(1)"};
        EXPECT_EQ(Database::open(file, wrong).status().code(), StatusCode::kInternal);
    }
    {
        auto migrated = Database::open(file, kBoth);
        ASSERT_TRUE(migrated.ok()) << migrated.status().message();
        EXPECT_TRUE(migrated
                        ->each("SELECT c FROM t", {},
                               [&](const SqlRow& row) {
                                   EXPECT_EQ(row.text(0), "old");
                                   return Status();
                               })
                        .ok());
        ASSERT_TRUE(migrated->run("INSERT INTO t(a) VALUES(2)").ok());
    }
    {
        auto again = Database::open(file, kBoth);
        ASSERT_TRUE(again.ok());
        EXPECT_EQ(count(*again), 2) << "a migration runs once";
    }
    const auto newer = Database::open(file, std::span(kBoth, 1));
    EXPECT_EQ(newer.status().code(), StatusCode::kFailedPrecondition);
    EXPECT_EQ(newer.status().message(), file.string() +
                                            ": was written by a newer coordinator (schema 2, this one knows 1); start that one, or "
                                            "give another directory with --data");
}

TEST(Database, DamageIsRefusedByName) {
    const TempDirectory directory;
    const auto file = directory.path / "d.db";
    {
        auto database = Database::open(file, kBoth);
        const std::string bytes(3000, 'x');
        for (int i = 0; i < 200; ++i) ASSERT_TRUE(database->run("INSERT INTO t VALUES(?,?,NULL)", {i, SqlBlob{bytes}}).ok());
    }
    const std::string whole = *read_file(file.string());
    ASSERT_GT(whole.size(), 300000u);
    const auto refused = [&](const std::string& bytes) {
        EXPECT_TRUE(write_file_atomically(file.string(), bytes).ok());
        const auto database = Database::open(file, kBoth);
        EXPECT_EQ(database.status().code(), StatusCode::kDataLoss) << database.status().message();
        EXPECT_NE(database.status().message().find(file.string() + ": "), std::string::npos);
        EXPECT_NE(database.status().message().find("put a copy of it back"), std::string::npos);
    };
    refused(std::string("not a database at all").append(2000, ' '));
    refused(whole.substr(0, whole.size() / 2));
    std::string zeros = whole;
    std::fill(zeros.begin() + 4096, zeros.begin() + 12288, '\0');
    refused(zeros);
    ASSERT_TRUE(write_file_atomically(file.string(), whole).ok());
    EXPECT_TRUE(Database::open(file, kBoth).ok());
}

TEST(Database, TwoCannotUseOneFile) {
    const TempDirectory directory;
    const auto file = directory.path / "d.db";
    auto database = Database::open(file, kBoth);
    ASSERT_TRUE(database->run("INSERT INTO t(a) VALUES(1)").ok());
    const auto second = Database::open(file, kBoth);
    EXPECT_EQ(second.status().code(), StatusCode::kFailedPrecondition) << second.status().message();
}

int write_countdown = 0;

ssize_t counted_write(int file, const void* bytes, size_t size, off_t offset) {
    if (--write_countdown == 0) {
        errno = ENOSPC;
        return -1;
    }
    return ::pwrite(file, bytes, size, offset);
}

/// SQLite's own writes fail, one after the other.
TEST(Database, ATransactionWithoutRoomHasNotBeen) {
    sqlite3_vfs* const vfs = sqlite3_vfs_find(nullptr);
    const char* call = nullptr;
    for (const char* name : {"pwrite64", "pwrite"})
        if (vfs->xGetSystemCall(vfs, name)) call = name;
    ASSERT_NE(call, nullptr);
    ASSERT_EQ(vfs->xSetSystemCall(vfs, call, reinterpret_cast<sqlite3_syscall_ptr>(counted_write)), SQLITE_OK);
    const TempDirectory directory;
    int failures = 0;
    for (int k = 1; k <= 200; ++k) {
        const auto file = directory.path / std::to_string(k);
        write_countdown = 0;
        int64_t acknowledged = 0;
        bool full = false;
        {
            auto database = Database::open(file, kBoth);
            ASSERT_TRUE(database.ok());
            const std::string bytes(500, 'y');
            write_countdown = k;
            for (int i = 0; i < 40; ++i) {
                const auto both = [&]() -> Status {
                    LL_RETURN_IF_ERROR(database->begin());
                    for (int part = 0; part < 2; ++part)
                        LL_RETURN_IF_ERROR(database->run("INSERT INTO t(b) VALUES(?)", {SqlBlob{bytes}}));
                    return database->commit();
                };
                if (const Status status = both(); status.ok()) {
                    acknowledged += 2;
                } else {
                    EXPECT_EQ(status.code(), StatusCode::kResourceExhausted) << status.message();
                    EXPECT_TRUE(database->rollback().ok());
                    EXPECT_FALSE(database->flush_failed());
                    full = true;
                }
            }
            EXPECT_EQ(count(*database), acknowledged);
        }
        failures += full;
        auto again = Database::open(file, kBoth);
        ASSERT_TRUE(again.ok()) << again.status().message();
        EXPECT_EQ(count(*again), acknowledged);
        if (!full) break;
    }
    EXPECT_GT(failures, 20);
    EXPECT_EQ(vfs->xSetSystemCall(vfs, call, nullptr), SQLITE_OK);
}

}  // namespace
}  // namespace lightloom
