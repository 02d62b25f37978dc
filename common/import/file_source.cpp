#include "common/import/file_source.h"

#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "common/import/diagnostics.h"

namespace lightloom::import {

Result<std::string> FileSource::normalise(std::string_view reference, size_t level, size_t* highest) const {
    const std::string shown = quoted(std::string(reference));
    if (reference.empty()) return invalid_argument("the file name is empty");
    if (reference.front() == '/')
        return invalid_argument("the file name " + shown + " is absolute; use a path relative to the scene file's directory");
    if (reference.find('\0') != std::string_view::npos) return invalid_argument("the file name " + shown + " contains a zero byte");
    std::vector<std::string_view> parts;
    size_t up = *highest = level;
    for (size_t begin = 0; begin <= reference.size();) {
        const size_t end = std::min(reference.find('/', begin), reference.size());
        const std::string_view part = reference.substr(begin, end - begin);
        if (part == "..") {
            if (!parts.empty())
                parts.pop_back();
            else if (up < above_.size())
                *highest = std::max(*highest, ++up);
            else
                return invalid_argument(
                    "the file name " + shown +
                    " leaves the scene's root directory, so a worker could not get it; move the file, or name a "
                    "directory that holds everything with --root");
        } else if (parts.empty() && up > 0 && part == above_[up - 1]) {
            --up;  // Goes back down towards the main file.
        } else if (!part.empty() && part != ".") {
            parts.push_back(part);
        }
        begin = end + 1;
    }
    if (parts.empty()) return invalid_argument("the file name " + shown + " names a directory");
    std::string out;
    for (size_t i = 0; i < up; ++i) out += "../";
    out += parts[0];
    for (size_t i = 1; i < parts.size(); ++i) out.append("/").append(parts[i]);
    return out;
}

Result<std::string> FileSource::resolve(std::string_view reference) {
    size_t highest = 0;
    const Result<std::string> first = normalise(reference, 0, &highest);
    for (size_t level = 0; level <= above_.size(); ++level) {
        const Result<std::string> name = level == 0 ? first : normalise(reference, level, &highest);
        if (!name.ok()) break;
        if (!exists(*name)) continue;
        levels_ = std::max(levels_, highest);
        return name;
    }
    return first;
}

Result<std::string> FileSource::read(const std::string& name) {
    Result<std::string> bytes = read_bytes(name);
    if (bytes.ok() && known_.insert(name).second) files_.push_back(name);
    return bytes;
}

std::vector<std::string> FileSource::files() const {
    std::vector<std::string> out;
    for (const std::string& name : files_) {
        size_t up = 0;
        while (name.compare(3 * up, 3, "../") == 0) ++up;
        std::string path;
        for (size_t level = levels_; level > up; --level) path += above_[level - 1] + "/";
        out.push_back(path + name.substr(3 * up));
    }
    return out;
}

Result<std::string> DirectorySource::read_bytes(const std::string& name) {
    const std::string path = path_of(name);
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

bool DirectorySource::exists(const std::string& name) const {
    struct stat info {};
    return stat(path_of(name).c_str(), &info) == 0;
}

Result<std::string> MemorySource::read_bytes(const std::string& name) {
    const auto it = contents_.find(name);
    if (it == contents_.end()) return not_found("cannot open " + quoted(name) + ": no such file below the scene's directory");
    return it->second;
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
