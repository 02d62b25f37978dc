#include "common/work/asset.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "common/core/utf8.h"

namespace lightloom {
namespace {

constexpr std::string_view kHeader = "lightloom-scene 1";

/// Cuts one line off the front; nullopt without a final newline.
std::optional<std::string_view> take_line(std::string_view& text) {
    const size_t end = text.find('\n');
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    return line;
}

/// Parses "a,b,c": words of lower-case letters, digits and hyphens, ascending.
bool parse_names(std::string_view text, std::vector<std::string>* names) {
    for (size_t begin = 0; begin <= text.size();) {
        const size_t end = std::min(text.find(',', begin), text.size());
        std::string name(text.substr(begin, end - begin));
        const auto plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-'; };
        if (name.empty() || name.size() > 64 || !std::all_of(name.begin(), name.end(), plain)) return false;
        if (!names->empty() && !(names->back() < name)) return false;
        names->push_back(std::move(name));
        begin = end + 1;
    }
    return true;
}

Status bad_line(int number, std::string_view what) {
    return invalid_argument("scene file list, line " + std::to_string(number) + ": " + std::string(what));
}

}  // namespace

Status validate_asset_path(std::string_view path) {
    const std::string shown = clipped_utf8(path, 80);
    if (path.empty()) return invalid_argument("empty file name in a scene");
    if (path.size() > 1024) return invalid_argument("file name longer than 1024 bytes: " + shown + "...");
    for (const char c : path) {
        if (uint8_t(c) < 0x20 || c == 0x7f || c == '\\')
            return invalid_argument("file name with a control character or backslash; rename the file");
    }
    // Manifests and status are JSON, and messages on the wire are text: neither can carry other bytes.
    if (!is_utf8(path)) return invalid_argument("a file name in the scene is not UTF-8; rename the file");
    for (size_t begin = 0; begin <= path.size();) {
        const size_t end = std::min(path.find('/', begin), path.size());
        const std::string_view part = path.substr(begin, end - begin);
        if (part.empty() || part == "." || part == ".." || part.size() > 255)
            return invalid_argument("\"" + shown + "\" is not a plain path inside the scene's directory");
        begin = end + 1;
    }
    return {};
}

std::string AssetManifest::canonical_text() const {
    std::string text(kHeader);
    text += "\nmain " + main + "\n";
    for (size_t i = 0; i < without.size(); ++i) text += (i == 0 ? "without " : ",") + without[i];
    if (!without.empty()) text += "\n";
    for (const AssetEntry& e : entries) {
        text += e.digest.hex() + " " + std::to_string(e.size_bytes) + " " + e.path + "\n";
    }
    return text;
}

Result<AssetManifest> AssetManifest::parse(std::string_view text) {
    const std::string_view whole = text;
    AssetManifest manifest;
    int number = 1;
    auto line = take_line(text);
    if (!line || *line != kHeader) return bad_line(number, "expected \"" + std::string(kHeader) + "\"");
    line = take_line(text);
    ++number;
    if (!line || !line->starts_with("main ")) return bad_line(number, "expected \"main PATH\"");
    manifest.main = line->substr(5);
    constexpr std::string_view kWithout = "without ";
    if (text.starts_with(kWithout)) {
        line = take_line(text);
        ++number;
        if (!line || !parse_names(line->substr(kWithout.size()), &manifest.without))
            return bad_line(number, "expected \"without NAME,NAME...\" in ascending order");
    }
    while (!text.empty()) {
        line = take_line(text);
        ++number;
        if (!line) return bad_line(number, "no newline at the end");
        AssetEntry entry;
        if (line->size() < 68 || (*line)[64] != ' ') return bad_line(number, "expected \"DIGEST SIZE PATH\"");
        auto digest = Digest::from_hex(line->substr(0, 64));
        if (!digest.ok()) return bad_line(number, digest.status().message());
        entry.digest = *digest;
        const char* end = line->data() + line->size();
        const auto [next, error] = std::from_chars(line->data() + 65, end, entry.size_bytes);
        if (error != std::errc() || next == end || *next != ' ') return bad_line(number, "expected a size");
        entry.path.assign(next + 1, end);
        if (Status s = validate_asset_path(entry.path); !s.ok()) return bad_line(number, s.message());
        if (!manifest.entries.empty() && !(manifest.entries.back().path < entry.path))
            return bad_line(number, "paths are not in ascending order");
        manifest.entries.push_back(std::move(entry));
    }
    const bool has_main =
        std::any_of(manifest.entries.begin(), manifest.entries.end(), [&](const AssetEntry& e) { return e.path == manifest.main; });
    if (!has_main) return bad_line(2, "the main file is not in the list");
    if (manifest.canonical_text() != whole) return invalid_argument("the scene file list is not in canonical form");
    return manifest;
}

Result<AssetManifest> AssetManifest::of_files(const std::filesystem::path& directory, const std::vector<std::string>& files,
                                              std::vector<std::string> without) {
    if (files.empty()) return invalid_argument("a scene needs at least one file");
    AssetManifest manifest;
    manifest.main = files.front();
    std::sort(without.begin(), without.end());
    without.erase(std::unique(without.begin(), without.end()), without.end());
    manifest.without = std::move(without);
    for (const std::string& file : files) {
        LL_RETURN_IF_ERROR(validate_asset_path(file));
        AssetEntry entry{.path = file};
        auto digest = digest_file(directory / file);
        if (!digest.ok()) return digest.status();
        entry.digest = *digest;
        std::error_code error;
        entry.size_bytes = std::filesystem::file_size(directory / file, error);
        if (error) return not_found((directory / file).string() + ": " + error.message());
        manifest.entries.push_back(std::move(entry));
    }
    std::sort(manifest.entries.begin(), manifest.entries.end(),
              [](const AssetEntry& a, const AssetEntry& b) { return a.path < b.path; });
    manifest.entries.erase(std::unique(manifest.entries.begin(), manifest.entries.end(),
                                       [](const AssetEntry& a, const AssetEntry& b) { return a.path == b.path; }),
                           manifest.entries.end());
    return manifest;
}

}  // namespace lightloom
