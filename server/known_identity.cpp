#include "server/known_identity.h"

#include <cpuid.h>
#include <elf.h>
#include <link.h>

#include <cstdlib>
#include <cstring>
#include <string_view>
#include <system_error>
#include <vector>

#include "common/cli/log_line.h"
#include "common/core/atomic_file.h"
#include "common/work/identity.h"

namespace lightloom {
namespace {

constexpr size_t kHexDigits = 64;

std::string hex_of(const void* data, size_t size) {
    static constexpr char kDigits[] = "0123456789abcdef";
    std::string text;
    for (size_t i = 0; i < size; ++i) {
        const uint8_t byte = static_cast<const uint8_t*>(data)[i];
        text += kDigits[byte >> 4];
        text += kDigits[byte & 15];
    }
    return text;
}

/// The build id among the notes of a loaded object, or an empty text.
std::string build_id_of(const dl_phdr_info& object) {
    for (int i = 0; i < object.dlpi_phnum; ++i) {
        const ElfW(Phdr)& segment = object.dlpi_phdr[i];
        if (segment.p_type != PT_NOTE) continue;
        const size_t alignment = segment.p_align == 8 ? 8 : 4;
        const auto padded = [alignment](size_t size) { return (size + alignment - 1) / alignment * alignment; };
        const char* notes = reinterpret_cast<const char*>(object.dlpi_addr + segment.p_vaddr);
        for (size_t at = 0; at + sizeof(ElfW(Nhdr)) <= segment.p_memsz;) {
            ElfW(Nhdr) note;
            std::memcpy(&note, notes + at, sizeof note);
            const size_t name = at + sizeof note, content = padded(name + note.n_namesz);
            if (content + note.n_descsz > segment.p_memsz) break;
            if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && std::memcmp(notes + name, "GNU", 4) == 0)
                return hex_of(notes + content, note.n_descsz);
            at = padded(content + note.n_descsz);
        }
    }
    return {};
}

/// A line for every object in memory; empty if one of them has no build id.
std::string loaded_code() {
    std::string text;
    const auto add = [](dl_phdr_info* object, size_t, void* out) {
        const std::string id = build_id_of(*object);
        auto& lines = *static_cast<std::string*>(out);
        if (id.empty()) {
            lines.clear();
            return 1;
        }
        lines += "code " + id + "\n";
        return 0;
    };
    dl_iterate_phdr(add, &text);
    return text;
}

/// Maker, model and instruction sets, without what differs between the cores of one machine.
std::string processor() {
    std::string text = "processor ";
    const auto add = [&text](unsigned leaf, std::initializer_list<int> registers) {
        unsigned values[4] = {};
        if (__get_cpuid_count(leaf, 0, &values[0], &values[1], &values[2], &values[3]) == 0) return;
        for (const int r : registers) text += hex_of(&values[r], sizeof values[r]);
    };
    add(0, {0, 1, 2, 3});
    add(1, {0, 2, 3});  // EBX has the number of the core
    add(7, {1, 2, 3});
    for (const unsigned part : {2u, 3u, 4u}) add(0x80000000u + part, {0, 1, 2, 3});
    return text + "\n";
}

std::string line_of(const Digest& key, const Digest& golden) {
    std::string text = key.hex();
    text += ' ';
    text += golden.hex();
    const Digest check = sha256("lightloom-golden-units 1 " + text);
    text += ' ';
    text += check.hex();
    return text;
}

struct Line {
    std::string text;
    Digest key, golden;
};

/// The lines that are as they were written; `damaged` counts the others.
std::vector<Line> lines_of(std::string_view text, size_t* damaged) {
    std::vector<Line> lines;
    while (!text.empty()) {
        const size_t end = text.find('\n');
        const std::string_view line = text.substr(0, end);
        text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
        const auto key = Digest::from_hex(std::string(line.substr(0, kHexDigits)));
        const auto golden = Digest::from_hex(std::string(line.size() > kHexDigits ? line.substr(kHexDigits + 1, kHexDigits) : ""));
        if (key.ok() && golden.ok() && line == line_of(*key, *golden)) {
            lines.push_back({std::string(line), *key, *golden});
        } else {
            ++*damaged;
        }
    }
    return lines;
}

}  // namespace

std::optional<std::string> code_and_machine() {
    const std::string code = loaded_code();
    const auto boot = read_file("/proc/sys/kernel/random/boot_id");
    if (code.empty() || !boot.ok() || boot->empty()) return std::nullopt;
    const char* tunables = std::getenv("GLIBC_TUNABLES");
    std::string text = "build ";
    for (const std::string& part : {std::string(kBuildId), "\nprofile " + math_profile(), "\n" + code, processor(), "boot " + *boot,
                                    "tunables " + std::string(tunables ? tunables : "")})
        text += part;
    return text;
}

std::optional<Digest> GoldenCache::find(const Digest& key) const {
    const auto text = read_file(file_.string());
    if (!text.ok()) return std::nullopt;
    size_t damaged = 0;
    for (const Line& line : lines_of(*text, &damaged))
        if (line.key == key) return line.golden;
    return std::nullopt;
}

void GoldenCache::store(const Digest& key, const Digest& golden) const {
    std::string text = line_of(key, golden) + "\n";
    if (const auto old = read_file(file_.string()); old.ok()) {
        size_t kept = 1, damaged = 0;
        for (const Line& line : lines_of(*old, &damaged))
            if (line.key != key && kept++ < kMaxLines) text += line.text + "\n";
        if (damaged > 0) log_warn("{}: {} damaged line(s) are left out", file_.string(), damaged);
    }
    std::error_code ignored;  // the write reports a directory that cannot be made
    std::filesystem::create_directories(file_.parent_path(), ignored);
    if (const Status s = write_file_atomically(file_.string(), text); !s.ok())
        log_info("the digest of the golden units could not be kept: {}", s.message());
}

Result<BuildIdentity> known_identity(const std::filesystem::path& directory) {
    const auto subject = directory.empty() ? std::nullopt : code_and_machine();
    if (!subject) return build_identity();
    const GoldenCache cache(directory);
    const Digest key = sha256(*subject);
    if (const auto golden = cache.find(key)) {
        log_info("golden units: an earlier process rendered them");
        return BuildIdentity{kBuildId, math_profile(), *golden};
    }
    auto identity = build_identity();
    if (!identity.ok()) return identity;
    log_info("golden units: rendered");
    cache.store(key, identity->golden_digest);
    return identity;
}

}  // namespace lightloom
