#include "common/scene/noise.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/core/math.h"

namespace lightloom {
namespace {

/// Perlin's permutation of 0 ... 255.
constexpr uint8_t kPermutation[256] = {
    151, 160, 137, 91,  90,  15,  131, 13,  201, 95,  96,  53,  194, 233, 7,   225, 140, 36,  103, 30,  69,  142, 8,   99,
    37,  240, 21,  10,  23,  190, 6,   148, 247, 120, 234, 75,  0,   26,  197, 62,  94,  252, 219, 203, 117, 35,  11,  32,
    57,  177, 33,  88,  237, 149, 56,  87,  174, 20,  125, 136, 171, 168, 68,  175, 74,  165, 71,  134, 139, 48,  27,  166,
    77,  146, 158, 231, 83,  111, 229, 122, 60,  211, 133, 230, 220, 105, 92,  41,  55,  46,  245, 40,  244, 102, 143, 54,
    65,  25,  63,  161, 1,   216, 80,  73,  209, 76,  132, 187, 208, 89,  18,  169, 200, 196, 135, 130, 116, 188, 159, 86,
    164, 100, 109, 198, 173, 186, 3,   64,  52,  217, 226, 250, 124, 123, 5,   202, 38,  147, 118, 126, 255, 82,  85,  212,
    207, 206, 59,  227, 47,  16,  58,  17,  182, 189, 28,  42,  223, 183, 170, 213, 119, 248, 152, 2,   44,  154, 163, 70,
    221, 153, 101, 155, 167, 43,  172, 9,   129, 22,  39,  253, 19,  98,  108, 110, 79,  113, 224, 232, 178, 185, 112, 104,
    218, 246, 97,  228, 251, 34,  242, 193, 238, 210, 144, 12,  191, 179, 162, 241, 81,  51,  145, 235, 249, 14,  239, 107,
    49,  192, 214, 31,  181, 199, 106, 157, 184, 84,  204, 176, 115, 121, 50,  45,  127, 4,   150, 254, 138, 236, 205, 93,
    222, 114, 67,  29,  24,  72,  243, 141, 128, 195, 78,  66,  215, 61,  156, 180};

/// One coordinate: its cell modulo 256, its position in the cell, and the weight of the cell's far end there.
struct Axis {
    uint32_t cell;
    float offset, weight;

    explicit Axis(float x) {
        // These operations are exact for every finite float; from 2^23 on the fraction is zero.
        const float whole = std::floor(x);
        cell = uint32_t(whole - 256 * std::floor(whole / 256));
        offset = x - whole;
        const float t = offset;
        weight = t * t * t * (t * (t * 6 - 15) + 10);
    }
};

uint32_t permuted(uint32_t i) { return kPermutation[i & 255]; }

/// Product of the offset from a corner of the cell with the gradient of that corner.
float corner(const Axis& x, const Axis& y, const Axis& z, uint32_t i, uint32_t j, uint32_t k) {
    const float dx = x.offset - float(i), dy = y.offset - float(j), dz = z.offset - float(k);
    const uint32_t hash = permuted(permuted(permuted(x.cell + i) + y.cell + j) + z.cell + k) & 15;
    const bool spare = hash == 12 || hash == 13;
    const float a = hash < 8 || spare ? dx : dy, b = hash < 4 || spare ? dy : dz;
    return ((hash & 1) != 0 ? -a : a) + ((hash & 2) != 0 ? -b : b);
}

}  // namespace

float noise(const Vec3& p) {
    if (!is_finite(p)) return 0;
    const Axis x(p.x), y(p.y), z(p.z);
    float plane[2];
    for (uint32_t k = 0; k < 2; ++k) {
        const float near = lerp(x.weight, corner(x, y, z, 0, 0, k), corner(x, y, z, 1, 0, k));
        const float far = lerp(x.weight, corner(x, y, z, 0, 1, k), corner(x, y, z, 1, 1, k));
        plane[k] = lerp(y.weight, near, far);
    }
    return lerp(z.weight, plane[0], plane[1]);
}

float fractal_noise(const Vec3& p, float omega, int octaves) {
    float sum = 0, frequency = 1, amplitude = 1;
    for (int i = 0; i < octaves; ++i) {
        sum += amplitude * noise(p * frequency);
        frequency *= 1.99f;
        amplitude *= omega;
    }
    return sum;
}

float turbulence(const Vec3& p, float omega, int octaves) {
    float sum = 0, frequency = 1, amplitude = 1;
    for (int i = 0; i < octaves; ++i) {
        sum += amplitude * std::fabs(noise(p * frequency));
        frequency *= 1.99f;
        amplitude *= omega;
    }
    return sum + 0.2f * amplitude;
}

bool inside_dot(Vec2 st) {
    // Beyond this, floats have no fractions that could place a dot in a cell.
    if (!(std::fabs(st.x) < 0x1p23f && std::fabs(st.y) < 0x1p23f)) return false;
    const float s = std::floor(st.x + 0.5f), t = std::floor(st.y + 0.5f);
    if (!(noise({s + 0.5f, t + 0.5f, 0.5f}) > 0)) return false;
    constexpr float kRadius = 0.35f, kMaxShift = 0.5f - kRadius;
    const float ds = st.x - (s + kMaxShift * noise({s + 1.5f, t + 2.8f, 0.5f}));
    const float dt = st.y - (t + kMaxShift * noise({s + 4.5f, t + 9.8f, 0.5f}));
    return ds * ds + dt * dt < kRadius * kRadius;
}

Rgb marble(const Vec3& p, float omega, int octaves, float variation) {
    constexpr int kSegments = 6;
    static constexpr Rgb kColours[kSegments + 3] = {{0.58f, 0.58f, 0.6f}, {0.58f, 0.58f, 0.6f}, {0.58f, 0.58f, 0.6f},
                                                    {0.5f, 0.5f, 0.5f},   {0.6f, 0.59f, 0.58f}, {0.58f, 0.58f, 0.6f},
                                                    {0.58f, 0.58f, 0.6f}, {0.2f, 0.2f, 0.33f},  {0.58f, 0.58f, 0.6f}};
    double angle = double(p.y) + double(variation) * double(fractal_noise(p, omega, octaves));
    if (!(std::fabs(angle) < 1e18)) angle = 0;
    angle -= 2 * kPiD * std::floor(angle / (2 * kPiD));  // The sine does not take large arguments.
    const float turns = float(0.5 + 0.5 * math::sin(angle)) * kSegments;
    const int first = clamp(int(std::floor(turns)), 0, kSegments - 1);
    const float t = clamp(turns - float(first), 0.0f, 1.0f), u = 1 - t;
    const Rgb* c = &kColours[first];
    return (c[0] * (u * u * u) + c[1] * (3 * u * u * t) + c[2] * (3 * u * t * t) + c[3] * (t * t * t)) * 1.5f;
}

}  // namespace lightloom
