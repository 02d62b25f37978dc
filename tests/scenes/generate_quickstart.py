#!/usr/bin/env python3
"""Writes quickstart.pbrt: a reading corner at night, lit by a lamp under an opaque shade and by a door left ajar.

Usage: generate_quickstart.py > quickstart.pbrt      (needs nothing but Python 3)
"""

import math
import random

HEADER = """\
# quickstart -- our own scene, dedicated to the public domain (CC0); written by generate_quickstart.py.
# A reading corner at night. Hardly any surface sees a light: the bulb hides in an opaque shade that is open above and
# below, and the hall's lamp reaches the room only through a door left ajar. A path tracer finds both rarely, and the
# bulb through the carafe's glass never by aiming at it; light sub-paths start there.
LookAt 1.05 1.32 -2.35  -0.42 0.86 1.6  0 1 0
Camera "perspective" "float fov" [ 44 ]
Film "rgb" "integer xresolution" [ 480 ] "integer yresolution" [ 270 ] "string filename" "quickstart.exr"
PixelFilter "box"
Sampler "halton" "integer pixelsamples" [ 64 ]
Integrator "bdpt" "integer maxdepth" [ 10 ]

WorldBegin

MakeNamedMaterial "wall" "string type" "diffuse" "rgb reflectance" [ 0.72 0.66 0.56 ]
MakeNamedMaterial "trim" "string type" "diffuse" "rgb reflectance" [ 0.78 0.76 0.72 ]
MakeNamedMaterial "floor" "string type" "coateddiffuse" "rgb reflectance" [ 0.32 0.19 0.1 ] "float roughness" [ 0.12 ] "bool remaproughness" false
MakeNamedMaterial "rug" "string type" "diffuse" "rgb reflectance" [ 0.3 0.07 0.06 ]
MakeNamedMaterial "border" "string type" "diffuse" "rgb reflectance" [ 0.6 0.47 0.27 ]
MakeNamedMaterial "wood" "string type" "coateddiffuse" "rgb reflectance" [ 0.24 0.12 0.06 ] "float roughness" [ 0.08 ] "bool remaproughness" false
MakeNamedMaterial "brass" "string type" "conductor" "rgb reflectance" [ 0.88 0.7 0.38 ] "float roughness" [ 0.12 ] "bool remaproughness" false
MakeNamedMaterial "shade" "string type" "diffuse" "rgb reflectance" [ 0.75 0.68 0.52 ]
MakeNamedMaterial "glass" "string type" "dielectric" "float eta" [ 1.5 ]
MakeNamedMaterial "chair" "string type" "diffuse" "rgb reflectance" [ 0.08 0.2 0.18 ]
MakeNamedMaterial "cushion" "string type" "diffuse" "rgb reflectance" [ 0.66 0.4 0.12 ]
MakeNamedMaterial "ball" "string type" "coateddiffuse" "rgb reflectance" [ 0.6 0.05 0.04 ] "float roughness" [ 0 ]
MakeNamedMaterial "canvas" "string type" "diffuse" "rgb reflectance" [ 0.12 0.22 0.36 ]
MakeNamedMaterial "moon" "string type" "diffuse" "rgb reflectance" [ 0.8 0.76 0.6 ]
MakeNamedMaterial "black" "string type" "diffuse" "rgb reflectance" [ 0 0 0 ]
"""

SEGMENTS = 28


def numbers(values):
    return " ".join(f"{v:.4g}" for v in values)


def mesh(material, points, indices, normals=None):
    flat = [c for p in points for c in p]
    print(f'NamedMaterial "{material}"')
    line = f'Shape "trianglemesh" "integer indices" [ {" ".join(map(str, indices))} ] "point3 P" [ {numbers(flat)} ]'
    if normals:
        line += f' "normal N" [ {numbers([c for n in normals for c in n])} ]'
    print(line)


def quad(material, a, b, c, d):
    mesh(material, [a, b, c, d], [0, 1, 2, 0, 2, 3])


def box(material, lo, hi, turn=0.0, pivot=(0.0, 0.0)):
    """An axis-aligned box, turned by `turn` degrees about the vertical through `pivot` (x, z)."""
    cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    points = []
    for i in range(8):
        x, y, z = (hi[k] if i >> k & 1 else lo[k] for k in range(3))
        dx, dz = x - pivot[0], z - pivot[1]
        points.append((pivot[0] + cos * dx + sin * dz, y, pivot[1] - sin * dx + cos * dz))
    faces = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    mesh(material, points, [i for a, b, c, d in faces for i in (a, b, c, a, c, d)])


