// resolve_material(): from scene parameters to a Bsdf, with pbrt's conventions.

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "common/core/rng.h"
#include "common/scene/bsdf_fresnel.h"
#include "common/scene/texture.h"

namespace lightloom {
namespace {

/// A scene's tables with constant textures only.
class Tables {
  public:
    TextureId constant(const Rgb& value) {
        TextureNode node;
        node.value = value;
        nodes_.push_back(node);
        return TextureId(nodes_.size() - 1);
    }
    TextureId constant(float value) { return constant(Rgb(value)); }
    MaterialId add(const Material& m) {
        materials_.push_back(m);
        return MaterialId(materials_.size() - 1);
    }
    Bsdf resolve(MaterialId id, float choice = 0.5f) const {
        return resolve_material({nodes_, images_, materials_}, id, {{0.3f, 0.7f}, {}}, choice);
    }
    /// An image of one texel.
    TextureId image(const Rgb& texel) {
        Image image;
        image.width = image.height = 1;
        image.floats = {texel.r, texel.g, texel.b};
        images_.push_back(image);
        TextureNode node;
        node.kind = TextureKind::kImage;
        node.image = int32_t(images_.size()) - 1;
        nodes_.push_back(node);
        return TextureId(nodes_.size() - 1);
    }
    TextureId scaled(TextureId a, TextureId scale) {
        TextureNode node;
        node.kind = TextureKind::kScale;
        node.a = a, node.b = scale;
        nodes_.push_back(node);
        return TextureId(nodes_.size() - 1);
    }

