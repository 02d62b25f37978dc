#include "server/store/database.h"

#include <sqlite3.h>

#include <utility>

#include "server/store/files.h"

namespace lightloom {
namespace {

/// Set before anything is read.
constexpr const char* kSettings =
    "PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;"
    "PRAGMA journal_size_limit=67108864;";

constexpr const char* kRescue = "put a copy of it back, or move it and the files beside it away to begin without the jobs in it";

template <class... F>
struct Overloaded : F... {
    using F::operator()...;
};

void bind(sqlite3_stmt* statement, int index, const SqlValue& value) {
    std::visit(Overloaded{[&](std::monostate) { sqlite3_bind_null(statement, index); },
                          [&](int64_t v) { sqlite3_bind_int64(statement, index, v); },
                          [&](double v) { sqlite3_bind_double(statement, index, v); },
                          [&](std::string_view v) {
                              sqlite3_bind_text64(statement, index, v.empty() ? "" : v.data(), v.size(), SQLITE_STATIC,
                                                  SQLITE_UTF8);
                          },
                          [&](SqlBlob v) {
                              const char* const data = v.bytes.empty() ? "" : v.bytes.data();
                              sqlite3_bind_blob64(statement, index, data, v.bytes.size(), SQLITE_STATIC);
                          }},
               value.value());
}

/// The system's error of the last access to the database or its log that failed; sqlite3_system_errno() forgets it on the way.
int system_error(sqlite3* handle) {
    int error = 0;
    sqlite3_file* log = nullptr;
    sqlite3_file_control(handle, "main", SQLITE_FCNTL_JOURNAL_POINTER, &log);
    if (log && log->pMethods) log->pMethods->xFileControl(log, SQLITE_FCNTL_LAST_ERRNO, &error);
    if (error == 0) sqlite3_file_control(handle, "main", SQLITE_FCNTL_LAST_ERRNO, &error);
    return error;
}

}  // namespace

bool SqlRow::is_null(int column) const { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
int64_t SqlRow::integer(int column) const { return sqlite3_column_int64(statement_, column); }
double SqlRow::real(int column) const { return sqlite3_column_double(statement_, column); }
std::string_view SqlRow::bytes(int column) const {
    const void* const data = sqlite3_column_blob(statement_, column);
    return data ? std::string_view(static_cast<const char*>(data), size_t(sqlite3_column_bytes(statement_, column)))
                : std::string_view();
}

Result<Database> Database::open(const std::filesystem::path& file, std::span<const std::string_view> migrations) {
    sqlite3* handle = nullptr;
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
    const int opened = sqlite3_open_v2(file.c_str(), &handle, flags, nullptr);
    Database database(handle, file.string());
    if (!handle) return Status(StatusCode::kResourceExhausted, file.string() + ": cannot be opened: out of memory");
    if (opened != SQLITE_OK) return database.failure();
    sqlite3_busy_timeout(handle, 1000);
    LL_RETURN_IF_ERROR(database.script(kSettings));
    LL_RETURN_IF_ERROR(database.check());
    LL_RETURN_IF_ERROR(database.migrate(migrations));
    return database;
}

Database::Database(Database&& other) noexcept
    : handle_(std::exchange(other.handle_, nullptr)),
      file_(std::move(other.file_)),
      statements_(std::move(other.statements_)),
      flush_failed_(other.flush_failed_) {
    other.statements_.clear();
}

Database::~Database() {
    for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement);
    sqlite3_close(handle_);
}

Status Database::check() {
    std::string verdict;
    LL_RETURN_IF_ERROR(each("PRAGMA quick_check(1)", {}, [&](const SqlRow& row) {
        verdict = row.text(0);
        return Status();
    }));
    if (verdict != "ok") return data_loss(file_ + ": the database is damaged (" + verdict + "); " + kRescue);
    return {};
}

Status Database::migrate(std::span<const std::string_view> migrations) {
    int64_t version = 0;
    LL_RETURN_IF_ERROR(each("PRAGMA user_version", {}, [&](const SqlRow& row) {
        version = row.integer(0);
        return Status();
    }));
    if (version < 0 || version > int64_t(migrations.size()))
        return failed_precondition(file_ + ": was written by a newer coordinator (schema " + std::to_string(version) +
                                   ", this one knows " + std::to_string(migrations.size()) +
                                   "); start that one, or give another directory with --data");
    for (size_t i = size_t(version); i < migrations.size(); ++i) {
        const std::string whole =
            std::string("BEGIN IMMEDIATE;").append(migrations[i]) + ";PRAGMA user_version=" + std::to_string(i + 1) + ";COMMIT;";
        if (Status made = script(whole); !made.ok()) {
            LL_RETURN_IF_ERROR(rollback());
            return made;
        }
    }
    return {};
}

Status Database::failure() {
    const int code = sqlite3_extended_errcode(handle_);
    const int kind = code & 0xff;
    const std::string line = file_ + ": " + sqlite3_errmsg(handle_);
    const int error = kind == SQLITE_IOERR ? system_error(handle_) : 0;
    if (code == SQLITE_IOERR_FSYNC || code == SQLITE_IOERR_DIR_FSYNC) flush_failed_ = true;
    if (kind == SQLITE_CORRUPT || kind == SQLITE_NOTADB) return data_loss(line + "; " + kRescue);
    if (kind == SQLITE_FULL || kind == SQLITE_NOMEM || (code == SQLITE_IOERR_WRITE && is_no_room(error)))
        return {StatusCode::kResourceExhausted, line};
    if (kind == SQLITE_BUSY) return failed_precondition(line + "; another process uses it");
    return internal_error(line + " (" + std::to_string(code) + ", error " + std::to_string(error) + " of the system)");
}

Status Database::script(const std::string& sql) {
    return sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK ? Status() : failure();
}

Result<sqlite3_stmt*> Database::prepared(const char* sql, std::initializer_list<SqlValue> values) {
    sqlite3_stmt*& statement = statements_[sql];
    if (!statement && sqlite3_prepare_v3(handle_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr) != SQLITE_OK)
        return failure();
    int index = 0;
    for (const SqlValue& value : values) bind(statement, ++index, value);
    return statement;
}

Status Database::each(const char* sql, std::initializer_list<SqlValue> values, const std::function<Status(const SqlRow&)>& row) {
    const auto statement = prepared(sql, values);
    if (!statement.ok()) return statement.status();
    Status status;
    for (int step = SQLITE_ROW; step == SQLITE_ROW && status.ok();) {
        step = sqlite3_step(*statement);
        if (step == SQLITE_ROW)
            status = row(SqlRow(*statement));
        else if (step != SQLITE_DONE)
            status = failure();
    }
    sqlite3_reset(*statement);
    return status;
}

Status Database::run(const char* sql, std::initializer_list<SqlValue> values) {
    return each(sql, values, [](const SqlRow&) { return Status(); });
}

int64_t Database::changes() const { return sqlite3_changes64(handle_); }

Status Database::begin() { return run("BEGIN IMMEDIATE"); }

Status Database::commit() { return run("COMMIT"); }

Status Database::rollback() { return sqlite3_get_autocommit(handle_) ? Status() : run("ROLLBACK"); }

}  // namespace lightloom