def smooth(profile, steps):
    """Catmull-Rom curve through a profile of (radius, height)."""
    points = []
    for i in range(len(profile) - 1):
        p = [profile[max(i - 1, 0)], profile[i], profile[i + 1], profile[min(i + 2, len(profile) - 1)]]
        for s in range(steps):
            t = s / steps
            points.append(tuple(
                0.5 * (2 * p[1][k] + (p[2][k] - p[0][k]) * t + (2 * p[0][k] - 5 * p[1][k] + 4 * p[2][k] - p[3][k]) * t * t
                       + (3 * p[1][k] - p[0][k] - 3 * p[2][k] + p[3][k]) * t**3) for k in range(2)))
    return points + [profile[-1]]


def lathe(material, centre, profile):
    """Revolves a profile about the vertical through `centre`; what is solid lies to the left of its direction."""
    points, normals, indices = [], [], []
    last = len(profile) - 1
    for i, (radius, height) in enumerate(profile):
        before, after = profile[max(i - 1, 0)], profile[min(i + 1, last)]
        dr, dy = after[0] - before[0], after[1] - before[1]
        length = math.hypot(dr, dy)
        for s in range(SEGMENTS):
            cos, sin = math.cos(2 * math.pi * s / SEGMENTS), math.sin(2 * math.pi * s / SEGMENTS)
            radius = max(radius, 1e-4)
            points.append((centre[0] + radius * cos, centre[1] + height, centre[2] + radius * sin))
            normals.append((dy / length * cos, -dr / length, dy / length * sin))
    for i in range(last):
        for s in range(SEGMENTS):
            a, b = i * SEGMENTS + s, i * SEGMENTS + (s + 1) % SEGMENTS
            indices += [a, a + SEGMENTS, b + SEGMENTS, a, b + SEGMENTS, b]
    mesh(material, points, indices, normals)


def room():
    x0, x1, z0, z1, top = -2.0, 2.0, -2.6, 2.5, 2.6
    quad("floor", (x0, 0, z0), (x0, 0, 4.6), (x1, 0, 4.6), (x1, 0, z0))
    quad("wall", (x0, top, z0), (x1, top, z0), (x1, top, 4.6), (x0, top, 4.6))
    quad("wall", (x0, 0, z0), (x0, top, z0), (x0, top, 4.6), (x0, 0, 4.6))
    quad("wall", (x1, 0, z0), (x1, 0, 4.6), (x1, top, 4.6), (x1, top, z0))
    quad("wall", (x0, 0, z0), (x1, 0, z0), (x1, top, z0), (x0, top, z0))
    quad("wall", (x0, 0, 4.6), (x0, top, 4.6), (x1, top, 4.6), (x1, 0, 4.6))
    # The wall to the hall, with its doorway, and the skirting.
    box("wall", (x0, 0, z1), (0.55, top, z1 + 0.12))
    box("wall", (0.55, 2.05, z1), (1.4, top, z1 + 0.12))
    box("wall", (1.4, 0, z1), (x1, top, z1 + 0.12))
    box("trim", (x0, 0, z1 - 0.02), (0.47, 0.1, z1))
    box("trim", (0.47, 0, z1 - 0.03), (0.55, 2.13, z1 + 0.14))
    box("trim", (1.4, 0, z1 - 0.03), (1.48, 2.13, z1 + 0.14))
    box("trim", (0.55, 2.05, z1 - 0.03), (1.4, 2.13, z1 + 0.14))
    # The door opens into the hall, hinged on the right, and lets a blade of light through.
    box("wood", (0.56, 0.01, z1 + 0.12), (1.39, 2.04, z1 + 0.16), turn=38, pivot=(1.39, z1 + 0.14))


def lamp(centre):
    lathe("brass", centre, smooth([(0.09, 0), (0.085, 0.015), (0.03, 0.03), (0.018, 0.08), (0.035, 0.16), (0.02, 0.24),
                                   (0.012, 0.34)], 5))
    lathe("shade", centre, [(0.2, 0.3), (0.13, 0.56)])
    print("AttributeBegin")
    print(f"  Translate {centre[0]} {centre[1] + 0.4} {centre[2]}")
    print('  AreaLightSource "diffuse" "rgb L" [ 1250 830 410 ]')
    print('  NamedMaterial "black"')
    print('  Shape "sphere" "float radius" [ 0.032 ]')
    print("AttributeEnd")


def hall_light():
    print("AttributeBegin")
    print('  AreaLightSource "diffuse" "rgb L" [ 62 56 48 ]')
    quad("black", (-0.9, 2.55, 3.3), (-0.1, 2.55, 3.3), (-0.1, 2.55, 3.9), (-0.9, 2.55, 3.9))
    print("AttributeEnd")


def side_table(centre):
    x, z = centre
    lathe("wood", (x, 0, z), [(0.0, 0.54), (0.36, 0.54), (0.38, 0.55), (0.38, 0.57), (0.36, 0.58), (0.0, 0.58)])
    lathe("wood", (x, 0, z), smooth([(0.2, 0.0), (0.19, 0.025), (0.05, 0.06), (0.04, 0.3), (0.07, 0.54)], 4))