  private:
    std::vector<TextureNode> nodes_;
    std::vector<Image> images_;
    std::vector<Material> materials_;
};

Material of_kind(MaterialKind kind) {
    Material m;
    m.kind = kind;
    return m;
}

TEST(Material, ResolvesEveryKind) {
    Tables t;
    const std::pair<MaterialKind, BsdfKind> kinds[] = {
        {MaterialKind::kDiffuse, BsdfKind::kDiffuse},
        {MaterialKind::kDiffuseTransmission, BsdfKind::kDiffuseTransmission},
        {MaterialKind::kConductor, BsdfKind::kConductor},
        {MaterialKind::kDielectric, BsdfKind::kDielectric},
        {MaterialKind::kThinDielectric, BsdfKind::kThinDielectric},
        {MaterialKind::kCoatedDiffuse, BsdfKind::kCoatedDiffuse},
        {MaterialKind::kCoatedConductor, BsdfKind::kCoatedConductor},
    };
    for (const auto& [material, bsdf] : kinds) EXPECT_EQ(t.resolve(t.add(of_kind(material))).kind, bsdf);
    EXPECT_EQ(t.resolve(kNone).kind, BsdfKind::kNull);
}

TEST(Material, RoughnessIsRemappedAsInPbrt) {
    Tables t;
    Material m = of_kind(MaterialKind::kDielectric);
    m.roughness_u = t.constant(0.25f);
    m.roughness_v = t.constant(0.04f);
    Bsdf b = t.resolve(t.add(m));
    EXPECT_FLOAT_EQ(b.alpha_x, 0.5f);
    EXPECT_FLOAT_EQ(b.alpha_y, 0.2f);
    m.remap_roughness = false;
    b = t.resolve(t.add(m));
    EXPECT_FLOAT_EQ(b.alpha_x, 0.25f);
    EXPECT_FLOAT_EQ(b.alpha_y, 0.04f);
    // Smooth only when both axes are, and never sharper than 1e-4 otherwise.
    m.roughness_u = t.constant(9e-4f);
    EXPECT_FLOAT_EQ(t.resolve(t.add(m)).alpha_x, 9e-4f);
    m.roughness_u = t.constant(0.0f);
    EXPECT_FLOAT_EQ(t.resolve(t.add(m)).alpha_x, 1e-4f);
    m.roughness_v = t.constant(9e-4f);
    EXPECT_EQ(t.resolve(t.add(m)).alpha_x, 0);
    EXPECT_EQ(t.resolve(t.add(m)).alpha_y, 0);
    // An index of one is no interface at all.
    m.roughness_u = m.roughness_v = t.constant(0.3f);
    m.ior = 1;
    EXPECT_TRUE(t.resolve(t.add(m)).has_delta_lobe());
}

TEST(Material, ConductorsByReflectanceOrIndex) {
    Tables t;
    Material m = of_kind(MaterialKind::kConductor);
    m.reflectance = t.constant({0.9f, 0.5f, 1.0f});
    const Rgb by_reflectance = t.resolve(t.add(m)).albedo();
    EXPECT_NEAR(by_reflectance.r, 0.9f, 1e-5f);
    EXPECT_NEAR(by_reflectance.g, 0.5f, 1e-5f);
    EXPECT_NEAR(by_reflectance.b, 0.9999f, 1e-5f);
    m.reflectance = kNone;
    m.eta = t.constant(0.3f);
    m.k = t.constant(4.0f);
    EXPECT_NEAR(t.resolve(t.add(m)).albedo().r, fresnel_conductor(1, 0.3f, 4.0f), 1e-6f);
    // Under a coat, the index is relative to the coat.
    m.kind = MaterialKind::kCoatedConductor;
    const Bsdf coated = t.resolve(t.add(m));
    EXPECT_NEAR(coated.reflectance.r, 0.2f, 1e-6f);
    EXPECT_NEAR(coated.transmittance.r, 4 / 1.5f, 1e-6f);
}

TEST(Material, MixesAreDecidedByChoiceAlone) {
    Tables t;
    Material red = of_kind(MaterialKind::kDiffuse), green = red, blue = red;
    red.reflectance = t.constant({1, 0, 0});
    green.reflectance = t.constant({0, 1, 0});
    blue.reflectance = t.constant({0, 0, 1});
    Material inner = of_kind(MaterialKind::kMix), outer = inner;
    inner.mix_a = t.add(red);
    inner.mix_b = t.add(green);
    inner.mix_amount = t.constant(0.25f);
    outer.mix_a = t.add(inner);
    outer.mix_b = t.add(blue);
    outer.mix_amount = t.constant(0.4f);
    const MaterialId id = t.add(outer);
    // 1 - 0.4 of the inner mix, of which a quarter is green. The intervals are exact, so a fine scan counts them.
    double counts[3] = {};
    constexpr int kSteps = 100000;
    for (int i = 0; i < kSteps; ++i) {
        const float choice = (float(i) + 0.5f) / kSteps;
        const Bsdf a = t.resolve(id, choice), b = t.resolve(id, choice);
        ASSERT_EQ(a.reflectance, b.reflectance);
        counts[a.reflectance.r == 1 ? 0 : (a.reflectance.g == 1 ? 1 : 2)] += 1.0 / kSteps;
    }
    EXPECT_NEAR(counts[0], 0.45, 1e-4);
    EXPECT_NEAR(counts[1], 0.15, 1e-4);
    EXPECT_NEAR(counts[2], 0.4, 1e-4);
    // The ends of the amount's range decide without exception.
    outer.mix_amount = t.constant(0.0f);
    const MaterialId first = t.add(outer);
    outer.mix_amount = t.constant(1.0f);
    const MaterialId second = t.add(outer);
    for (float choice : {0.0f, 0.5f, 0.99999994f}) {
        EXPECT_EQ(t.resolve(first, choice).reflectance.b, 0);
        EXPECT_EQ(t.resolve(second, choice).reflectance.b, 1);
    }
}

TEST(Material, AMixThatContainsItselfEnds) {
    Tables t;
    Material loop = of_kind(MaterialKind::kMix);
    loop.mix_a = loop.mix_b = 0;
    loop.mix_amount = t.constant(0.5f);
    EXPECT_EQ(t.resolve(t.add(loop)).kind, BsdfKind::kNull);
}

TEST(Material, AlbedosAreClampedAsInPbrt) {
    Tables t;
    Material m = of_kind(MaterialKind::kDiffuse);
    m.reflectance = t.constant({1.5f, -0.5f, 0.3f});
    EXPECT_EQ(t.resolve(t.add(m)).reflectance, Rgb(1, 0, 0.3f));
}

TEST(Material, ImagesAreClampedAsReflectancesOnly) {
    Tables t;
    // Clamped before it is scaled; the scale, a float texture, is not.
    Material m = of_kind(MaterialKind::kDiffuse);
    m.reflectance = t.scaled(t.image({4, 0.5f, 0}), t.image(Rgb(0.25f)));
    EXPECT_EQ(t.resolve(t.add(m)).reflectance, Rgb(0.25f, 0.125f, 0));
    m.reflectance = t.scaled(t.image(Rgb(0.25f)), t.image(Rgb(2)));
    EXPECT_EQ(t.resolve(t.add(m)).reflectance, Rgb(0.5f));
    Material index = of_kind(MaterialKind::kConductor), same = index;
    index.eta = t.constant(Rgb(2)), index.k = t.constant(Rgb(3));
    same.eta = t.image(Rgb(2)), same.k = t.image(Rgb(3));
    const Bsdf wanted = t.resolve(t.add(index)), found = t.resolve(t.add(same));
    EXPECT_EQ(found.reflectance, wanted.reflectance);      // eta
    EXPECT_EQ(found.transmittance, wanted.transmittance);  // k
}

}  // namespace
}  // namespace lightloom
