#include "common/import/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>

#include "common/import/diagnostics.h"

namespace lightloom::import {
namespace {

enum class Format { kAscii, kLittle, kBig };
enum class Scalar : uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

constexpr std::array<size_t, 8> kScalarBytes{1, 1, 2, 2, 4, 4, 4, 8};

struct Property {
    std::string name;
    Scalar type = Scalar::kFloat;
    bool is_list = false;
    Scalar count_type = Scalar::kUint8;
    int slot = -1;  ///< Index into VertexValue for vertices; 0 marks the index list of faces and strips; -1 is skipped.
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;

    Property* find(std::string_view wanted, bool is_list) {
        for (Property& p : properties)
            if (p.name == wanted && p.is_list == is_list) return &p;
        return nullptr;
    }
};

enum VertexValue { kX, kY, kZ, kNx, kNy, kNz, kU, kV, kVertexValues };

std::optional<Scalar> scalar_type(std::string_view name) {
    constexpr std::array<std::pair<std::string_view, Scalar>, 16> kNames{{
        {"char", Scalar::kInt8},
        {"int8", Scalar::kInt8},
        {"uchar", Scalar::kUint8},
        {"uint8", Scalar::kUint8},
        {"short", Scalar::kInt16},
        {"int16", Scalar::kInt16},
        {"ushort", Scalar::kUint16},
        {"uint16", Scalar::kUint16},
        {"int", Scalar::kInt32},
        {"int32", Scalar::kInt32},
        {"uint", Scalar::kUint32},
        {"uint32", Scalar::kUint32},
        {"float", Scalar::kFloat},
        {"float32", Scalar::kFloat},
        {"double", Scalar::kDouble},
        {"float64", Scalar::kDouble},
    }};
    for (const auto& [text, type] : kNames)
        if (text == name) return type;
    return std::nullopt;
}

/// Assigns a purpose to the properties of vertices. Of several pairs of (u, v) pbrt takes the first in this order.
void set_vertex_slots(Element* vertex) {
    constexpr std::array<std::pair<std::string_view, VertexValue>, 6> kGeometry{
        {{"x", kX}, {"y", kY}, {"z", kZ}, {"nx", kNx}, {"ny", kNy}, {"nz", kNz}}};
    for (const auto& [name, slot] : kGeometry)
        if (Property* p = vertex->find(name, false)) p->slot = slot;
    constexpr std::array<std::array<std::string_view, 2>, 4> kPairs{
        {{"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}};
    for (const auto& [u, v] : kPairs) {
        Property *const first = vertex->find(u, false), *const second = vertex->find(v, false);
        if (!first || !second) continue;
        first->slot = kU;
        second->slot = kV;
        return;
    }
}

void set_index_slot(Element* faces) {
    Property* p = faces->find("vertex_indices", true);
    if (!p) p = faces->find("vertex_index", true);
    if (p) p->slot = 0;
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

std::vector<std::string_view> split_words(std::string_view line) {
    std::vector<std::string_view> words;
    size_t i = 0;
    while (i < line.size()) {
        while (i < line.size() && (line[i] == ' ' || line[i] == '\t' || line[i] == '\r')) ++i;
        const size_t begin = i;
        while (i < line.size() && line[i] != ' ' && line[i] != '\t' && line[i] != '\r') ++i;
        if (i > begin) words.push_back(line.substr(begin, i - begin));
    }
    return words;
}

class Reader {
  public:
    explicit Reader(std::string_view bytes) : bytes_(bytes) {}

    Status read(PlyMesh* mesh);

  private:
    Status header();
    std::optional<std::string_view> next_header_line();
    Status header_line(const std::vector<std::string_view>& words);
    Status check_claims() const;
    Status vertices(const Element& element, PlyMesh* mesh);
    Status faces(const Element& element, PlyMesh* mesh);
    Status strips(const Element& element, PlyMesh* mesh);
    Status start_index_list(const Element& element, PlyMesh* mesh) const;
    bool is_vertex(double number) const { return number >= 0 && number < double(vertex_count_) && number == std::floor(number); }
    /// The error for a bad index in face or strip `i`.
    Status bad_index(const Element& element, uint64_t i) const;
    Status skip(const Element& element);
    bool value(Scalar type, double* out);
    bool skip_property(const Property& p);
    template <typename T>
    T load(const char* p) const;
    double decode(Scalar type, const char* p) const;
    Status ended(const Element& element, uint64_t index) const {
        return data_loss("the data end or are not a number in element " + quoted(element.name) + " number " +
                         std::to_string(index) + " of " + std::to_string(element.count));
    }

    std::string_view bytes_;
    size_t pos_ = 0;
    Format format_ = Format::kAscii;
    bool have_format_ = false;
    char line_end_ = '\n';
    std::vector<Element> elements_;
    uint64_t vertex_count_ = 0;  ///< From the header, because faces may come first.
};

Status Reader::header_line(const std::vector<std::string_view>& words) {
    const std::string_view key = words[0];
    if (key == "format") {
        if (words.size() != 3 || words[2] != "1.0") return invalid_argument("the PLY format line is not \"format KIND 1.0\"");
        if (words[1] == "ascii")
            format_ = Format::kAscii;
        else if (words[1] == "binary_little_endian")
            format_ = Format::kLittle;
        else if (words[1] == "binary_big_endian")
            format_ = Format::kBig;
        else
            return invalid_argument("unknown PLY format " + quoted(std::string(words[1])));
        have_format_ = true;
        return {};
    }
    if (key == "element") {
        Element element;
        if (words.size() != 3) return invalid_argument("a PLY element line is not \"element NAME COUNT\"");
        const auto [end, error] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
        if (error != std::errc() || end != words[2].data() + words[2].size())
            return invalid_argument("the PLY element count " + quoted(std::string(words[2])) + " is not a number");
        element.name = words[1];
        elements_.push_back(std::move(element));
        return {};
    }
    if (key == "property") {
        if (elements_.empty()) return invalid_argument("a PLY property comes before the first element");
        Element& element = elements_.back();
        Property p;
        p.is_list = words.size() == 5 && words[1] == "list";
        if (!p.is_list && words.size() != 3) return invalid_argument("a PLY property line is malformed");
        const auto type = scalar_type(words[p.is_list ? 3 : 1]);
        const auto count_type = p.is_list ? scalar_type(words[2]) : Scalar::kUint8;
        if (!type) return invalid_argument("unknown type " + quoted(std::string(words[p.is_list ? 3 : 1])) + " of a PLY property");
        if (!count_type || *count_type >= Scalar::kFloat)
            return invalid_argument("the count of a PLY list has the type " + quoted(std::string(words[2])) +
                                    ", which is not an integer type");
        p.type = *type;
        p.count_type = *count_type;
        p.name = words.back();
        if (element.find(p.name, true) || element.find(p.name, false))
            return invalid_argument("the PLY property " + quoted(p.name) + " of element " + quoted(element.name) +
                                    " is declared twice");
        element.properties.push_back(std::move(p));
        return {};
    }
    return invalid_argument("unknown PLY header line " + quoted(std::string(key)));
}

/// Returns the next line without its end; nothing if there is none.
std::optional<std::string_view> Reader::next_header_line() {
    if (pos_ >= bytes_.size()) return std::nullopt;
    const size_t begin = pos_, end = std::min(bytes_.find(line_end_, begin), bytes_.size());
    pos_ = std::min(end + 1, bytes_.size());
    return bytes_.substr(begin, end - begin);
}

Status Reader::header() {
    if (bytes_.substr(0, 3) != "ply" || (bytes_.size() > 3 && !is_blank(bytes_[3])))
        return invalid_argument("this is not a PLY file (it does not begin with \"ply\")");
    // Some files end their lines with a carriage return alone.
    const size_t end = bytes_.find_first_of("\r\n");
    if (end != std::string_view::npos && bytes_[end] == '\r' && bytes_.substr(end + 1, 1) != "\n") line_end_ = '\r';
    next_header_line();
    constexpr size_t kMaxProperties = 256;
    size_t lines = 0;
    for (;;) {
        const std::optional<std::string_view> line = next_header_line();
        if (!line) return data_loss("the PLY header has no end_header line");
        const auto words = split_words(*line);
        if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
        if (words[0] == "end_header") break;
        LL_RETURN_IF_ERROR(header_line(words));
        if (++lines > kMaxProperties) return invalid_argument("the PLY header has more than 256 lines");
    }
    if (!have_format_) return invalid_argument("the PLY header has no format line");
    for (Element& element : elements_) {
        if (element.name == "vertex") set_vertex_slots(&element);
        if (element.name == "face" || element.name == "tristrips") set_index_slot(&element);
    }
    const auto vertex = std::find_if(elements_.begin(), elements_.end(), [](const Element& e) { return e.name == "vertex"; });
    if (vertex != elements_.end()) vertex_count_ = vertex->count;
    return check_claims();
}

/// Checks the header's counts: every record of an element takes a minimum of bytes, so that a count for which the rest
/// of the file is too short is false.
Status Reader::check_claims() const {
    uint64_t left = bytes_.size() - pos_;
    for (const Element& element : elements_) {
        uint64_t record = 0;
        for (const Property& p : element.properties)
            record += format_ == Format::kAscii ? 2 : kScalarBytes[size_t(p.is_list ? p.count_type : p.type)];
        if (record == 0) {
            if (element.count > 0 && element.name == "vertex") return invalid_argument("the PLY vertices have no properties");
            continue;
        }
        // The last ascii value needs no separator.
        if (element.count > (left + 1) / record)
            return data_loss("the PLY header claims " + std::to_string(element.count) + " elements " + quoted(element.name) +
                             ", but the file has only " + std::to_string(bytes_.size() - pos_) + " bytes of data");
        left -= std::min(left, element.count * record);
    }
    return {};
}

template <typename T>
T Reader::load(const char* p) const {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), p, sizeof(T));
    if (format_ == Format::kBig) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
}

double Reader::decode(Scalar type, const char* p) const {
    switch (type) {
        case Scalar::kInt8: return load<int8_t>(p);
        case Scalar::kUint8: return load<uint8_t>(p);
        case Scalar::kInt16: return load<int16_t>(p);
        case Scalar::kUint16: return load<uint16_t>(p);
        case Scalar::kInt32: return load<int32_t>(p);
        case Scalar::kUint32: return load<uint32_t>(p);
        case Scalar::kFloat: return double(load<float>(p));
        case Scalar::kDouble: return load<double>(p);
    }
    return 0;
}

bool Reader::value(Scalar type, double* out) {
    if (format_ != Format::kAscii) {
        const size_t size = kScalarBytes[size_t(type)];
        if (bytes_.size() - pos_ < size) return false;
        *out = decode(type, bytes_.data() + pos_);
        pos_ += size;
        return true;
    }
    while (pos_ < bytes_.size() && is_blank(bytes_[pos_])) ++pos_;
    if (pos_ + 1 < bytes_.size() && bytes_[pos_] == '+' && bytes_[pos_ + 1] != '-') ++pos_;
    const char* begin = bytes_.data() + pos_;
    const auto [end, error] = std::from_chars(begin, bytes_.data() + bytes_.size(), *out);
    if (error == std::errc::result_out_of_range) {
        // The number is too small to matter, or too large to be used.
        const std::string_view text(begin, size_t(end - begin));
        *out = text.find("e-") != text.npos || text.find("E-") != text.npos ? 0.0 : double(INFINITY);
    } else if (error != std::errc()) {
        return false;
    }
    pos_ += size_t(end - begin);
    return pos_ == bytes_.size() || is_blank(bytes_[pos_]);
}

bool Reader::skip_property(const Property& p) {
    double count = 1, ignored = 0;
    if (p.is_list && !value(p.count_type, &count)) return false;
    if (count < 0) return false;
    if (format_ != Format::kAscii) {
        const double size = count * double(kScalarBytes[size_t(p.type)]);
        if (size > double(bytes_.size() - pos_)) return false;
        pos_ += size_t(size);
        return true;
    }
    for (double i = 0; i < count; ++i)
        if (!value(p.type, &ignored)) return false;
    return true;
}

Status Reader::vertices(const Element& element, PlyMesh* mesh) {
    bool has[kVertexValues] = {};
    for (const Property& p : element.properties) {
        if (p.slot >= 0)
            has[p.slot] = true;
        else
            mesh->ignored_properties.push_back("vertex " + p.name);
    }
    if (!has[kX] || !has[kY] || !has[kZ]) return invalid_argument("the PLY vertices have no x, y and z");
    const bool normals = has[kNx] && has[kNy] && has[kNz], uvs = has[kU] && has[kV];
    mesh->positions.reserve(element.count);
    if (normals) mesh->normals.reserve(element.count);
    if (uvs) mesh->uvs.reserve(element.count);
    for (uint64_t i = 0; i < element.count; ++i) {
        float v[kVertexValues] = {};
        for (const Property& p : element.properties) {
            if (p.slot < 0) {
                if (!skip_property(p)) return ended(element, i);
                continue;
            }
            double number = 0;
            if (!value(p.type, &number)) return ended(element, i);
            v[p.slot] = float(number);
            const bool normal = p.slot == kNx || p.slot == kNy || p.slot == kNz;
            if (!std::isfinite(v[p.slot]) && !normal)
                return invalid_argument("the PLY vertex " + std::to_string(i) + " has a " + p.name +
                                        " that is not a finite number");
        }
        mesh->positions.push_back({v[kX], v[kY], v[kZ]});
        const Vec3 n{v[kNx], v[kNy], v[kNz]};
        if (normals) {
            mesh->normals.push_back(is_finite(n) ? n : Vec3{0, 0, 0});
            mesh->finite_normals += is_finite(n);
        }
        if (uvs) mesh->uvs.push_back({v[kU], v[kV]});
    }
    return {};
}

Status Reader::start_index_list(const Element& element, PlyMesh* mesh) const {
    bool has_indices = false;
    for (const Property& p : element.properties) {
        has_indices = has_indices || p.slot == 0;
        if (p.slot < 0 && p.name != "face_indices") mesh->ignored_properties.push_back(element.name + " " + p.name);
    }
    if (!has_indices && element.count > 0)
        return invalid_argument("the PLY element " + quoted(element.name) + " has no vertex_indices list");
    return {};
}

Status Reader::bad_index(const Element& element, uint64_t i) const {
    return invalid_argument("the PLY " + (element.name == "face" ? element.name : "triangle strip") + " " + std::to_string(i) +
                            " refers to a vertex that does not exist (the mesh has " + std::to_string(vertex_count_) + ")");
}

Status Reader::faces(const Element& element, PlyMesh* mesh) {
    LL_RETURN_IF_ERROR(start_index_list(element, mesh));
    mesh->indices.reserve(element.count * 3);
    uint32_t face = 0;  // number of faces that are kept
    for (uint64_t i = 0; i < element.count; ++i)
        for (const Property& p : element.properties) {
            const size_t begin = pos_;
            double count = 0;
            if (p.slot >= 0 && !value(p.count_type, &count)) return ended(element, i);
            if (p.slot < 0 || (count >= 0 && count < 3)) {
                pos_ = begin;
                if (!skip_property(p)) return ended(element, i);
                mesh->skipped_faces += p.slot >= 0;
                continue;
            }
            if (count < 0) return invalid_argument("the PLY face " + std::to_string(i) + " has a negative number of vertices");
            // Up to the first polygon, every face is the triangle of the same number.
            mesh->has_polygons = mesh->has_polygons || count > 4;
            const bool polygons = count > 3 || !mesh->faces.empty();
            while (polygons && mesh->faces.size() < mesh->indices.size() / 3) mesh->faces.push_back(uint32_t(mesh->faces.size()));
            uint32_t first = 0, previous = 0;
            for (double corner = 0; corner < count; ++corner) {
                double number = 0;
                if (!value(p.type, &number)) return ended(element, i);
                if (!is_vertex(number)) return bad_index(element, i);
                const uint32_t index = uint32_t(number);
                if (corner >= 2) mesh->indices.insert(mesh->indices.end(), {first, previous, index});
                if (corner >= 2 && polygons) mesh->faces.push_back(face);
                if (corner == 0) first = index;
                previous = index;
            }
            ++face;
        }
    return {};
}

/// Every vertex after the first two makes a triangle with the two before it; every other triangle is turned round. A
/// negative number starts anew.
Status Reader::strips(const Element& element, PlyMesh* mesh) {
    LL_RETURN_IF_ERROR(start_index_list(element, mesh));
    for (uint64_t i = 0; i < element.count; ++i)
        for (const Property& p : element.properties) {
            if (p.slot < 0) {
                if (!skip_property(p)) return ended(element, i);
                continue;
            }
            double count = 0;
            if (!value(p.count_type, &count)) return ended(element, i);
            uint32_t before[2] = {};
            size_t length = 0;
            for (double k = 0; k < count; ++k) {
                double number = 0;
                if (!value(p.type, &number)) return ended(element, i);
                if (number < 0) {
                    length = 0;
                    continue;
                }
                if (!is_vertex(number)) return bad_index(element, i);
                const uint32_t index = uint32_t(number);
                if (length >= 2) {
                    const size_t odd = length % 2;
                    mesh->indices.insert(mesh->indices.end(), {before[odd], before[1 - odd], index});
                }
                before[0] = before[1];
                before[1] = index;
                ++length;
            }
        }
    return {};
}

Status Reader::skip(const Element& element) {
    if (element.properties.empty()) return {};
    for (uint64_t i = 0; i < element.count; ++i)
        for (const Property& p : element.properties)
            if (!skip_property(p)) return ended(element, i);
    return {};
}

Status Reader::read(PlyMesh* mesh) {
    LL_RETURN_IF_ERROR(header());
    if (vertex_count_ > UINT32_MAX) return invalid_argument("the PLY mesh has more than 2^32 vertices");
    // Strips are an older way to write faces: if a file has both, only the faces are read.
    const bool has_faces =
        std::any_of(elements_.begin(), elements_.end(), [](const Element& e) { return e.name == "face" && e.count > 0; });
    const std::string_view index_element = has_faces ? "face" : "tristrips";
    bool seen_vertices = false, seen_faces = false;
    for (const Element& element : elements_) {
        if (element.name == "vertex" && !seen_vertices) {
            LL_RETURN_IF_ERROR(vertices(element, mesh));
            seen_vertices = true;
        } else if (element.name == index_element && !seen_faces) {
            LL_RETURN_IF_ERROR(has_faces ? faces(element, mesh) : strips(element, mesh));
            seen_faces = true;
        } else {
            LL_RETURN_IF_ERROR(skip(element));
        }
    }
    if (!seen_vertices || !seen_faces) return invalid_argument("the PLY file has no vertices or no faces");
    if (mesh->skipped_faces > 0 && mesh->indices.empty())
        return invalid_argument("no face of the PLY mesh has three or more vertices");
    if (mesh->indices.empty()) return invalid_argument("the PLY mesh has no triangles");
    return {};
}

}  // namespace

Result<PlyMesh> read_ply(std::string_view bytes) {
    PlyMesh mesh;
    LL_RETURN_IF_ERROR(Reader(bytes).read(&mesh));
    return mesh;
}

}  // namespace lightloom::import
