// What stops a file, all at once, and what is left out of one.

#include "common/import/features.h"

#include <algorithm>

#include "import_testing.h"

namespace lightloom {
namespace {

using testing::FileMap;

const char kTriangle[] = "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0] \"integer indices\" [0 1 2]\n";

std::vector<std::string> faults_of(const std::string& text, FileMap files = {}, const ImportOptions& options = {}) {
    files["scene.pbrt"] = text;
    import::MemorySource source(std::move(files));
    return import::faults_from(&source, "scene.pbrt", options);
}

Result<ImportedScene> import_without(const std::string& world, std::vector<std::string> without, FileMap files = {}) {
    files["scene.pbrt"] = "PixelFilter \"box\"\nWorldBegin\n" + world;
    import::MemorySource source(std::move(files));
    return import::import_from(&source, "scene.pbrt", {.without = std::move(without)});
}

struct Faulty {
    std::string text;
    std::vector<std::string> faults;  ///< Beginnings of lines, in any order.
};

const Faulty kFaulty[] = {
    {"Film \"rgb\" \"integer xresolution\" 0\nCamera \"perspective\" \"float fov\" 200\nSampler \"dice\"\nWorldBegin\n",
     {"scene.pbrt:1: Film", "scene.pbrt:2: Camera", "scene.pbrt:3: Sampler \"dice\""}},
    {"WorldBegin\nMaterial \"velvet\"\nShape \"teapot\"\nLightSource \"lamp\"\n",
     {"scene.pbrt:2: Material \"velvet\"", "scene.pbrt:3: Shape \"teapot\"", "scene.pbrt:4: LightSource \"lamp\""}},
    {"WorldBegin\nMediumInterface \"a\" \"b\"\nMaterial \"hair\"\nShape \"curve\"\n",
     {"scene.pbrt:2: MediumInterface", "scene.pbrt:3: Material \"hair\"", "scene.pbrt:4: Shape \"curve\""}},
    {"WorldBegin\nInclude \"a.pbrt\"\nShape \"plymesh\" \"string filename\" \"b.ply\"\n"
     "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"c.png\"\n",
     {"scene.pbrt:2: cannot open \"a.pbrt\"", "scene.pbrt:3: cannot open \"b.ply\"", "scene.pbrt:4: cannot open \"c.png\""}},
    {"WorldBegin\nTranslate 1 2\nFrobnicate 3\nMaterial \"diffuse\" \"rgb reflectance\" [1 2]\n",
     {"scene.pbrt:3: Translate", "scene.pbrt:3: unknown directive", "scene.pbrt:4: "}},
    {"WorldBegin\nMaterial \"diffuse\" \"float colour\" 1 \"rgb shade\" [1 1 1] \"string texture\" \"n.png\"\n",
     {"scene.pbrt:2: Material \"diffuse\": unknown parameter \"float colour\"",
      "scene.pbrt:2: Material \"diffuse\": unknown parameter \"rgb shade\"",
      "scene.pbrt:2: Material \"diffuse\": unknown parameter \"string texture\""}},
    {"WorldBegin\nMakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"none\" \"nil\"]\nNamedMaterial "
     "\"absent\"\n"
     "Shape \"sphere\" \"texture alpha\" \"holes\"\nTexture \"u\" \"float\" \"scale\" \"texture tex\" \"nowhere\"\n",
     {"scene.pbrt:2: no material is named \"none\"", "scene.pbrt:3: no material is named \"absent\"",
      "scene.pbrt:5: no float texture is named \"nowhere\""}},
    {"WorldBegin\nAttributeEnd\nObjectInstance \"ghost\"\nAttributeBegin\n",
     {"scene.pbrt:2: AttributeEnd", "scene.pbrt:3: ObjectInstance: no object is named \"ghost\"",
      "scene.pbrt:4: this AttributeBegin"}},
    {"WorldBegin\nAreaLightSource \"diffuse\" \"rgb L\" [-1 0 0]\nShape \"sphere\" \"float radius\" -1\nShape \"disk\"\n"
     "Texture \"t\" \"spectrum\" \"imagemap\"\n",
     {"scene.pbrt:3: Shape \"sphere\": the radius", "scene.pbrt:2: AreaLightSource", "scene.pbrt:5: Texture \"t\""}},
    {"WorldBegin\nShape \"sphere\" \"float radius\" [\"open\nOption \"bool forcediffuse\" true\nScale 0 1 1\nShape \"sphere\"\n",
     {"scene.pbrt:2: a quoted string is not closed", "scene.pbrt:3: Option", "scene.pbrt:5: Shape \"sphere\" cannot be placed"}},
};

TEST(Faults, AllThreeOfEachFileAreNamed) {
    EXPECT_EQ(std::size(kFaulty), 10u);
    for (const Faulty& file : kFaulty) {
        const std::vector<std::string> faults = faults_of(file.text);
        std::string all;
        for (const std::string& fault : faults) all += fault + "\n";
        for (const std::string& expected : file.faults)
            EXPECT_TRUE(std::any_of(faults.begin(), faults.end(), [&](const std::string& f) { return f.rfind(expected, 0) == 0; }))
                << "no \"" << expected << "\" among\n"
                << all;
        EXPECT_LE(faults.size(), 5u) << all;
        // The first one is what an import says.
        const auto scene = testing::import_text(file.text);
        ASSERT_FALSE(scene.ok());
        EXPECT_NE(std::find(faults.begin(), faults.end(), scene.status().message()), faults.end())
            << scene.status().message() << "\n"
            << all;
    }
}

TEST(Faults, NoneForWhatLoads) {
    EXPECT_TRUE(faults_of(std::string("WorldBegin\n") + kTriangle).empty());
    EXPECT_EQ(faults_of("WorldBegin\n", {}, {.strict = true}).size(), 1u);
    EXPECT_EQ(faults_of("").size(), 1u);
    EXPECT_EQ(faults_of("v 0 0 0\n").size(), 1u);
    EXPECT_TRUE(faults_of("WorldBegin MediumInterface \"a\" \"\" Shape \"curve\"", {}, {.without = {"media", "curves"}}).empty());
}

TEST(Faults, OneFeatureIsOneFault) {
    std::string text = "WorldBegin\n";
    for (int i = 0; i < 5; ++i) text += "MediumInterface \"" + std::to_string(i) + "\" \"\"\nShape \"curve\"\n";
    const std::vector<std::string> faults = faults_of(text);
    ASSERT_EQ(faults.size(), 2u);
    EXPECT_EQ(faults[0].rfind("scene.pbrt:2: MediumInterface \"0\"", 0), 0u) << faults[0];
    EXPECT_NE(faults[0].find("--without media (and 4 more)"), std::string::npos) << faults[0];
    EXPECT_NE(faults[1].find("(and 4 more)"), std::string::npos) << faults[1];
}

/// One message for a file of an older version: the rest are consequences.
TEST(Faults, OfAnOlderPbrtAreOne) {
    const auto faults = faults_of("Film \"image\"\nWorldBegin\nMaterial \"matte\"\nShape \"cone\"\nWorldEnd\n");
    ASSERT_EQ(faults.size(), 1u);
    EXPECT_NE(faults[0].find("pbrt --upgrade"), std::string::npos);
}

/// A placeholder must not be blamed: whoever refers to something broken says nothing.
TEST(Faults, HaveNoConsequences) {
    const auto faults = faults_of(
        "WorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"no.png\"\n"
        "MakeNamedMaterial \"m\" \"string type\" \"diffuse\" \"texture reflectance\" \"t\"\nNamedMaterial \"m\"\nShape \"sphere\"\n"
        "MakeNamedMaterial \"x\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]\n"
        "Texture \"b\" \"float\" \"constant\" \"float value\" [1 \"no\"]\nMaterial \"dielectric\" \"texture roughness\" \"b\"\n");
    EXPECT_EQ(faults.size(), 2u) << faults.at(faults.size() - 1);
}

TEST(Without, NamesAreChecked) {
    for (const SceneFeature& feature : scene_features()) {
        EXPECT_TRUE(check_scene_features({std::string(feature.name)}).ok());
        EXPECT_FALSE(feature.meaning.empty());
    }
    const Status unknown = check_scene_features({"media", "mediums"});
    ASSERT_FALSE(unknown.ok());
    for (const char* part : {"\"mediums\"", "media, ", "motion"})
        EXPECT_NE(unknown.message().find(part), std::string::npos) << unknown.message();
    EXPECT_FALSE(import_without("", {"mediums"}).ok());
}

TEST(Without, EachIsNamedByTheMessageAndLeftOut) {
    const struct {
        const char *name, *world;
    } kCases[] = {
        {"media", "MediumInterface \"fog\" \"\"\n"},
        {"media", "Material \"coateddiffuse\" \"rgb albedo\" [0.5 0.5 0.5] \"float g\" 0.5\n"},
        {"displacement", "Shape \"plymesh\" \"string filename\" \"a.ply\" \"texture displacement\" \"d\" \"float edgelength\" 1\n"},
        {"curves", "Shape \"curve\" \"point3 P\" [0 0 0 1 1 1 2 2 2 3 3 3] \"float width\" 0.1\n"},
        {"hair", "Material \"hair\" \"float eumelanin\" 0.3 \"float beta_m\" 0.2\n"},
        {"subsurface", "Material \"subsurface\" \"string name\" \"Ketchup\" \"float scale\" 10\n"},
        {"measured", "Material \"measured\" \"string filename\" \"a.bsdf\"\n"},
        {"motion", "ActiveTransform EndTime Translate 1 0 0 ActiveTransform All\nLightSource \"point\"\n"},
        {"motion", "ActiveTransform EndTime Translate 1 0 0 ActiveTransform All\nTexture \"m\" \"float\" \"fbm\" Identity\n"},
        {"portals", "LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]\n"},
        {"ptex", "Texture \"p\" \"spectrum\" \"ptex\" \"string filename\" \"a.ptx\"\n"},
        {"ptex", "Texture \"p\" \"float\" \"ptex\" \"string filename\" \"a.ptx\"\n"},
        {"options", "Option \"bool disablepixeljitter\" true\n"},
    };
    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for (const auto& c : kCases) {
        const auto refused = import_without(c.world, {}, {{"a.ply", ply}});
        ASSERT_FALSE(refused.ok()) << c.world;
        EXPECT_NE(refused.status().message().find(std::string("--without ") + c.name), std::string::npos)
            << refused.status().message();
        const auto scene = import_without(c.world, {"curves", c.name, "spectral"}, {{"a.ply", ply}});
        ASSERT_TRUE(scene.ok()) << c.world << scene.status().message();
        ASSERT_EQ(scene->left_out.size(), 1u) << c.world;
        EXPECT_EQ(scene->left_out[0].name, c.name);
        EXPECT_GE(scene->left_out[0].count, 1);
        EXPECT_EQ(scene->left_out[0].first.rfind("scene.pbrt:", 0), 0u);
    }
}

/// They are supported; their files may be missing, or the scene be wanted without them.
TEST(Without, BumpMapsCanBeLeftOut) {
    for (const char* world :
         {"Material \"diffuse\" \"texture displacement\" \"d\"\n", "Material \"diffuse\" \"string normalmap\" \"n.png\"\n",
          "Attribute \"material\" \"string normalmap\" \"n.png\" Material \"conductor\"\n",
          "MakeNamedMaterial \"m\" \"string type\" \"dielectric\" \"texture displacement\" \"d\"\n"}) {
        const auto whole = import_without(world, {});
        ASSERT_FALSE(whole.ok()) << world;
        EXPECT_EQ(whole.status().message().find("--without"), std::string::npos) << whole.status().message();
        const auto scene = import_without(world, {"bump"});
        ASSERT_TRUE(scene.ok()) << world << scene.status().message();
        ASSERT_EQ(scene->left_out.size(), 1u);
        EXPECT_EQ(scene->left_out[0].name, "bump");
    }
}

TEST(Without, StandInsAreAsDocumented) {
    const auto material = [](const std::string& text, const char* feature) {
        const auto scene = import_without(text + "\n" + kTriangle, {feature});
        EXPECT_TRUE(scene.ok()) << scene.status().message();
        const SceneDescription& d = scene->description;
        const Material& m = d.materials.at(size_t(d.meshes.at(0).attributes.material));
        return std::pair(m, d.textures.at(size_t(m.reflectance)).value);
    };
    const auto [hair, hair_colour] = material("Material \"hair\" \"rgb reflectance\" [.1 .2 .3] \"float beta_n\" 0.2", "hair");
    EXPECT_EQ(hair.kind, MaterialKind::kDiffuse);
    EXPECT_EQ(hair_colour, Rgb(0.1f, 0.2f, 0.3f));
    EXPECT_EQ(material("Material \"hair\"", "hair").second, Rgb(0.5f));
    const auto [skin, skin_colour] =
        material("Material \"subsurface\" \"rgb mfp\" [1 1 1] \"rgb reflectance\" [.4 .3 .2]", "subsurface");
    EXPECT_EQ(skin.kind, MaterialKind::kCoatedDiffuse);
    EXPECT_EQ(skin.ior, 1.33f);
    EXPECT_EQ(skin_colour, Rgb(0.4f, 0.3f, 0.2f));
    EXPECT_EQ(material("Material \"subsurface\" \"float eta\" 1.4", "subsurface").first.ior, 1.4f);
    EXPECT_EQ(material("Material \"measured\" \"string filename\" \"a\"", "measured").second, Rgb(0.5f));
    const auto moved =
        import_without(std::string("Translate 1 0 0 ActiveTransform EndTime Translate 5 0 0\n") + kTriangle, {"motion"});
    ASSERT_TRUE(moved.ok());
    EXPECT_EQ(moved->description.meshes.at(0).positions.at(0), (Vec3{1, 0, 0}));
}

}  // namespace
}  // namespace lightloom
