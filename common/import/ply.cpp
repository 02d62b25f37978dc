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
    int slot = -1;  ///< Index into VertexValue for vertices; 0 marks a face's index list; -1 is skipped.
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
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

int vertex_slot(std::string_view name) {
    constexpr std::array<std::pair<std::string_view, VertexValue>, 14> kNames{{
        {"x", kX},
        {"y", kY},
        {"z", kZ},
        {"nx", kNx},
        {"ny", kNy},
        {"nz", kNz},
        {"u", kU},
        {"v", kV},
        {"s", kU},
        {"t", kV},
        {"texture_u", kU},
        {"texture_v", kV},
        {"texture_s", kU},
        {"texture_t", kV},
    }};
    for (const auto& [text, slot] : kNames)
        if (text == name) return slot;
    return -1;
}

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
    Status header_line(const std::vector<std::string_view>& words);
    Status check_claims() const;
    Status vertices(const Element& element, PlyMesh* mesh);
    Status faces(const Element& element, PlyMesh* mesh);
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
    std::vector<Element> elements_;
};

Status Reader::header_line(const std::vector<std::string_view>& words) {
    const std::string_view key = words[0];
    if (key == "comment" || key == "obj_info") return {};
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
        if (!type || !count_type || *count_type >= Scalar::kFloat) return invalid_argument("a PLY property has an unknown type");
        p.type = *type;
        p.count_type = *count_type;
        p.name = words.back();
        if (element.name == "vertex" && !p.is_list) p.slot = vertex_slot(p.name);
        if (element.name == "face" && p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index")) p.slot = 0;
        if (p.slot >= 0)
            for (const Property& other : element.properties)
                if (other.slot == p.slot)
                    return invalid_argument("the PLY properties " + quoted(other.name) + " and " + quoted(p.name) +
                                            " say the same thing twice");
        element.properties.push_back(std::move(p));
        return {};
    }
    return invalid_argument("unknown PLY header line " + quoted(std::string(key)));
}

Status Reader::header() {
    if (bytes_.substr(0, 3) != "ply" || (bytes_.size() > 3 && bytes_[3] != '\n' && bytes_[3] != '\r'))
        return invalid_argument("this is not a PLY file (it does not begin with \"ply\")");
    pos_ = std::min(bytes_.find('\n'), bytes_.size());
    constexpr size_t kMaxProperties = 256;
    size_t lines = 0;
    for (;;) {
        if (pos_ >= bytes_.size()) return data_loss("the PLY header has no end_header line");
        const size_t begin = pos_ + 1;
        pos_ = std::min(bytes_.find('\n', begin), bytes_.size());
        if (begin > bytes_.size()) return data_loss("the PLY header has no end_header line");
        const auto words = split_words(bytes_.substr(begin, pos_ - begin));
        if (words.empty()) continue;
        if (words[0] == "end_header") break;
        LL_RETURN_IF_ERROR(header_line(words));
        if (words[0] != "comment" && ++lines > kMaxProperties) return invalid_argument("the PLY header has more than 256 lines");
    }
    pos_ = std::min(pos_ + 1, bytes_.size());
    if (!have_format_) return invalid_argument("the PLY header has no format line");
    return check_claims();
}

