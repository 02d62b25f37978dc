// common/import/README.md says what becomes of every name that pbrt-v4 knows. Here its tables are held against the importer: each
// name in them in a scene of a few lines; and the other way round, every name that stands in the importer's sources in the
// document.

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "common/import/features.h"
#include "import_testing.h"

namespace lightloom {
namespace {

using testing::FileMap;
using Words = std::vector<std::string>;

const std::filesystem::path kFolder = std::filesystem::path(LIGHTLOOM_SOURCE_DIR) / "common" / "import";

std::string text_of(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

Words split(const std::string& text, const std::string& separators) {
    Words out(1);
    for (const char c : text) {
        if (separators.find(c) != std::string::npos)
            out.emplace_back();
        else
            out.back() += c;
    }
    return out;
}

std::string trimmed(const std::string& text) {
    const size_t begin = text.find_first_not_of(" \""), end = text.find_last_not_of(" \"");
    return begin == std::string::npos ? "" : text.substr(begin, end + 1 - begin);
}

/// What stands in backticks. "float/texture alpha" is "float alpha" and "texture alpha".
Words names_in(const std::string& cell) {
    const Words parts = split(cell, "`");
    Words out;
    for (size_t i = 1; i + 1 < parts.size(); i += 2) {
        const size_t blank = parts[i].find(' ');
        if (blank == std::string::npos)
            out.push_back(trimmed(parts[i]));
        else
            for (const std::string& type : split(parts[i].substr(0, blank), "/")) out.push_back(type + parts[i].substr(blank));
    }
    return out;
}

struct Row {
    Words names;
    std::string second, line;
};
struct Table {
    std::string heading;  ///< Of the first column, without backticks.
    std::vector<Row> rows;
};

struct Document {
    std::string text;
    std::vector<Table> tables;

    const Table* find(const std::string& heading) const {
        const auto it = std::find_if(tables.begin(), tables.end(), [&](const Table& t) { return t.heading == heading; });
        return it == tables.end() ? nullptr : &*it;
    }
};

Document read_document() {
    Document out{text_of(kFolder / "README.md"), {}};
    bool in_table = false;
    for (const std::string& line : split(out.text, "\n")) {
        if (line.empty() || line[0] != '|') {
            in_table = false;
            continue;
        }
        const Words cells = split(line, "|");
        if (line.rfind("|---", 0) == 0 || cells.size() < 4) continue;
        if (!in_table) {
            std::string heading = cells[1];
            heading.erase(std::remove(heading.begin(), heading.end(), '`'), heading.end());
            out.tables.push_back({trimmed(heading), {}});
        } else {
            out.tables.back().rows.push_back({names_in(cells[1]), cells[2], line});
        }
        in_table = true;
    }
    return out;
}

class ImportDocument : public ::testing::Test {
  protected:
    void SetUp() override {
        if (!std::filesystem::exists(kFolder / "README.md"))
            GTEST_SKIP() << "the source tree of this build, " << LIGHTLOOM_SOURCE_DIR << ", is not on this machine";
        document = read_document();
        ASSERT_FALSE(document.tables.empty());
    }
    Document document;
};

const Words kBeforeWorld{"Camera", "Film", "PixelFilter", "Sampler", "Integrator", "Accelerator"};
const Words kInWorld{"Shape", "LightSource", "AreaLightSource", "Material", "Texture"};

bool contains(const Words& words, const std::string& word) { return std::find(words.begin(), words.end(), word) != words.end(); }

const FileMap& files() {
    static const FileMap files{
        {"mesh.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
         "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
        {"square.pfm", "PF\n2 2\n-1\n" +
                           [] {
                               std::string pixels;
                               for (int i = 0; i < 12; ++i) pixels += std::string("\0\0\0\x3f", 4);
                               return pixels;
                           }()},
        {"empty.pbrt", ""}};
    return files;
}

/// Parameters of a directive: declaration and value.
using Parameters = std::vector<std::pair<std::string, std::string>>;

/// What a directive of this kind cannot do without.
Parameters needed(const std::string& word, const std::string& kind) {
    const Parameters triangle{{"point3 P", "[0 0 0 1 0 0 0 1 0]"}, {"integer indices", "[0 1 2]"}};
    const std::string of = word + " " + kind;
    if (of == "Shape trianglemesh" || of == "Shape loopsubdiv") return triangle;
    if (of == "Shape bilinearmesh") return {{"point3 P", "[0 0 0 1 0 0 0 1 0 1 1 0]"}, {"integer indices", "[0 1 2 3]"}};
    if (of == "Shape plymesh") return {{"string filename", "\"mesh.ply\""}};
    if (of == "LightSource projection" || of == "LightSource goniometric" || of == "Texture imagemap")
        return {{"string filename", "\"square.pfm\""}};
    if (of == "Material mix") return {{"string materials", "[\"a\" \"a\"]"}};
    return {};
}

/// A value that the directive accepts, and that is not what it would take anyhow.
std::string value_for(const std::string& word, const std::string& kind, const std::string& declaration) {
    const size_t blank = declaration.find(' ');
    const std::string type = declaration.substr(0, blank), name = declaration.substr(blank + 1);
    const bool four = kind == "bilinearmesh";
    const std::map<std::string, std::string> special{
        {"normal N", four ? "[0 0 1 0 0 1 0 0 1 0 0 1]" : "[0 0 1 0 0 1 0 0 1]"},
        {"point2 uv", four ? "[0 0 1 0 0 1 1 1]" : "[0 0 1 0 0 1]"},
        {"float phimax", "90"},
        {"float coneangle", "20"},
        {"float fov", "45"},
        {"point3 portal", "[0 0 0 1 0 0 1 1 0 0 1 0]"},
        {"string filename", word == "Film" ? "\"picture.exr\"" : "\"square.pfm\""},
        {"string normalmap", "\"square.pfm\""},
        {"string encoding", "\"linear\""},
        {"string wrap", "\"clamp\""},
        {"string filter", "\"trilinear\""},
        {"string mapping", word == "Camera" ? "\"equirectangular\"" : "\"planar\""},
        {"string sensor", "\"nikon_d850\""},
        {"float whitebalance", "5000"},
        {"float cropwindow", "[0 0.5 0 0.5]"},
        {"integer pixelbounds", "[0 2 0 2]"},
        {"float screenwindow", "[-1 1 -1 1]"},
        {"float xradius", "2"},
        {"float yradius", "2"},
    };
    if (const auto it = special.find(declaration); it != special.end()) return it->second;
    if (type == "texture") {
        const bool is_float = name.find("roughness") != std::string::npos || name == "alpha" || name == "displacement" ||
                              name == "amount" || name == "g" || name == "scale";
        return is_float ? "\"float\"" : "\"spectrum\"";
    }
    const std::map<std::string, std::string> by_type{
        {"float", "0.5"},      {"integer", "2"},         {"bool", "true"},
        {"string", "\"x\""},   {"rgb", "[0.5 0.5 0.5]"}, {"spectrum", "[300 0.5 800 0.5]"},
        {"blackbody", "5000"}, {"point3", "[0 0 2]"},    {"vector3", "[1 0 0]"}};
    return by_type.at(type);
}

/// A scene with one directive, and its line in it.
struct Scene {
    std::string text;
    int line = 0;
};

Scene scene_of(const std::string& word, const std::string& directive) {
    const std::string filter = word == "PixelFilter" ? "" : "PixelFilter \"box\"\n";
    const std::string world =
        "WorldBegin\nTexture \"float\" \"float\" \"constant\"\nTexture \"spectrum\" \"spectrum\" \"constant\"\n"
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\"\n";
    const auto lines = [](const std::string& text) { return int(std::count(text.begin(), text.end(), '\n')); };
    if (contains(kBeforeWorld, word)) return {filter + directive + "\n" + world, lines(filter) + 1};
    // An area light is looked at when a shape emits.
    const std::string shape = word == "AreaLightSource" ? "Shape \"sphere\"\n" : "";
    return {filter + world + directive + "\n" + shape, lines(filter + world) + 1};
}

std::string directive_of(const std::string& word, const std::string& kind, const Parameters& parameters,
                         const std::string& texture_type) {
    std::string out = word;
    if (word == "Texture") out += " \"t\" \"" + texture_type + "\"";
    out += " \"" + kind + "\"";
    for (const auto& [declaration, value] : parameters) out += " \"" + declaration + "\" " + value;
    return out;
}

/// What the importer makes of a scene, as the document says it.
void expect_status(const std::string& status, const Scene& scene, const Scene& without, const Row& row) {
    const auto imported = testing::import_text(scene.text, files());
    const std::string shown = row.line + "\n" + scene.text;
    if (status == "refused") {
        ASSERT_FALSE(imported.ok()) << "this must not load: " << shown;
        EXPECT_EQ(imported.status().message().rfind("scene.pbrt:" + std::to_string(scene.line) + ": ", 0), 0u)
            << imported.status().message() << "\n"
            << shown;
        return;
    }
    ASSERT_TRUE(imported.ok()) << imported.status().message() << "\n" << shown;
    const auto base = testing::import_text(without.text, files());
    ASSERT_TRUE(base.ok()) << base.status().message() << "\n" << without.text;
    const size_t more = imported->description.warnings.size() - base->description.warnings.size();
    if (status == "read" || status == "no effect") {
        EXPECT_EQ(more, 0u) << imported->description.warnings.back() << "\n" << shown;
    } else if (status == "replaced" || status == "ignored") {
        EXPECT_EQ(more, 1u) << shown;
        EXPECT_FALSE(testing::import_text(scene.text, files(), true).ok()) << "not even with --strict: " << shown;
    } else {
        ADD_FAILURE() << "unknown status: " << row.line;
    }
}

/// The types that a texture of this kind can have.
Words texture_types(const std::string& word, const std::string& kind) {
    if (word != "Texture") return {""};
    if (kind == "marble") return {"spectrum"};
    if (kind == "fbm" || kind == "wrinkled" || kind == "windy") return {"float"};
    return {"float", "spectrum"};
}

TEST_F(ImportDocument, KindsAreAsTheTablesSay) {
    Words words = kBeforeWorld;
    words.insert(words.end(), kInWorld.begin(), kInWorld.end());
    for (const std::string& word : words) {
        const Table* table = document.find(word);
        ASSERT_TRUE(table) << "no table of " << word;
        const Scene without = scene_of(word == "PixelFilter" ? "" : word, "");
        for (const Row& row : table->rows) {
            ASSERT_FALSE(row.names.empty()) << row.line;
            for (const std::string& kind : row.names)
                for (const std::string& type : texture_types(word, kind))
                    expect_status(trimmed(row.second), scene_of(word, directive_of(word, kind, needed(word, kind), type)), without,
                                  row);
        }
    }
}

void check_parameter(const std::string& word, const std::string& kind, const std::string& declaration, const Row& row) {
    const size_t blank = declaration.find(' ');
    const std::string type = declaration.substr(0, blank), name = declaration.substr(blank + 1);
    Parameters base = needed(word, kind);
    if (name == "v1" || name == "v2") base.push_back({"string mapping", "\"planar\""});
    Parameters with = base;
    const auto given = std::find_if(with.begin(), with.end(), [&](const auto& p) { return p.first == declaration; });
    if (given == with.end()) with.push_back({declaration, value_for(word, kind, declaration)});
    // Operands decide what type the texture has.
    const Words types = texture_types(word, kind);
    std::string texture_type = types.back();
    if (types.size() == 2 && type == "float") {
        const auto as_spectrum = testing::import_text(scene_of(word, directive_of(word, kind, with, "spectrum")).text, files());
        texture_type = as_spectrum.ok() ? "spectrum" : "float";
    }
    expect_status(trimmed(row.second), scene_of(word, directive_of(word, kind, with, texture_type)),
                  scene_of(word, directive_of(word, kind, base, texture_type)), row);
}

TEST_F(ImportDocument, ParametersAreAsTheTablesSay) {
    int checked = 0;
    for (const Table& table : document.tables) {
        const Words heading = split(table.heading, " ");
        if (heading.size() != 4 || heading[0] != "Parameters") continue;
        const bool every = heading[2] == "every";
        const std::string word = every ? heading[3] : heading[2];
        const Table* kinds = document.find(word);
        ASSERT_TRUE(kinds) << table.heading;
        const int before = checked;
        for (const Row& of_kind : kinds->rows) {
            if (trimmed(of_kind.second) == "refused") continue;
            for (const std::string& kind : of_kind.names) {
                if (every ? word == "Material" && (kind == "mix" || kind == "interface" || kind == "none") : kind != heading[3])
                    continue;
                for (const Row& row : table.rows)
                    for (const std::string& declaration : row.names) {
                        ASSERT_NE(declaration.find(' '), std::string::npos) << row.line;
                        check_parameter(word, kind, declaration, row);
                        ++checked;
                    }
            }
        }
        EXPECT_GT(checked, before) << "no table has the kind of: " << table.heading;
    }
    EXPECT_GT(checked, 300);
}

TEST_F(ImportDocument, DirectivesAreAsTheTableSays) {
    const std::map<std::string, std::string> examples{
        {"Identity", "Identity"},
        {"Translate", "Translate 1 0 0"},
        {"Scale", "Scale 1 2 1"},
        {"Rotate", "Rotate 90 0 0 1"},
        {"LookAt", "LookAt 0 0 0 0 0 1 0 1 0"},
        {"Transform", "Transform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1]"},
        {"ConcatTransform", "ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1]"},
        {"CoordinateSystem", "CoordinateSystem \"here\""},
        {"CoordSysTransform", "CoordSysTransform \"world\""},
        {"ReverseOrientation", "ReverseOrientation"},
        {"ActiveTransform", "ActiveTransform StartTime"},
        {"TransformTimes", "TransformTimes 0 1"},
        {"AttributeBegin", "AttributeBegin AttributeEnd"},
        {"AttributeEnd", "AttributeBegin AttributeEnd"},
        {"TransformBegin", "TransformBegin TransformEnd"},
        {"TransformEnd", "TransformBegin TransformEnd"},
        {"ObjectBegin", "ObjectBegin \"o\" ObjectEnd"},
        {"ObjectEnd", "ObjectBegin \"o\" ObjectEnd"},
        {"ObjectInstance", "ObjectBegin \"o\" ObjectEnd ObjectInstance \"o\""},
        {"WorldBegin", ""},
        {"Include", "Include \"empty.pbrt\""},
        {"Import", "Import \"empty.pbrt\""},
        {"Attribute", "Attribute \"shape\" \"float radius\" 2"},
        {"MakeNamedMaterial", "MakeNamedMaterial \"b\" \"string type\" \"diffuse\""},
        {"NamedMaterial", "NamedMaterial \"a\""},
        {"ColorSpace", "ColorSpace \"srgb\""},
        {"MakeNamedMedium", "MakeNamedMedium \"m\" \"string type\" \"homogeneous\""},
        {"MediumInterface", "MediumInterface \"m\" \"\""},
    };
    const Table* table = document.find("Directive");
    ASSERT_TRUE(table);
    for (const Row& row : table->rows)
        for (const std::string& word : row.names) {
            if (document.find(word)) continue;  // has a table of its own
            const auto example = examples.find(word);
            ASSERT_NE(example, examples.end()) << "no example of " << word;
            expect_status(trimmed(row.second), scene_of(word, example->second), scene_of(word, ""), row);
        }
    const Table* options = document.find("Option");
    ASSERT_TRUE(options);
    for (const Row& row : options->rows)
        for (const std::string& name : row.names)
            expect_status(trimmed(row.second), scene_of("Option", "Option \"bool " + name + "\" true"), scene_of("Option", ""),
                          row);
}

TEST_F(ImportDocument, ListsWhatCanBeLeftOut) {
    const Table* table = document.find("--without");
    ASSERT_TRUE(table);
    ASSERT_EQ(table->rows.size(), scene_features().size());
    for (size_t i = 0; i < table->rows.size(); ++i)
        EXPECT_EQ(table->rows[i].names, Words{std::string(scene_features()[i].name)}) << table->rows[i].line;
}

TEST_F(ImportDocument, OlderFilesAreRecognised) {
    const auto is_recognised = [](const std::string& word, const std::string& directive) {
        const auto scene = testing::import_text(scene_of(word, directive).text, files());
        ASSERT_FALSE(scene.ok()) << directive;
        EXPECT_NE(scene.status().message().find("pbrt --upgrade"), std::string::npos) << scene.status().message();
    };
    const Table* kinds = document.find("Directive of pbrt before version 4");
    ASSERT_TRUE(kinds);
    for (const Row& row : kinds->rows)
        for (const std::string& word : row.names) {
            if (names_in(row.second).empty()) is_recognised(word, word + " \"x\"");
            for (const std::string& kind : names_in(row.second))
                // Of an accelerator nothing is looked at but its age, which shows where something else fails.
                is_recognised(word, word == "Texture"       ? "Texture \"t\" \"" + kind + "\" \"constant\""
                                    : word == "Accelerator" ? "Accelerator \"" + kind + "\"\nFilm \"none\""
                                                            : word + " \"" + kind + "\"");
        }
    const Table* parameters = document.find("Parameter of pbrt before version 4");
    ASSERT_TRUE(parameters);
    const std::map<std::string, std::string> kind_of{{"LightSource", "point"},
                                                     {"AreaLightSource", "diffuse"},
                                                     {"Integrator", "path"},
                                                     {"Camera", "perspective"},
                                                     {"Material", "diffuse"}};
    for (const Row& row : parameters->rows)
        for (const std::string& word : row.names)
            for (const std::string& name : names_in(row.second))
                is_recognised(word, word + " \"" + kind_of.at(word) + "\" \"float " + name + "\" 1");
}

/// The string literals of a C++ source.
Words literals_of(const std::string& source) {
    Words out;
    for (const std::string& line : split(source, "\n")) {
        if (line.rfind("#", 0) == 0) continue;
        for (size_t i = 0; i < line.size(); ++i) {
            if (line.compare(i, 2, "//") == 0) break;
            if (line[i] == '\'') {
                i = line.find('\'', i + (line[i + 1] == '\\' ? 3 : 2));
                if (i == std::string::npos) break;
            }
            if (line[i] != '"') continue;
            std::string literal;
            for (++i; i < line.size() && line[i] != '"'; ++i) {
                if (line[i] == '\\') literal += line[i++];
                literal += line[i];
            }
            out.push_back(literal);
        }
    }
    return out;
}

/// One word with a letter in it.
bool is_name(const std::string& text) {
    const auto is_letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
    const auto may_stand = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-'; };
    return std::any_of(text.begin(), text.end(), is_letter) && std::all_of(text.begin(), text.end(), may_stand) &&
           std::isalnum(static_cast<unsigned char>(text[0]));
}

/// A kind is mentioned in several places, and has to be in a table of kinds.
TEST_F(ImportDocument, HasEveryKindOfTheSourcesInATable) {
    Words kinds;
    for (const Words& words : {kBeforeWorld, kInWorld})
        for (const std::string& word : words) {
            const Table* table = document.find(word);
            ASSERT_TRUE(table) << word;
            for (const Row& row : table->rows) kinds.insert(kinds.end(), row.names.begin(), row.names.end());
        }
    int found = 0;
    for (const char* file : {"shapes", "lights", "materials", "textures", "procedural", "camera", "directives"}) {
        const std::string source = text_of(kFolder / (std::string(file) + ".cpp"));
        for (const std::string before : {"kind == \"", "kind != \""})
            for (size_t at = source.find(before); at != std::string::npos; at = source.find(before, at + 1), ++found) {
                const size_t begin = at + before.size();
                const std::string kind = source.substr(begin, source.find('"', begin) - begin);
                EXPECT_TRUE(contains(kinds, kind)) << file << ".cpp knows the kind " << kind << "; no table has it";
            }
    }
    EXPECT_GT(found, 40);
}

TEST_F(ImportDocument, HasEveryNameOfTheSources) {
    std::set<std::string> documented, words;
    for (const std::string& line : split(document.text, "\n"))
        for (const std::string& name : names_in(line)) {
            documented.insert(name);
            for (const std::string& word : split(name, " ,/")) words.insert(trimmed(word));
        }
    // Parts of messages, and names that are put together from them.
    const std::set<std::string> others{"wide", "high",   "x",   "y",        "false",     "End",        "Object",     "Inf",
                                       "NaN",  "camera", "PNG", "Infinity", "Attribute", "conductor.", "interface.", "image"};
    const std::set<std::string> types{"float",  "integer", "bool",   "string", "texture",   "point2",  "vector2",
                                      "point3", "vector3", "normal", "rgb",    "blackbody", "spectrum"};
    int found = 0;
    for (const char* file : {"parser", "directives", "shapes", "lights", "materials", "textures", "procedural", "camera", "sensor",
                             "features", "foreign", "spectra", "metals", "images"}) {
        std::string source = text_of(kFolder / (std::string(file) + ".cpp"));
        ASSERT_FALSE(source.empty()) << file;
        if (std::string(file) == "foreign") source.erase(0, source.find("bool is_old_directive"));
        for (const std::string& literal : literals_of(source)) {
            const bool is_word = is_name(literal);
            const size_t blank = literal.find(' ');
            const bool is_declaration = blank != std::string::npos && types.contains(literal.substr(0, blank)) &&
                                        literal.find_first_of(" ,;:", blank + 1) == std::string::npos && blank + 1 < literal.size();
            if (is_word && !others.contains(literal)) {
                EXPECT_TRUE(words.contains(literal)) << file << ".cpp knows \"" << literal << "\"; the document does not";
            } else if (is_declaration) {
                EXPECT_TRUE(documented.contains(literal)) << file << ".cpp knows \"" << literal << "\"; the document does not";
            }
            found += is_word || is_declaration;
        }
    }
    EXPECT_GT(found, 500);
}

}  // namespace
}  // namespace lightloom
