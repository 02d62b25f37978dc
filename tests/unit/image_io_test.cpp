// The final image: EXR and PNG, written and read.

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfThreading.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>
#include <half.h>
#include <png.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "common/core/atomic_file.h"
#include "common/core/rng.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"

namespace lightloom {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const FrameLayout kFrame{40, 30, {4, 3, 36, 27}};

ExrImage random_image(uint64_t seed) {
    Rng rng({seed});
    ExrImage image;
    image.frame = kFrame;
    const size_t area = size_t(kFrame.crop.area());
    image.color = {kFrame.crop.width(), kFrame.crop.height(), {}};
    for (size_t i = 0; i < area * 3; ++i) image.color.pixels.push_back(rng.uniform() * float(1 << rng.below(10)));
    image.layers = {{"variance", "RGB", image.color.pixels}, {"depth", "Z", {}}, {"normal", "XYZ", image.color.pixels}};
    for (size_t i = 0; i < area; ++i) image.layers[1].pixels.push_back(rng.uniform());
    image.attributes = {{"algorithm", "bdpt"}, {"seed", "7"}};
    return image;
}

TEST(Exr, RoundTripsColourLayersAndAttributes) {
    const ExrImage image = random_image(1);
    const Result<std::string> bytes = encode_exr(image);
    ASSERT_TRUE(bytes.ok()) << bytes.status().message();
    const Result<ExrImage> back = decode_exr(*bytes, "test");
    ASSERT_TRUE(back.ok()) << back.status().message();
    EXPECT_EQ(back->frame, image.frame);
    EXPECT_EQ(back->color.pixels, image.color.pixels);
    for (const ImageLayer& layer : image.layers) {
        ASSERT_NE(back->layer(layer.name), nullptr) << layer.name;
        EXPECT_EQ(back->layer(layer.name)->channels, layer.channels);
        EXPECT_EQ(back->layer(layer.name)->pixels, layer.pixels);
    }
    EXPECT_EQ(back->attribute("algorithm"), "bdpt");
    EXPECT_EQ(back->attribute("seed"), "7");
}

TEST(Exr, BytesDoNotDependOnThreads) {
    const ExrImage image = random_image(2);
    const int before = Imf::globalThreadCount();
    std::vector<std::string> all;
    for (const int threads : {0, 1, 2, 5}) {
        Imf::setGlobalThreadCount(threads);
        all.push_back(*encode_exr(image));
        all.push_back(*encode_exr(image));
    }
    Imf::setGlobalThreadCount(before);
    for (const std::string& bytes : all) EXPECT_EQ(bytes, all[0]);
}

TEST(Exr, HalfRefusesOverflow) {
    ExrImage image = random_image(3);
    const Result<std::string> bytes = encode_exr(image, ExrPixelType::kHalf);
    ASSERT_TRUE(bytes.ok());
    const ExrImage back = *decode_exr(*bytes, "test");
    for (size_t i = 0; i < image.color.pixels.size(); ++i) {
        EXPECT_NEAR(back.color.pixels[i], image.color.pixels[i], 1e-3f * image.color.pixels[i] + 1e-7f);
    }
    image.color.pixels[100] = 70000;
    EXPECT_TRUE(encode_exr(image).ok());
    EXPECT_EQ(encode_exr(image, ExrPixelType::kHalf).status().code(), StatusCode::kInvalidArgument);
    image.color.pixels[100] = float(kNan);
    EXPECT_FALSE(encode_exr(image).ok());
}

TEST(Exr, ReadsForeignFiles) {
    namespace fs = std::filesystem;
    const fs::path folder = fs::path(testing::TempDir()) / "lightloom-film-foreign";
    fs::create_directories(folder);
    const int width = 50, height = 37;
    const std::string tiled = (folder / "tiled.exr").string(), grey = (folder / "grey.exr").string();
    std::vector<half> rgb(size_t(width) * height * 3);
    for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = half(float(i % 777) / 16);
    {
        Imf::Header header(width, height);
        header.setTileDescription(Imf::TileDescription(16, 16, Imf::ONE_LEVEL));
        Imf::FrameBuffer buffer;
        for (const auto& [name, c] : {std::pair<const char*, size_t>{"R", 0}, {"G", 1}, {"B", 2}}) {
            header.channels().insert(name, Imf::Channel(Imf::HALF));
            buffer.insert(name, Imf::Slice(Imf::HALF, reinterpret_cast<char*>(rgb.data() + c), 6, 6 * width));
        }
        Imf::TiledOutputFile file(tiled.c_str(), header);
        file.setFrameBuffer(buffer);
        file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
    }
    const Result<ExrImage> image = read_exr(tiled);
    ASSERT_TRUE(image.ok()) << image.status().message();
    for (size_t i = 0; i < rgb.size(); ++i) ASSERT_EQ(image->color.pixels[i], float(rgb[i]));
    {
        // A display window that does not begin at zero: coordinates are relative to its corner.
        Imf::Header header(Imath::Box2i({-10, 5}, {89, 104}), Imath::Box2i({0, 15}, {width - 1, 15 + height - 1}));
        header.channels().insert("Y", Imf::Channel(Imf::HALF));
        Imf::FrameBuffer buffer;
        buffer.insert("Y", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(rgb.data() - 15 * width), 2, 2 * width));
        Imf::OutputFile file(grey.c_str(), header);
        file.setFrameBuffer(buffer);
        file.writePixels(height);
    }
    const Result<ExrImage> luminance = read_exr(grey);
    ASSERT_TRUE(luminance.ok()) << luminance.status().message();
    EXPECT_EQ(luminance->frame, (FrameLayout{100, 100, {10, 10, 10 + width, 10 + height}}));
    for (size_t i = 0; i < size_t(width) * height * 3; ++i) ASSERT_EQ(luminance->color.pixels[i], float(rgb[i / 3]));
    fs::remove_all(folder);
}

