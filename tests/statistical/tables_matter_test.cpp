// What was learned is what helps: with other numbers in Gamma the mean stays (table_fuzz_test) and the noise grows. On
// door, whose light comes through a gap, at equal iterations.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "common/import/import.h"
#include "common/transport/training.h"
#include "tests/support/estimates.h"

namespace lightloom {
namespace {

constexpr int kSeeds = 10;
constexpr uint32_t kIterations = 16;

/// relMSE (epsilon 0.01) of one of `images`, from their differences among each other; `reference` is only in the denominator.
double relative_square_error(const std::vector<std::vector<double>>& images, const std::vector<double>& reference) {
    double sum = 0;
    for (size_t p = 0; p < reference.size(); ++p) {
        double mean = 0, square = 0;
        for (const auto& image : images) mean += image[p], square += image[p] * image[p];
        const double n = double(images.size());
        sum += (square - mean * mean / n) / (n - 1) / (reference[p] * reference[p] + 0.01);
    }
    return sum / double(reference.size());
}

TEST(TablesMatter, OnDoorUniformAndPermutedGammaAreNoisier) {
    const std::string path = std::string(LIGHTLOOM_SOURCE_DIR) + "/../shared/scenes/door/scene.pbrt";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "the shared scenes are not here";
    auto imported = import_pbrt(path);
    ASSERT_TRUE(imported.ok()) << imported.status().message();
    const int max_depth = imported->description.max_depth;
    auto built = Scene::build(std::move(imported->description), {.width = 160, .height = 90});
    ASSERT_TRUE(built.ok()) << built.status().message();
    const std::shared_ptr<const Scene> scene = std::move(built).value();

    // As many training paths as the paper traces light sub-paths.
    const RenderSettings settings = testing::settings_of("spcbpt", {{"training-paths", "2000000"}}, 5, max_depth);
    TrainingReport report;
    const auto tables_of_door = make_tables(*scene, settings, {}, &report);
    ASSERT_TRUE(tables_of_door.ok()) << tables_of_door.status().message();
    const auto learned = tables_of_door->get<SubspaceTables>();
    SubspaceTables uniform = *learned, permuted = *learned;
    std::fill(uniform.gamma.begin(), uniform.gamma.end(), 1.0f / float(learned->light_count));
    // Neighbours have neighbouring labels: half of all columns further on is far away.
    for (uint32_t j = 0; j < learned->eye_count; ++j)
        std::copy_n(learned->column((j + learned->eye_count / 2) % learned->eye_count), learned->light_count,
                    &permuted.gamma[size_t(j) * learned->light_count]);

    const auto render = [&](const SubspaceTables& subspaces) {
        std::vector<std::vector<double>> images;
        Tables tables = *tables_of_door;  // its learned emission stays
        tables.set(std::make_shared<const SubspaceTables>(subspaces));
        const auto image = testing::table_image(scene, settings, tables, kIterations);
        for (int seed = 0; seed < kSeeds; ++seed) images.push_back(image(uint64_t(100 + seed)));
        return images;
    };
    const auto best = render(*learned);
    std::vector<double> reference(best[0].size(), 0.0);
    for (const auto& image : best)
        for (size_t p = 0; p < image.size(); ++p) reference[p] += image[p] / kSeeds;
    const double error = relative_square_error(best, reference);
    const double with_uniform = relative_square_error(render(uniform), reference);
    const double with_permuted = relative_square_error(render(permuted), reference);
    std::printf("relMSE at %u iterations: learned %.4f, uniform %.4f (%.2f x), permuted %.4f (%.2f x)\n", kIterations, error,
                with_uniform, with_uniform / error, with_permuted, with_permuted / error);
    EXPECT_GE(with_uniform, 3 * error);
    EXPECT_GE(with_permuted, 2 * error);
}

}  // namespace
}  // namespace lightloom
