#!/usr/bin/env python3
"""Writes relief.pfm and relief-normals.pfm, the height and the normal map of bumped.pbrt: the same gentle waves, which
repeat at the edges. Usage: generate_relief.py (writes beside itself).

Our own, dedicated to the public domain (CC0)."""

import math
import os
import struct

SIZE = 8


def height(u, v):
    a, b = 2 * math.pi * u, 2 * math.pi * v
    return 0.5 + 0.25 * (math.sin(a) * math.cos(b) + math.sin(a + b))


def write(name, kind, pixels):
    folder = os.path.dirname(os.path.abspath(__file__))
    with open(os.path.join(folder, name), "wb") as out:
        out.write(f"{kind}\n{SIZE} {SIZE}\n-1.0\n".encode())
        out.write(struct.pack(f"<{len(pixels)}f", *pixels))


heights, normals = [], []
for y in range(SIZE):  # rows from the bottom, where v is 0
    for x in range(SIZE):
        u, v, d = (x + 0.5) / SIZE, (y + 0.5) / SIZE, 1e-4
        heights.append(height(u, v))
        slope = [0.2 * (height(u + d, v) - height(u - d, v)) / (2 * d), 0.2 * (height(u, v + d) - height(u, v - d)) / (2 * d)]
        length = math.sqrt(slope[0] ** 2 + slope[1] ** 2 + 1)
        normals += [0.5 - 0.5 * slope[0] / length, 0.5 - 0.5 * slope[1] / length, 0.5 + 0.5 / length]
write("relief.pfm", "Pf", heights)
write("relief-normals.pfm", "PF", normals)