TEST(Exr, RefusesBadInput) {
    ExrImage image = random_image(4);
    image.attributes = {{"dataWindow", "x"}};
    EXPECT_FALSE(encode_exr(image).ok());
    EXPECT_FALSE(decode_exr("", "empty").ok());
    EXPECT_FALSE(decode_exr("not an EXR file at all", "text").ok());
    image = random_image(4);
    const std::string bytes = *encode_exr(image);
    for (size_t size = 0; size < bytes.size(); size += 97) EXPECT_FALSE(decode_exr(bytes.substr(0, size), "cut").ok());
}

TEST(Exr, FilesAppearWholeOrNotAtAll) {
    namespace fs = std::filesystem;
    const fs::path folder = fs::path(testing::TempDir()) / "lightloom-film-test";
    fs::remove_all(folder);
    fs::create_directories(folder);
    const ExrImage image = random_image(5);
    ASSERT_TRUE(write_exr((folder / "a.exr").string(), image).ok());
    ASSERT_TRUE(write_png((folder / "a.png").string(), image.color, -2).ok());
    EXPECT_EQ(read_exr((folder / "a.exr").string())->color.pixels, image.color.pixels);
    EXPECT_EQ(write_exr((folder / "none" / "a.exr").string(), image).code(), StatusCode::kNotFound);
    ExrImage bad = image;
    bad.color.pixels[0] = float(kInfinity);
    EXPECT_FALSE(write_exr((folder / "b.exr").string(), bad).ok());
    size_t files = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder)) ++files;
    EXPECT_EQ(files, 2u);
    EXPECT_EQ(read_exr((folder / "b.exr").string()).status().code(), StatusCode::kNotFound);
    EXPECT_FALSE(read_exr(folder.string()).ok());
    fs::remove_all(folder);
}

TEST(Png, HoldsTheExposedImage) {
    RgbImage image{3, 2, std::vector<float>(18, 0.25f)};
    image.pixels[1] = 100;
    const std::string bytes = *encode_png(image, 1);
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    ASSERT_TRUE(png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()));
    EXPECT_EQ(png.width, 3u);
    EXPECT_EQ(png.height, 2u);
    png.format = PNG_FORMAT_RGB;
    std::vector<uint8_t> codes(18);
    ASSERT_TRUE(png_image_finish_read(&png, nullptr, codes.data(), 0, nullptr));
    for (size_t i = 0; i < codes.size(); ++i) EXPECT_EQ(codes[i], i == 1 ? 255 : 188);
    EXPECT_FALSE(encode_png(image, kNan).ok());
    EXPECT_FALSE(encode_png(RgbImage{}).ok());
}

TEST(Png, SrgbCodes) {
    EXPECT_EQ(srgb_code(0), 0);
    EXPECT_EQ(srgb_code(1), 255);
    EXPECT_EQ(srgb_code(7), 255);
    EXPECT_EQ(srgb_code(-1), 0);
    EXPECT_EQ(srgb_code(float(kNan)), 0);
    EXPECT_EQ(srgb_code(0.5f), 188);
    EXPECT_EQ(srgb_code(0.18f), 118);
    for (int code = 0; code < 256; ++code) EXPECT_EQ(srgb_code(float(srgb_decode(code / 255.0))), code);
    for (double v = 0; v <= 1; v += 1.0 / 512) EXPECT_NEAR(srgb_encode(srgb_decode(v)), v, 1e-6);
}

}  // namespace
}  // namespace lightloom
