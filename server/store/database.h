#pragma once
// Database: SQLite as the store uses it. Everything that is committed is on disk (write-ahead log, synchronous=FULL). No other
// process can open it meanwhile (locking_mode=EXCLUSIVE), and so there is no file of shared memory that a full disk could break.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "common/core/result.h"

struct sqlite3;
struct sqlite3_stmt;

namespace lightloom {

/// Bytes, as SQL knows them; text is a std::string_view.
struct SqlBlob {
    std::string_view bytes;
};

/// What stands for a ? of a statement. Refers to strings, which live at least as long as the call.
class SqlValue {
  public:
    SqlValue(std::nullptr_t) {}
    SqlValue(std::integral auto value) : value_(int64_t(value)) {}
    SqlValue(double value) : value_(value) {}
    SqlValue(std::string_view text) : value_(text) {}
    SqlValue(const std::string& text) : value_(std::string_view(text)) {}
    SqlValue(SqlBlob blob) : value_(blob) {}
    /// NULL for none.
    template <class T>
    SqlValue(const std::optional<T>& value) {
        if (value) *this = SqlValue(*value);
    }
    const auto& value() const { return value_; }

  private:
    std::variant<std::monostate, int64_t, double, std::string_view, SqlBlob> value_;
};

/// A row of an answer, valid during the call that gets it.
class SqlRow {
  public:
    explicit SqlRow(sqlite3_stmt* statement) : statement_(statement) {}
    bool is_null(int column) const;
    int64_t integer(int column) const;
    double real(int column) const;
    /// Of a text or a blob; empty for NULL.
    std::string_view bytes(int column) const;
    std::string text(int column) const { return std::string(bytes(column)); }

  private:
    sqlite3_stmt* statement_;
};

/// For one thread at a time. Errors name the file: kResourceExhausted if there is no room, kDataLoss if it is damaged, kInternal.
class Database {
  public:
    /// Opens or creates `file`, checks it (PRAGMA quick_check) and brings it to the newest schema: `migrations[i]` are the
    /// statements that make version i + 1 of version i, each in a transaction of its own. kDataLoss for a damaged file,
    /// kFailedPrecondition for one of a newer schema, or one that another process uses.
    static Result<Database> open(const std::filesystem::path& file, std::span<const std::string_view> migrations);
    Database(Database&& other) noexcept;
    Database& operator=(Database&&) = delete;
    ~Database();

    /// Runs one statement that gives no rows. The text lives as long as the program: the prepared statement is kept.
    Status run(const char* sql, std::initializer_list<SqlValue> values = {});
    /// Calls `row` with each row of the answer, until it returns an error.
    Status each(const char* sql, std::initializer_list<SqlValue> values, const std::function<Status(const SqlRow&)>& row);
    /// Rows that the last statement inserted, changed or deleted.
    int64_t changes() const;

    Status begin();
    Status commit();
    /// Ends the open transaction, if there is one, as if it had not been.
    Status rollback();

    /// Whether a flush failed: then nobody knows what is on disk, and the process should end.
    bool flush_failed() const { return flush_failed_; }

  private:
    Database(sqlite3* handle, std::string file) : handle_(handle), file_(std::move(file)) {}
    Status check();
    Status migrate(std::span<const std::string_view> migrations);
    Status script(const std::string& sql);
    Result<sqlite3_stmt*> prepared(const char* sql, std::initializer_list<SqlValue> values);
    Status failure();

    sqlite3* handle_;
    std::string file_;
    std::map<const char*, sqlite3_stmt*> statements_;
    bool flush_failed_ = false;
};

}  // namespace lightloom