/// Every record of an element takes at least so many bytes, so a count that the rest of the file cannot hold is a lie.
Status Reader::check_claims() const {
    uint64_t left = bytes_.size() - pos_;
    for (const Element& element : elements_) {
        uint64_t record = 0;
        for (const Property& p : element.properties)
            record += format_ == Format::kAscii ? 2 : kScalarBytes[size_t(p.is_list ? p.count_type : p.type)];
        if (record == 0) {
            if (element.count > 0) return invalid_argument("the PLY element " + quoted(element.name) + " has no properties");
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
    while (pos_ < bytes_.size() && (bytes_[pos_] == ' ' || bytes_[pos_] == '\n' || bytes_[pos_] == '\r' || bytes_[pos_] == '\t'))
        ++pos_;
    const char* begin = bytes_.data() + pos_;
    const auto [end, error] = std::from_chars(begin, bytes_.data() + bytes_.size(), *out);
    if (error != std::errc()) return false;
    pos_ += size_t(end - begin);
    return pos_ == bytes_.size() || bytes_[pos_] == ' ' || bytes_[pos_] == '\n' || bytes_[pos_] == '\r' || bytes_[pos_] == '\t';
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

Status Reader::faces(const Element& element, PlyMesh* mesh) {
    bool has_indices = false;
    for (const Property& p : element.properties) {
        has_indices = has_indices || p.slot == 0;
        if (p.slot < 0 && p.name != "face_indices") mesh->ignored_properties.push_back("face " + p.name);
    }
    if (!has_indices && element.count > 0) return invalid_argument("the PLY faces have no vertex_indices list");
    const double vertex_count = double(mesh->positions.size());
    mesh->indices.reserve(element.count * 3);
    for (uint64_t i = 0; i < element.count; ++i)
        for (const Property& p : element.properties) {
            if (p.slot < 0) {
                if (!skip_property(p)) return ended(element, i);
                continue;
            }
            double count = 0;
            if (!value(p.count_type, &count)) return ended(element, i);
            if (count < 3)
                return invalid_argument("the PLY face " + std::to_string(i) + " has " + std::to_string(int64_t(count)) +
                                        " vertices; it needs three or more");
            // Up to the first polygon, every face is the triangle of the same number.
            mesh->has_polygons = mesh->has_polygons || count > 4;
            const bool polygons = count > 3 || !mesh->faces.empty();
            while (polygons && mesh->faces.size() < mesh->indices.size() / 3) mesh->faces.push_back(uint32_t(mesh->faces.size()));
            uint32_t first = 0, previous = 0;
            for (double corner = 0; corner < count; ++corner) {
                double number = 0;
                if (!value(p.type, &number)) return ended(element, i);
                if (!(number >= 0 && number < vertex_count) || number != std::floor(number))
                    return invalid_argument("the PLY face " + std::to_string(i) +
                                            " refers to a vertex that does not exist (the mesh has " +
                                            std::to_string(mesh->positions.size()) + ")");
                const uint32_t index = uint32_t(number);
                if (corner >= 2) mesh->indices.insert(mesh->indices.end(), {first, previous, index});
                if (corner >= 2 && polygons) mesh->faces.push_back(uint32_t(i));
                if (corner == 0) first = index;
                previous = index;
            }
        }
    return {};
}

Status Reader::skip(const Element& element) {
    for (uint64_t i = 0; i < element.count; ++i)
        for (const Property& p : element.properties)
            if (!skip_property(p)) return ended(element, i);
    return {};
}

Status Reader::read(PlyMesh* mesh) {
    LL_RETURN_IF_ERROR(header());
    bool seen_vertices = false, seen_faces = false;
    for (const Element& element : elements_) {
        if (element.name == "vertex" && !seen_vertices) {
            if (element.count > UINT32_MAX) return invalid_argument("the PLY mesh has more than 2^32 vertices");
            LL_RETURN_IF_ERROR(vertices(element, mesh));
            seen_vertices = true;
        } else if (element.name == "face" && !seen_faces) {
            if (!seen_vertices) return invalid_argument("the PLY faces come before the vertices");
            LL_RETURN_IF_ERROR(faces(element, mesh));
            seen_faces = true;
        } else {
            LL_RETURN_IF_ERROR(skip(element));
        }
    }
    if (!seen_vertices || !seen_faces) return invalid_argument("the PLY file has no vertex or no face element");
    if (mesh->indices.empty()) return invalid_argument("the PLY mesh has no faces");
    return {};
}

}  // namespace

Result<PlyMesh> read_ply(std::string_view bytes) {
    PlyMesh mesh;
    LL_RETURN_IF_ERROR(Reader(bytes).read(&mesh));
    return mesh;
}

}  // namespace lightloom::import
