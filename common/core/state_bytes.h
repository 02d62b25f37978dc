#pragma once
// StateWriter and StateReader: values as bytes, for state that the same build or a later one reads again on the same kind of host.
// Values are written as they lie in memory (little endian). The reader checks every bound and never reads beyond the end.

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace lightloom {

static_assert(std::endian::native == std::endian::little, "state is written as memory");

class StateWriter {
  public:
    explicit StateWriter(std::string& out) : out_(out) {}

    template <class T>
    void put(const T& value) {
        put_array(&value, 1);
    }
    template <class T>
    void put_array(const T* values, size_t count) {
        static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>, "the padding of a struct is nobody's state");
        out_.append(reinterpret_cast<const char*>(values), count * sizeof(T));
    }

  private:
    std::string& out_;
};

class StateReader {
  public:
    explicit StateReader(std::string_view bytes) : rest_(bytes) {}

    /// False, now and from then on, once the bytes have ended too early or fail() was called. Values are then zero.
    bool ok() const { return ok_; }
    void fail() { ok_ = false; }
    bool at_end() const { return rest_.empty(); }
    size_t remaining() const { return rest_.size(); }

    template <class T>
    T get() {
        T value{};
        get_array(&value, 1);
        return value;
    }
    template <class T>
    void get_array(T* values, size_t count) {
        static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
        if (!ok_ || count > rest_.size() / sizeof(T)) {
            ok_ = false;
            return;
        }
        std::memcpy(values, rest_.data(), count * sizeof(T));
        rest_.remove_prefix(count * sizeof(T));
    }
    /// Reads `count` values; allocates nothing if there are not so many.
    template <class T>
    void get_vector(std::vector<T>& values, size_t count) {
        if (!ok_ || count > rest_.size() / sizeof(T)) {
            ok_ = false;
            return;
        }
        values.resize(count);
        get_array(values.data(), count);
    }

  private:
    std::string_view rest_;
    bool ok_ = true;
};

}  // namespace lightloom
