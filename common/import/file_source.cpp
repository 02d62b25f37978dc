#include "common/import/file_source.h"

#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "common/import/diagnostics.h"

namespace lightloom::import {

Result<std::string> FileSource::read(const std::string& name) {
    Result<std::string> bytes = read_bytes(name);
    if (bytes.ok() && std::find(files_.begin(), files_.end(), name) == files_.end()) files_.push_back(name);
    return bytes;
}

Result<std::string> DirectorySource::read_bytes(const std::string& name) {
    const std::string path = root_.empty() ? name : root_ + "/" + name;
    struct stat info {};
    if (stat(path.c_str(), &info) != 0)
        return not_found("cannot open " + quoted(name) + ": no such file below the scene's directory");
    if (!S_ISREG(info.st_mode)) return invalid_argument(quoted(name) + " is not a regular file");
    const uint64_t size = uint64_t(info.st_size);
    if (size > max_bytes_)
        return invalid_argument(quoted(name) + " has " + std::to_string(size) + " bytes, more than the limit of " +
                                std::to_string(max_bytes_));
    const std::unique_ptr<FILE, int (*)(FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
    if (!file) return not_found("cannot open " + quoted(name) + ": permission denied or the file vanished");
    std::string bytes(size, '\0');
    if (std::fread(bytes.data(), 1, size, file.get()) != size)
        return data_loss("cannot read " + quoted(name) + ": the file ended early or the disk failed");
    return bytes;
}

Result<std::string> MemorySource::read_bytes(const std::string& name) {
    const auto it = contents_.find(name);
    if (it == contents_.end()) return not_found("cannot open " + quoted(name) + ": no such file below the scene's directory");
    return it->second;
}

Result<std::string> normalise_reference(std::string_view reference) {
    const std::string shown = quoted(std::string(reference));
    if (reference.empty()) return invalid_argument("the file name is empty");
    if (reference.front() == '/')
        return invalid_argument("the file name " + shown + " is absolute; use a path below the scene file's directory");
    if (reference.find('\0') != std::string_view::npos) return invalid_argument("the file name " + shown + " contains a zero byte");
    std::vector<std::string_view> parts;
    size_t begin = 0;
    while (begin <= reference.size()) {
        const size_t end = std::min(reference.find('/', begin), reference.size());
        const std::string_view part = reference.substr(begin, end - begin);
        if (part == "..") {
            if (parts.empty())
                return invalid_argument("the file name " + shown +
                                        " leaves the scene file's directory; move the file below it, or a worker could not get it");
            parts.pop_back();
        } else if (!part.empty() && part != ".") {
            parts.push_back(part);
        }
        begin = end + 1;
    }
    if (parts.empty()) return invalid_argument("the file name " + shown + " names a directory");
    std::string out(parts[0]);
    for (size_t i = 1; i < parts.size(); ++i) out.append("/").append(parts[i]);
    return out;
}

bool has_suffix(std::string_view text, std::string_view suffix) {
    return text.size() >= suffix.size() && text.substr(text.size() - suffix.size()) == suffix;
}

std::string lower_extension(std::string_view name) {
    const size_t dot = name.rfind('.');
    if (dot == std::string_view::npos || name.find('/', dot) != std::string_view::npos) return {};
    std::string out(name.substr(dot + 1));
    for (char& c : out)
        if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
    return out;
}

Result<std::string> inflate_gzip(const std::string& bytes, uint64_t max_bytes) {
    z_stream stream{};
    if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) return internal_error("zlib could not be initialised");
    const std::unique_ptr<z_stream, int (*)(z_stream*)> guard(&stream, inflateEnd);
    std::string out;
    std::vector<char> chunk(256 << 10);
    size_t consumed = 0;
    for (;;) {
        if (stream.avail_in == 0) {
            const size_t n = std::min<size_t>(bytes.size() - consumed, 1u << 30);
            // zlib's interface predates const; it does not write to its input.
            stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + consumed));
            stream.avail_in = uInt(n);
            consumed += n;
        }
        stream.next_out = reinterpret_cast<Bytef*>(chunk.data());
        stream.avail_out = uInt(chunk.size());
        const int code = inflate(&stream, Z_NO_FLUSH);
        const size_t produced = chunk.size() - stream.avail_out;
        if (out.size() + produced > max_bytes)
            return invalid_argument("the gzip data expand to more than the limit of " + std::to_string(max_bytes) + " bytes");
        out.append(chunk.data(), produced);
        if (code == Z_STREAM_END) {
            const bool done = stream.avail_in == 0 && consumed == bytes.size();
            // A gzip file may hold several members one after the other.
            if (done || inflateReset(&stream) != Z_OK) return out;
            continue;
        }
        if (code != Z_OK || (produced == 0 && stream.avail_in == 0 && consumed == bytes.size()))
            return data_loss("the gzip data are damaged or end early");
    }
}

}  // namespace lightloom::import
