#pragma once
// Streams through which OpenEXR reads from and writes to memory. They are inline, so that the importer and its fuzz
// targets can use them without linking to the film library.

#include <ImfIO.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace lightloom {

class ExrMemoryOutput final : public Imf::OStream {
  public:
    ExrMemoryOutput() : Imf::OStream("memory") {}
    void write(const char data[], int size) override {
        if (position_ + uint64_t(size) > bytes.size()) bytes.resize(position_ + uint64_t(size));
        std::memcpy(bytes.data() + position_, data, size_t(size));
        position_ += uint64_t(size);
    }
    uint64_t tellp() override { return position_; }
    void seekp(uint64_t position) override { position_ = position; }

    std::string bytes;

  private:
    uint64_t position_ = 0;
};

/// The bytes must outlive the stream. As in a file, a position beyond the end is allowed; only reading there is an
/// error.
class ExrMemoryInput final : public Imf::IStream {
  public:
    ExrMemoryInput(const char* name, std::string_view bytes) : Imf::IStream(name), bytes_(bytes) {}
    bool read(char data[], int size) override {
        if (size < 0 || position_ > bytes_.size() || uint64_t(size) > bytes_.size() - position_)
            throw std::runtime_error("the file ends early");
        std::memcpy(data, bytes_.data() + position_, size_t(size));
        position_ += uint64_t(size);
        return position_ < bytes_.size();
    }
    uint64_t tellg() override { return position_; }
    void seekg(uint64_t position) override { position_ = position; }

  private:
    std::string_view bytes_;
    uint64_t position_ = 0;
};

/// Turns the text of an OpenEXR error into one line.
inline std::string one_line(std::string text) {
    for (char& c : text)
        if (c == '\n' || c == '\r') c = ' ';
    return text;
}

}  // namespace lightloom