def carafe(centre):
    outer = [(0.0, 0.0), (0.07, 0.002), (0.085, 0.03), (0.088, 0.09), (0.055, 0.16), (0.03, 0.2), (0.032, 0.24), (0.045, 0.28)]
    inner = [(0.04, 0.28), (0.027, 0.24), (0.025, 0.2), (0.05, 0.156), (0.082, 0.09), (0.078, 0.034), (0.06, 0.016), (0.0, 0.014)]
    lathe("glass", centre, smooth(outer, 4) + smooth(inner, 4))


def bookcase():
    rng = random.Random(5)
    x0, x1, z0, z1 = -2.0, -1.68, 0.1, 1.9
    box("wood", (x0, 0, z0), (x1, 1.75, z0 + 0.03))
    box("wood", (x0, 0, z1 - 0.03), (x1, 1.75, z1))
    colours = [(0.35, 0.06, 0.05), (0.07, 0.13, 0.24), (0.1, 0.2, 0.1), (0.5, 0.38, 0.2), (0.25, 0.2, 0.16), (0.55, 0.5, 0.42)]
    for i, colour in enumerate(colours):
        print(f'MakeNamedMaterial "book{i}" "string type" "diffuse" "rgb reflectance" [ {numbers(colour)} ]')
    for shelf in range(5):
        y = 0.06 + 0.42 * shelf
        box("wood", (x0, y - 0.03, z0), (x1, y, z1))
        z = z0 + 0.05
        while shelf < 4 and z < z1 - 0.14 - (0.5 if shelf == 2 else 0):
            thick, height, depth = rng.uniform(0.025, 0.06), rng.uniform(0.22, 0.34), rng.uniform(0.17, 0.24)
            lean = 9 if rng.random() < 0.04 else 0
            box(f"book{rng.randrange(len(colours))}", (x0 + 0.02, y, z), (x0 + 0.02 + depth, y + height, z + thick), turn=lean,
                pivot=(x0 + 0.02, z))
            z += thick + 0.003 + (0.04 if lean else 0)


def armchair():
    turn, pivot = -28, (0.25, 1.35)
    for material, lo, hi in [
        ("chair", (-0.15, 0.12, 1.0), (0.65, 0.36, 1.7)),
        ("cushion", (-0.02, 0.36, 0.98), (0.52, 0.46, 1.52)),
        ("chair", (-0.15, 0.36, 1.52), (0.65, 0.98, 1.7)),
        ("chair", (-0.15, 0.36, 1.0), (-0.03, 0.6, 1.54)),
        ("chair", (0.53, 0.36, 1.0), (0.65, 0.6, 1.54)),
        ("wood", (-0.13, 0, 1.02), (-0.08, 0.12, 1.07)), ("wood", (0.58, 0, 1.02), (0.63, 0.12, 1.07)),
        ("wood", (-0.13, 0, 1.63), (-0.08, 0.12, 1.68)), ("wood", (0.58, 0, 1.63), (0.63, 0.12, 1.68)),
    ]:
        box(material, lo, hi, turn, pivot)
    box("book0", (0.1, 0.46, 1.12), (0.34, 0.49, 1.3), turn - 15, (0.2, 1.2))


def picture():
    z = 2.5
    box("brass", (-1.0, 1.25, z - 0.03), (-0.15, 1.85, z))
    box("canvas", (-0.96, 1.29, z - 0.034), (-0.19, 1.81, z - 0.02))
    x, y, radius, corners = -0.42, 1.66, 0.07, 24
    rim = [(x + radius * math.cos(2 * math.pi * k / corners), y + radius * math.sin(2 * math.pi * k / corners), z - 0.0345)
           for k in range(corners)]
    mesh("moon", rim, [k for c in range(1, corners - 1) for k in (0, c + 1, c)])


def main():
    print(HEADER)
    room()
    quad("border", (-1.25, 0.006, -0.6), (-1.25, 0.006, 1.1), (1.0, 0.006, 1.1), (1.0, 0.006, -0.6))
    quad("rug", (-1.13, 0.009, -0.48), (-1.13, 0.009, 0.98), (0.88, 0.009, 0.98), (0.88, 0.009, -0.48))
    bookcase()
    side_table((-0.85, 1.75))
    lamp((-0.92, 0.58, 1.85))
    carafe((-0.68, 0.5805, 1.58))
    armchair()
    picture()
    print("AttributeBegin\n  Translate -0.55 0.1 0.35\n  NamedMaterial \"ball\"\n  Shape \"sphere\" \"float radius\" [ 0.09 ]\nAttributeEnd")
    hall_light()


if __name__ == "__main__":
    main()
