#!/usr/bin/env python3
"""Writes sky.png, the small environment map of env-image.pbrt: a sky above a dim ground, with a bright patch for a sun.

The map is pbrt-v4's equal-area octahedral square; 8-bit sRGB is enough for a test. Usage: generate_sky.py > sky.png
"""

import math
import struct
import sys
import zlib

SIZE = 64


def direction(u, v):
    """Equal-area octahedral mapping of the square to the sphere (Clarberg 2008)."""
    x, y = 2 * u - 1, 2 * v - 1
    distance = 1 - (abs(x) + abs(y))
    r = 1 - abs(distance)
    phi = (math.pi / 4) * (1 if r == 0 else (abs(y) - abs(x)) / r + 1)
    z = math.copysign(1 - r * r, distance)
    scale = r * math.sqrt(2 - r * r)
    return math.copysign(math.cos(phi), x) * scale, math.copysign(math.sin(phi), y) * scale, z


def colour(x, y, z):
    if 0.55 * x - 0.35 * y + 0.758 * z > 0.97:
        return 255, 250, 235
    if z < 0:
        return 70, 60, 50
    return int(150 - 90 * z), int(165 - 70 * z), int(185 - 30 * z)


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def main():
    rows = b"".join(
        b"\0" + b"".join(bytes(colour(*direction((c + 0.5) / SIZE, (r + 0.5) / SIZE))) for c in range(SIZE)) for r in range(SIZE))
    header = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0)
    sys.stdout.buffer.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) +
                            chunk(b"IEND", b""))


if __name__ == "__main__":
    main()
