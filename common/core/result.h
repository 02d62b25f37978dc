#pragma once
// Errors as values: a Status with a canonical code and one clear line; Result<T> is a value or such a Status.

#include <optional>
#include <string>
#include <utility>

#include "common/core/check.h"

namespace lightloom {

/// Canonical codes; the numbers equal gRPC's, so a Status crosses the wire unchanged.
enum class StatusCode : int {
    kOk = 0,
    kCancelled = 1,
    kUnknown = 2,
    kInvalidArgument = 3,
    kDeadlineExceeded = 4,
    kNotFound = 5,
    kAlreadyExists = 6,
    kPermissionDenied = 7,
    kResourceExhausted = 8,
    kFailedPrecondition = 9,
    kAborted = 10,
    kOutOfRange = 11,
    kUnimplemented = 12,
    kInternal = 13,
    kUnavailable = 14,
    kDataLoss = 15,
};

class [[nodiscard]] Status {
  public:
    Status() = default;
    Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}
    static Status ok_status() { return {}; }

    bool ok() const { return code_ == StatusCode::kOk; }
    StatusCode code() const { return code_; }
    /// One line, no trailing newline: where (file:line when there is one), what, and what to do.
    const std::string& message() const { return message_; }

  private:
    StatusCode code_ = StatusCode::kOk;
    std::string message_;
};

inline Status invalid_argument(std::string m) { return {StatusCode::kInvalidArgument, std::move(m)}; }
inline Status not_found(std::string m) { return {StatusCode::kNotFound, std::move(m)}; }
inline Status failed_precondition(std::string m) { return {StatusCode::kFailedPrecondition, std::move(m)}; }
inline Status data_loss(std::string m) { return {StatusCode::kDataLoss, std::move(m)}; }
inline Status internal_error(std::string m) { return {StatusCode::kInternal, std::move(m)}; }

template <typename T>
class [[nodiscard]] Result {
  public:
    Result(T value) : value_(std::move(value)) {}          // NOLINT: implicit by design
    Result(Status status) : status_(std::move(status)) {}  // NOLINT: implicit by design

    bool ok() const { return value_.has_value(); }
    const Status& status() const { return status_; }
    // All of these require a value; debug builds abort with the status if there is none.
    T& value() & { return *checked(); }
    const T& value() const& { return *checked(); }
    T&& value() && { return *std::move(checked()); }
    T* operator->() { return &*checked(); }
    const T* operator->() const { return &*checked(); }
    T& operator*() & { return *checked(); }
    const T& operator*() const& { return *checked(); }
    T&& operator*() && { return *std::move(checked()); }  // like std::optional: *std::move(r) moves

  private:
    std::optional<T>& checked() {
        LL_DCHECK(value_.has_value(), status_.message());
        return value_;
    }
    const std::optional<T>& checked() const {
        LL_DCHECK(value_.has_value(), status_.message());
        return value_;
    }

    std::optional<T> value_;
    Status status_;
};

#define LL_RETURN_IF_ERROR(expr)                                                       \
    do {                                                                               \
        if (::lightloom::Status ll_status = (expr); !ll_status.ok()) return ll_status; \
    } while (false)

}  // namespace lightloom
