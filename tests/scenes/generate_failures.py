#!/usr/bin/env python3
"""Writes the scenes in which algorithms fail: slit, glossy-lamps, ceiling-lamp, corridor, one-lamp, paperweight (.pbrt each).

Usage: generate_failures.py      (writes them beside itself; needs nothing but Python 3)

What a scene tests stands in its first lines. Lengths are metres, y is up, and cameras look along +z.
"""

import math
import pathlib
import random


def numbers(values):
    return " ".join(f"{v:.4g}" for v in values)


class Scene:
    """The text of one scene file. What is solid is made of boxes, spheres and revolved profiles."""

    def __init__(self, name, claim, eye, target, fov, depth):
        self.name = name
        self.lines = [f"# {name} -- our own scene, dedicated to the public domain (CC0); written by generate_failures.py."]
        self.lines += [f"# {line}" for line in claim.strip().splitlines()]
        self.lines += [
            f"LookAt {numbers(eye)}  {numbers(target)}  0 1 0",
            f'Camera "perspective" "float fov" [ {fov} ]',
            f'Film "rgb" "integer xresolution" [ 320 ] "integer yresolution" [ 180 ] "string filename" "{name}.exr"',
            'PixelFilter "box"',
            'Sampler "halton" "integer pixelsamples" [ 64 ]',
            f'Integrator "bdpt" "integer maxdepth" [ {depth} ]',
            "",
            "WorldBegin",
            "",
        ]

    def add(self, line):
        self.lines.append(line)

    def write(self):
        pathlib.Path(__file__).with_name(self.name + ".pbrt").write_text("\n".join(self.lines) + "\n")

    # Materials.

    def define(self, material, kind, rest):
        self.add(f'MakeNamedMaterial "{material}" "string type" "{kind}" {rest}')

    def matt(self, material, *rgb):
        self.define(material, "diffuse", f'"rgb reflectance" [ {numbers(rgb)} ]')

    def glazed(self, material, rgb, roughness):
        self.define(material, "coateddiffuse",
                    f'"rgb reflectance" [ {numbers(rgb)} ] "float roughness" [ {roughness} ] "bool remaproughness" false')

    def metal(self, material, rgb, roughness):
        self.define(material, "conductor",
                    f'"rgb reflectance" [ {numbers(rgb)} ] "float roughness" [ {roughness} ] "bool remaproughness" false')

    def checks(self, material, kind, across, along, first, second, rest=""):
        self.add(f'Texture "{material}" "spectrum" "checkerboard" "float uscale" [ {across} ] "float vscale" [ {along} ]'
                 f' "rgb tex1" [ {numbers(first)} ] "rgb tex2" [ {numbers(second)} ]')
        self.define(material, kind, f'"texture reflectance" "{material}" {rest}')

    # Shapes.

    def mesh(self, material, points, indices, more=""):
        if material:
            self.add(f'NamedMaterial "{material}"')
        self.add(f'Shape "trianglemesh" "integer indices" [ {" ".join(map(str, indices))} ]'
                 f' "point3 P" [ {numbers([c for p in points for c in p])} ]{more}')

    def quad(self, material, a, b, c, d):
        self.mesh(material, [a, b, c, d], [0, 1, 2, 0, 2, 3], ' "point2 uv" [ 0 0 1 0 1 1 0 1 ]')

    def box(self, material, lo, hi, turn=0.0):
        """An axis-aligned box, turned by `turn` degrees about the vertical through its middle."""
        cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        middle = [(lo[k] + hi[k]) / 2 for k in range(3)]
        points = []
        for i in range(8):
            x, y, z = (hi[k] if i >> k & 1 else lo[k] for k in range(3))
            dx, dz = x - middle[0], z - middle[2]
            points.append((middle[0] + cos * dx + sin * dz, y, middle[2] - sin * dx + cos * dz))
        faces = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
        self.mesh(material, points, [i for a, b, c, d in faces for i in (a, b, c, a, c, d)])

    def wall_with_hole(self, material, lo, hi, hole_lo, hole_hi, along):
        """A box with an opening through it; the wall runs along axis `along` (0 or 2), the other one is its thickness."""
        def part(a0, a1, y0, y1):
            low, high = list(lo), list(hi)
            low[along], high[along], low[1], high[1] = a0, a1, y0, y1
            self.box(material, low, high)

        part(lo[along], hole_lo[0], lo[1], hi[1])
        part(hole_hi[0], hi[along], lo[1], hi[1])
        part(hole_lo[0], hole_hi[0], lo[1], hole_lo[1])
        part(hole_lo[0], hole_hi[0], hole_hi[1], hi[1])

    def sphere(self, material, centre, radius):
        self.add(f'AttributeBegin\n  Translate {numbers(centre)}\n  NamedMaterial "{material}"\n'
                 f'  Shape "sphere" "float radius" [ {radius} ]\nAttributeEnd')

    def lamp(self, centre, radius, *rgb):
        self.add(f'AttributeBegin\n  Translate {numbers(centre)}\n  AreaLightSource "diffuse" "rgb L" [ {numbers(rgb)} ]\n'
                 f'  NamedMaterial "black"\n  Shape "sphere" "float radius" [ {radius} ]\nAttributeEnd')

    def lamps(self, centres, radius, *rgb):
        """Lamps of one colour; each is placed from the one before, which keeps the file small."""
        self.add(f'AttributeBegin\n  AreaLightSource "diffuse" "rgb L" [ {numbers(rgb)} ]\n  NamedMaterial "black"')
        last = (0, 0, 0)
        for centre in centres:
            self.add(f'  Translate {numbers(round(c - l, 4) for c, l in zip(centre, last))} Shape "sphere" "float radius" {radius:g}')
            last = centre
        self.add("AttributeEnd")

    def turned(self, material, centre, profile, segments=8, levels=2):
        """Revolves a profile of (radius, height) about the vertical through `centre`, and rounds it by subdivision.

        Solid lies to the left of the profile's direction; both ends have radius 0; a point that stands twice makes an edge.
        """
        widen = 1 / (0.5 + 0.5 * math.cos(2 * math.pi / segments) * 0.97)  # Subdivision pulls the rings inwards.
        points, indices, rings = [], [], []
        for radius, height in profile:
            count = segments if radius else 1
            rings.append([len(points) + s % count for s in range(segments)])
            for s in range(count):
                angle = 2 * math.pi * s / segments
                points.append((centre[0] + widen * radius * math.cos(angle), centre[1] + height,
                               centre[2] + widen * radius * math.sin(angle)))
        for low, high in zip(rings, rings[1:]):
            for s in range(segments):
                t = (s + 1) % segments
                if high[s] != high[t]:
                    indices += [low[s], high[s], high[t]]
                if low[s] != low[t]:
                    indices += [low[s], high[t], low[t]]
        self.add(f'NamedMaterial "{material}"')
        self.add(f'Shape "loopsubdiv" "integer levels" {levels} "integer indices" [ {" ".join(map(str, indices))} ]'
                 f' "point3 P" [ {numbers([c for p in points for c in p])} ]')

    def column(self, material, centre, radius, height, sides=12):
        """An upright prism on `centre` with a lid and no bottom."""
        points = [(centre[0], centre[1] + height, centre[2])]
        for i in range(2 * sides):
            angle = 2 * math.pi * (i // 2) / sides
            points.append((centre[0] + radius * math.cos(angle), centre[1] + height * (i % 2), centre[2] + radius * math.sin(angle)))
        indices = []
        for i in range(sides):
            low, next_low = 1 + 2 * i, 1 + 2 * ((i + 1) % sides)
            indices += [low, low + 1, next_low + 1, low, next_low + 1, next_low, 0, next_low + 1, low + 1]
        self.mesh(material, points, indices)


def scaled(profile, factor):
    return [(factor * r, factor * y) for r, y in profile]


VASE = [(0, 0), (0.055, 0), (0.095, 0.07), (0.1, 0.15), (0.05, 0.25), (0.035, 0.3), (0.055, 0.33), (0.04, 0.33), (0, 0.27)]
POT = [(0, 0), (0.06, 0), (0.1, 0.09), (0.08, 0.19), (0.04, 0.24), (0.055, 0.28), (0, 0.27)]
PLATE = [(0, 0), (0.1, 0), (0.2, 0.03), (0.205, 0.04), (0.19, 0.035), (0.1, 0.012), (0, 0.012)]


def slit():
    scene = Scene("slit", """
A kitchen at night, lit by a lamp in the yard through a gap of three centimetres between its shutters. `path` reaches the lamp
from the blade of light alone: everything else waits for a bounce that hits the blade by chance. Of the light sub-paths one in
some seventy comes through the gap, so `bdpt` and the caches of light vertices mostly hold what lights the outside of a house.""",
                  (0.75, 1.5, -1.9), (-0.35, 0.88, 2.4), 46, 8)
    scene.matt("plaster", 0.74, 0.68, 0.58)
    scene.matt("ceiling", 0.8, 0.78, 0.74)
    scene.checks("tiles", "coateddiffuse", 8, 12, (0.62, 0.5, 0.38), (0.5, 0.2, 0.12),
                 '"float roughness" [ 0.15 ] "bool remaproughness" false')
    scene.matt("shutter", 0.16, 0.3, 0.3)
    scene.checks("louvres", "diffuse", 0.99, 44, (0.16, 0.3, 0.3), (0.09, 0.18, 0.18))
    scene.glazed("wood", (0.36, 0.2, 0.1), 0.15)
    scene.matt("cloth", 0.82, 0.8, 0.74)
    scene.matt("dresser", 0.14, 0.3, 0.36)
    scene.glazed("blue", (0.06, 0.16, 0.5), 0.05)
    scene.glazed("orange", (0.85, 0.32, 0.04), 0.2)
    scene.glazed("plate", (0.8, 0.78, 0.7), 0.08)
    scene.glazed("lemon", (0.85, 0.68, 0.08), 0.2)
    scene.add('LightSource "spot" "rgb I" [ 27000 22000 15500 ] "point3 from" [ -6.2 4.1 0.95 ] "point3 to" [ -2 1.5 1.8 ]'
              ' "float coneangle" 12 "float conedeltaangle" 2')
    x0, x1, z0, z1, top = -2.0, 2.0, -2.2, 4.0, 2.6
    scene.quad("tiles", (x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1))
    scene.box("ceiling", (x0 - 0.2, top, z0 - 0.2), (x1 + 0.2, top + 0.1, z1 + 0.2))
    scene.box("plaster", (x0 - 0.2, 0, z1), (x1 + 0.2, top, z1 + 0.2))
    scene.box("plaster", (x0 - 0.2, 0, z0 - 0.2), (x1 + 0.2, top, z0))
    scene.box("plaster", (x1, 0, z0), (x1 + 0.2, top, z1))
    scene.wall_with_hole("plaster", (x0 - 0.2, 0, z0), (x0, top, z1), (1.2, 0.75), (2.4, 2.25), 2)
    # Two wings and the gap between them.
    for a, b in ((1.2, 1.785), (1.815, 2.4)):
        for lo, hi in (((a, 0.75), (a + 0.07, 2.25)), ((b - 0.07, 0.75), (b, 2.25)), ((a, 0.75), (b, 0.83)),
                       ((a, 2.17), (b, 2.25)), ((a, 1.46), (b, 1.54))):
            scene.box("shutter", (x0 - 0.1, lo[1], lo[0]), (x0 - 0.06, hi[1], hi[0]))
        scene.quad("louvres", (x0 - 0.08, 0.75, a), (x0 - 0.08, 0.75, b), (x0 - 0.08, 2.25, b), (x0 - 0.08, 2.25, a))
    # A table with a cloth, and what stands on it.
    scene.box("cloth", (-0.95, 0.74, 1.45), (0.6, 0.76, 2.5))
    scene.box("cloth", (-0.95, 0.5, 1.44), (0.6, 0.76, 1.45))
    scene.box("cloth", (0.6, 0.5, 1.44), (0.61, 0.76, 2.5))
    for x in (-0.88, 0.48):
        for z in (1.52, 2.38):
            scene.box("wood", (x, 0, z), (x + 0.06, 0.74, z + 0.06))
    scene.turned("blue", (-0.5, 0.76, 1.85), VASE)
    scene.turned("plate", (0.12, 0.76, 1.95), PLATE)
    scene.sphere("orange", (0.08, 0.815, 1.98), 0.045)
    scene.sphere("orange", (0.16, 0.815, 2.02), 0.043)
    scene.sphere("lemon", (0.15, 0.812, 1.93), 0.04)
    scene.box("wood", (-0.15, 0.76, 1.6), (0.1, 0.78, 1.76), 20)
    # A dresser with plates at the far wall, and a chair.
    scene.box("dresser", (-0.6, 0, 3.55), (1.2, 0.9, 4.0))
    scene.box("wood", (-0.64, 0.9, 3.5), (1.24, 0.94, 4.0))
    for x in (-0.52, 0.06, 0.64):
        scene.box("dresser", (x, 0.1, 3.53), (x + 0.5, 0.8, 3.55))
        scene.sphere("lemon", (x + 0.25, 0.6, 3.515), 0.02)
    scene.box("wood", (-0.6, 1.5, 3.8), (1.2, 1.53, 4.0))
    for i, x in enumerate((-0.38, 0.02, 0.4, 0.86)):
        scene.turned(("blue", "plate", "orange", "plate")[i], (x, 1.53, 3.9), scaled(POT, 0.8), 6)
    scene.turned("plate", (0.5, 0.94, 3.75), [(0, 0), (0.08, 0), (0.16, 0.08), (0.18, 0.13), (0.16, 0.12), (0, 0.03)])
    for x in (0.85, 1.2):
        for z, h in ((1.75, 0.95), (2.1, 0.45)):
            scene.box("wood", (x, 0, z), (x + 0.04, h, z + 0.04))
    scene.box("wood", (0.85, 0.43, 1.75), (1.24, 0.47, 2.14))
    for y in (0.6, 0.75, 0.88):
        scene.box("wood", (0.85, y, 1.755), (1.24, y + 0.06, 1.785))
    scene.write()


def glossy_lamps():
    scene = Scene("glossy-lamps", """
Garlands of 144 small coloured lamps over rough metal. A point of the metal mirrors a handful of them: next event estimation aims
at any, and a bounce along the metal's lobe seldom hits so small a lamp. `light` cannot aim at the lobe either: what it sees of
the metal is rare and bright. No technique here knows lobe and lamps at once, so light sub-paths, cached or learned, gain nothing.""",
                  (0, 0.62, -2.3), (0, 0.36, 0.5), 40, 6)
    scene.matt("black", 0, 0, 0)
    scene.matt("wall", 0.12, 0.1, 0.14)
    scene.metal("table", (0.42, 0.43, 0.46), 0.1)
    scene.metal("copper", (0.93, 0.56, 0.42), 0.09)
    scene.metal("steel", (0.7, 0.72, 0.74), 0.06)
    scene.metal("brass", (0.88, 0.7, 0.38), 0.13)
    scene.quad("table", (-4, 0, -3), (4, 0, -3), (4, 0, 2.2), (-4, 0, 2.2))
    scene.quad("wall", (-4, 0, 2.2), (4, 0, 2.2), (4, 4, 2.2), (-4, 4, 2.2))
    colours = [(1, 0.012, 0.004), (1, 0.3, 0.008), (0.008, 0.6, 0.03), (0.01, 0.08, 1), (0.8, 0.01, 0.5), (1, 0.6, 0.25)]
    centres = [[] for _ in colours]
    for row in range(6):
        for i in range(24):
            sag = 0.3 * math.sin(math.pi * (i % 8) / 8) + (0.35 if row == 0 else 0)
            centres[(i + 2 * row) % 6].append((-2.3 + 0.2 * i + 0.1 * (row % 2), 1.5 - sag - 0.03 * row, 1.9 - 0.62 * row))
    for colour, places in zip(colours, centres):
        scene.lamps(places, 0.025, *(40 * c for c in colour))
    scene.sphere("copper", (-0.62, 0.3, 0.35), 0.3)
    scene.turned("steel", (0.08, 0, 0.55), scaled(VASE, 2.2))
    scene.turned("brass", (0.72, 0, 0.25), [(0, 0), (0.12, 0), (0.1, 0.04), (0.3, 0.2), (0.36, 0.34), (0.34, 0.34), (0.27, 0.2),
                                                 (0, 0.08)])
    scene.sphere("steel", (0.2, 0.09, -0.3), 0.09)
    scene.sphere("brass", (-0.22, 0.12, -0.12), 0.12)
    scene.sphere("copper", (0.42, 0.06, -0.42), 0.06)
    scene.write()


def ceiling_lamp():
    scene = Scene("ceiling-lamp", """
A lamp hangs a hand's breadth under the ceiling and shines at it (as in the boxes of Grittmann et al. 2021). All light comes from
a spot of the ceiling not much wider than the lamp. `path` has to hit that spot by chance, and where it does, the lamp is so near
that next event estimation gives spikes. Two vertices of a light sub-path are all that it takes: `bdpt` has them for nothing,
and learning cannot gain.""",
                  (0.1, 1.35, -2.6), (-0.1, 1.22, 2), 50, 8)
    scene.matt("black", 0, 0, 0)
    scene.matt("ceiling", 0.82, 0.8, 0.76)
    scene.matt("teal", 0.1, 0.34, 0.36)
    scene.matt("ochre", 0.72, 0.46, 0.16)
    scene.matt("wall", 0.7, 0.66, 0.6)
    scene.glazed("floor", (0.34, 0.2, 0.11), 0.15)
    scene.matt("sofa", 0.6, 0.12, 0.07)
    scene.matt("cushion", 0.75, 0.6, 0.3)
    scene.matt("rug", 0.66, 0.6, 0.5)
    scene.glazed("white", (0.8, 0.8, 0.78), 0.08)
    scene.matt("leaf", 0.1, 0.3, 0.08)
    scene.metal("brass", (0.88, 0.7, 0.38), 0.15)
    x0, x1, z0, z1, top = -2.0, 2.0, -2.8, 2.6, 2.5
    scene.quad("floor", (x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1))
    scene.quad("ceiling", (x0, top, z0), (x1, top, z0), (x1, top, z1), (x0, top, z1))
    scene.quad("wall", (x0, 0, z1), (x1, 0, z1), (x1, top, z1), (x0, top, z1))
    scene.quad("wall", (x0, 0, z0), (x1, 0, z0), (x1, top, z0), (x0, top, z0))
    scene.quad("teal", (x0, 0, z0), (x0, 0, z1), (x0, top, z1), (x0, top, z0))
    scene.quad("ochre", (x1, 0, z0), (x1, 0, z1), (x1, top, z1), (x1, top, z0))
    # The lamp: a dish whose bulb lies a hand's breadth under the ceiling.
    c = (0.1, 0, 1.0)
    scene.add('AttributeBegin\n  AreaLightSource "diffuse" "rgb L" [ 2200 1800 1300 ]\n  NamedMaterial "black"')
    h = 0.05
    scene.quad(None, (c[0] - h, top - 0.09, c[2] - h), (c[0] - h, top - 0.09, c[2] + h), (c[0] + h, top - 0.09, c[2] + h),
               (c[0] + h, top - 0.09, c[2] - h))
    scene.add("AttributeEnd")
    scene.turned("brass", (c[0], top - 0.16, c[2]), [(0, 0), (0.08, 0), (0.2, 0.05), (0.24, 0.09), (0.23, 0.09), (0.18, 0.055), (0, 0.05)])
    for a in range(3):
        x, z = c[0] + 0.2 * math.cos(2.1 * a), c[2] + 0.2 * math.sin(2.1 * a)
        scene.box("brass", (x - 0.004, top - 0.11, z - 0.004), (x + 0.004, top, z + 0.004))
    # Sofa, table, plant, pictures.
    scene.box("rug", (-1.3, 0, 0.1), (1.3, 0.015, 1.9))
    scene.box("sofa", (-1.0, 0.12, 1.7), (0.9, 0.42, 2.5))
    scene.box("sofa", (-1.0, 0.42, 2.25), (0.9, 0.85, 2.5))
    scene.box("sofa", (-1.2, 0.12, 1.7), (-1.0, 0.6, 2.5))
    scene.box("sofa", (0.9, 0.12, 1.7), (1.1, 0.6, 2.5))
    scene.box("cushion", (-0.85, 0.42, 2.05), (-0.45, 0.78, 2.2), 12)
    scene.box("teal", (0.4, 0.42, 2.05), (0.75, 0.74, 2.2), -14)
    scene.column("white", (0, 0.36, 0.85), 0.42, 0.03, 36)
    scene.column("brass", (0, 0.015, 0.85), 0.03, 0.345)
    scene.column("brass", (0, 0.015, 0.85), 0.2, 0.015)
    scene.turned("white", (-0.12, 0.39, 0.9), scaled(VASE, 0.6))
    scene.box("sofa", (0.08, 0.39, 0.7), (0.3, 0.41, 0.85), 25)
    scene.box("ochre", (0.1, 0.41, 0.71), (0.28, 0.43, 0.84), 10)
    scene.turned("white", (1.5, 0, 2.1), [(0, 0), (0.14, 0), (0.2, 0.36), (0.17, 0.36), (0.16, 0.3), (0, 0.3)])
    rng = random.Random(3)
    for i in range(26):
        turn, lean, length = rng.uniform(0, 6.28), rng.uniform(0.2, 0.9), rng.uniform(0.5, 0.95)
        side = (-math.sin(turn) * 0.035, math.cos(turn) * 0.035)
        mid = (1.5 + math.cos(turn) * lean * 0.2, 0.32 + length * 0.6, 2.1 + math.sin(turn) * lean * 0.2)
        tip = (1.5 + math.cos(turn) * lean * 0.45, 0.32 + length, 2.1 + math.sin(turn) * lean * 0.45)
        root = (1.5, 0.3, 2.1)
        scene.quad("leaf", root, (mid[0] + side[0], mid[1], mid[2] + side[1]), tip, (mid[0] - side[0], mid[1], mid[2] - side[1]))
    for x, material in ((-0.75, "teal"), (0.0, "ochre"), (0.7, "sofa")):
        scene.box("black", (x - 0.26, 1.25, 2.56), (x + 0.26, 1.85, 2.6))
        scene.box("white", (x - 0.24, 1.27, 2.555), (x + 0.24, 1.83, 2.57))
        scene.box(material, (x - 0.15, 1.37, 2.55), (x + 0.15, 1.73, 2.56))
    scene.write()


def corridor():
    scene = Scene("corridor", """
A corridor whose light enters by one small window at its end. Next event estimation aims at all of the bright yard behind it and
meets the wall, from nearly everywhere; a bounce finds the window from nearby alone, and one light sub-path in some thirty comes
in. The nearer the camera's end, the longer are the paths that matter and the fewer are in any cache.""",
                  (0.4, 1.4, -1.3), (-0.08, 1.2, 8), 50, 12)
    scene.matt("black", 0, 0, 0)
    scene.matt("wall", 0.78, 0.72, 0.6)
    scene.matt("trim", 0.8, 0.78, 0.72)
    scene.matt("end", 0.42, 0.28, 0.14)
    scene.matt("door", 0.1, 0.32, 0.26)
    scene.matt("rug", 0.62, 0.1, 0.07)
    scene.matt("border", 0.7, 0.52, 0.2)
    scene.checks("tiles", "coateddiffuse", 6, 36, (0.7, 0.68, 0.62), (0.16, 0.16, 0.18),
                 '"float roughness" [ 0.08 ] "bool remaproughness" false')
    scene.metal("brass", (0.88, 0.7, 0.38), 0.12)
    scene.glazed("pot", (0.12, 0.2, 0.45), 0.1)
    x, z0, z1, top = 1.1, -1.7, 8.6, 2.6
    scene.quad("tiles", (-x, 0, z0), (x, 0, z0), (x, 0, z1), (-x, 0, z1))
    for lo, hi in (((-x - 0.2, 0, z0), (-x, top, z1)), ((x, 0, z0), (x + 0.2, top, z1)), ((-x - 0.2, top, z0), (x + 0.2, top + 0.2, z1)),
                   ((-x - 0.2, 0, z0 - 0.2), (x + 0.2, top + 0.2, z0)), ((-x - 0.2, -0.2, z0 - 0.2), (x + 0.2, -0.05, z1 + 0.2))):
        scene.box("wall", lo, hi)
    scene.wall_with_hole("end", (-x - 0.2, -0.05, z1), (x + 0.2, top + 0.2, z1 + 0.2), (-0.35, 1.05), (0.35, 2.0), 0)
    scene.add('AttributeBegin\n  AreaLightSource "diffuse" "rgb L" [ 40 49 62 ]\n  NamedMaterial "black"')
    scene.quad(None, (-2.5, -0.2, z1 + 1.2), (-2.5, 3.2, z1 + 1.2), (2.5, 3.2, z1 + 1.2), (2.5, -0.2, z1 + 1.2))
    scene.add("AttributeEnd")
    scene.box("trim", (-0.02, 1.05, z1 + 0.08), (0.02, 2.0, z1 + 0.12))
    scene.box("trim", (-0.35, 1.6, z1 + 0.08), (0.35, 1.64, z1 + 0.12))
    scene.box("trim", (-0.45, 1.0, z1 - 0.12), (0.45, 1.05, z1 + 0.1))
    scene.box("border", (-0.62, 0, z0 + 0.5), (0.62, 0.008, z1 - 0.6))
    scene.box("rug", (-0.54, 0, z0 + 0.58), (0.54, 0.012, z1 - 0.68))
    # Arches on pilasters.
    for z in (0.6, 3.0, 5.4, 7.8):
        for side in (-1, 1):
            a, b = sorted((side * x, side * (x - 0.14)))
            scene.box("trim", (a, 0, z), (b, 1.75, z + 0.3))
            a, b = sorted((side * x, side * (x - 0.18)))
            scene.box("trim", (a, 1.75, z - 0.04), (b, 1.82, z + 0.34))
        steps, span = 14, x - 0.14
        curve = [(-span * math.cos(math.pi * i / steps), 1.82 + 0.62 * math.sin(math.pi * i / steps)) for i in range(steps + 1)]
        points, indices = [], []
        for px, py in curve:
            points += [(px, py, z), (px, py, z + 0.3), (px, top, z), (px, top, z + 0.3)]
        for i in range(steps):
            a, b = 4 * i, 4 * i + 4
            indices += [a, b, b + 1, a, b + 1, a + 1, a, a + 2, b + 2, a, b + 2, b, a + 1, b + 1, b + 3, a + 1, b + 3, a + 3]
        scene.mesh("trim", points, indices)
        for side in (-1, 1):
            a, b = sorted((side * x, side * span))
            scene.box("trim", (a, 1.82, z), (b, top, z + 0.3))
    # Doors between them, pots, a ball that somebody forgot.
    for i, z in enumerate((1.5, 3.9, 6.3)):
        for side in (-1, 1):
            if i == 1 and side == 1:
                continue
            a, b = sorted((side * x, side * (x - 0.03)))
            scene.box("trim", (a, 0, z - 0.08), (b, 2.03, z + 0.98))
            a, b = sorted((side * (x - 0.03), side * (x - 0.045)))
            scene.box("door", (a, 0.02, z), (b, 1.95, z + 0.9))
            scene.sphere("brass", (side * (x - 0.08), 0.98, z + 0.8), 0.03)
    scene.turned("pot", (0.86, 0, 4.4), scaled(VASE, 1.7))
    scene.sphere("border", (-0.3, 0.132, 1.9), 0.12)
    scene.write()


def one_lamp():
    scene = Scene("one-lamp", """
A larder by candle light, and 200 brighter lamps behind its wall. Who chooses lights by power sends one shadow ray in some
hundreds to the flame: `path` and `bdpt` waste the others, and nearly all light sub-paths start next door. A bounce finds the
flame, which is small, no better. `spcbpt` learns which light matters to which point, and still waits for sub-paths from the flame.""",
                  (0.05, 0.42, -1.4), (0.02, 0.2, 0.2), 34, 7)
    scene.matt("black", 0, 0, 0)
    scene.matt("wall", 0.62, 0.5, 0.4)
    scene.glazed("table", (0.32, 0.17, 0.08), 0.2)
    scene.matt("wax", 0.85, 0.78, 0.62)
    scene.metal("pewter", (0.62, 0.6, 0.56), 0.2)
    scene.metal("copper", (0.93, 0.56, 0.42), 0.15)
    scene.glazed("apple", (0.6, 0.06, 0.04), 0.1)
    scene.glazed("pear", (0.56, 0.56, 0.1), 0.2)
    scene.glazed("jug", (0.14, 0.3, 0.42), 0.08)
    scene.matt("bread", 0.56, 0.32, 0.13)
    scene.matt("cloth", 0.74, 0.72, 0.66)
    scene.matt("cheese", 0.85, 0.62, 0.2)
    x, top, z0, z1 = 1.5, 1.5, -1.9, 0.9
    scene.box("table", (-x, -0.04, -0.6), (x, 0, z1))
    scene.box("wall", (-x - 0.1, -0.9, z1), (x + 0.1, top, z1 + 0.1))
    scene.box("wall", (-x - 0.1, -0.9, z0 - 0.1), (x + 0.1, top, z0))
    scene.box("wall", (-x - 0.1, -0.9, z0), (-x, top, z1))
    scene.box("wall", (x, -0.9, z0), (x + 0.1, top, z1))
    scene.box("wall", (-x - 0.1, top, z0 - 0.1), (x + 0.1, top + 0.1, z1 + 0.1))
    scene.box("wall", (-x - 0.1, -1, z0 - 0.1), (x + 0.1, -0.9, z1 + 0.1))
    # The candle.
    c = (-0.16, 0, 0.12)
    scene.turned("pewter", c, [(0, 0), (0.09, 0), (0.1, 0.015), (0.03, 0.03), (0.02, 0.06), (0.035, 0.09), (0.036, 0.1), (0, 0.1)])
    scene.column("wax", (c[0], 0.1, c[2]), 0.02, 0.13, 9)
    scene.lamp((c[0], 0.257, c[2]), 0.012, 1500, 900, 380)
    # What there is to eat.
    scene.turned("jug", (-0.46, 0, 0.3), scaled(VASE, 1.25))
    scene.box("cloth", (-0.05, 0, -0.28), (0.55, 0.006, 0.3), 18)
    scene.turned("pewter", (0.28, 0.006, 0.02), PLATE)
    scene.sphere("apple", (0.22, 0.062, 0.02), 0.05)
    scene.sphere("apple", (0.33, 0.06, 0.06), 0.048)
    scene.turned("pear", (0.29, 0.014, -0.06), [(0, 0), (0.035, 0.005), (0.045, 0.04), (0.025, 0.085), (0.012, 0.105), (0, 0.11)], 6)
    scene.mesh("cheese", [(-0.36, 0, -0.18), (-0.12, 0, -0.2), (-0.24, 0, -0.06), (-0.36, 0.08, -0.18), (-0.12, 0.08, -0.2),
                          (-0.24, 0.08, -0.06)], [0, 1, 2, 3, 5, 4, 0, 3, 4, 0, 4, 1, 1, 4, 5, 1, 5, 2, 2, 5, 3, 2, 3, 0])
    scene.turned("copper", (0.62, 0, 0.45), [(0, 0), (0.13, 0), (0.145, 0.2), (0.14, 0.2), (0.12, 0.02), (0, 0.01)])
    scene.turned("bread", (0.02, 0, 0.5), [(0, 0), (0.14, 0), (0.17, 0.05), (0.12, 0.12), (0, 0.14)], 6)
    scene.box("table", (-1.1, 0.62, 0.72), (1.1, 0.65, 0.9))
    for i, px in enumerate((-0.62, -0.34, 0.28, 0.6)):
        scene.turned(("copper", "jug", "pear", "pewter")[i], (px, 0.65, 0.8), scaled(POT, 0.7), 6)
    # The lamps next door, in a hall of their own.
    scene.box("wall", (-5, -1, 6.2), (5, 4, 6.3))
    scene.box("wall", (-5, -1.1, 1.1), (5, -1, 6.2))
    scene.lamps([(-4.75 + 0.5 * i, 3, 1.6 + 0.45 * row) for row in range(10) for i in range(20)], 0.03, 300, 290, 270)
    scene.write()


def paperweight():
    scene = Scene("paperweight", """
A glass ball on a desk, and both once more in a mirror. The light that the ball gathers was refracted twice and is seen through
the mirror or the ball: specular, diffuse, specular. Only a camera path that hits the lamp's bulb by chance finds it, in every
algorithm here; beside the mirror, light sub-paths draw the same caustic without noise.""",
                  (0.28, 0.42, -0.95), (-0.02, 0.13, 0.2), 36, 9)
    scene.matt("black", 0, 0, 0)
    scene.matt("wall", 0.3, 0.4, 0.36)
    scene.matt("far", 0.62, 0.5, 0.34)
    scene.glazed("desk", (0.42, 0.24, 0.12), 0.2)
    scene.matt("paper", 0.84, 0.82, 0.76)
    scene.matt("red", 0.56, 0.08, 0.06)
    scene.matt("navy", 0.08, 0.12, 0.32)
    scene.matt("pages", 0.78, 0.72, 0.58)
    scene.metal("gilt", (0.88, 0.68, 0.32), 0.15)
    scene.define("mirror", "conductor", '"rgb reflectance" [ 0.93 0.93 0.92 ] "float roughness" [ 0 ]')
    scene.define("glass", "dielectric", '"float eta" [ 1.5 ]')
    scene.glazed("ink", (0.04, 0.05, 0.1), 0.02)
    scene.lamp((0.42, 0.62, 0.02), 0.012, 2200, 1820, 1270)
    scene.box("desk", (-1, -0.04, -0.5), (1, 0, 0.6))
    scene.quad("wall", (-2.5, -0.8, 0.6), (2.5, -0.8, 0.6), (2.5, 2, 0.6), (-2.5, 2, 0.6))
    scene.quad("far", (-2.5, -0.8, -2.4), (2.5, -0.8, -2.4), (2.5, 2, -2.4), (-2.5, 2, -2.4))
    scene.quad("far", (-2.5, -0.8, -2.4), (-2.5, -0.8, 0.6), (-2.5, 2, 0.6), (-2.5, 2, -2.4))
    scene.quad("far", (2.5, -0.8, -2.4), (2.5, -0.8, 0.6), (2.5, 2, 0.6), (2.5, 2, -2.4))
    scene.quad("paper", (-2.5, 2, -2.4), (2.5, 2, -2.4), (2.5, 2, 0.6), (-2.5, 2, 0.6))
    scene.quad("desk", (-2.5, -0.8, -2.4), (2.5, -0.8, -2.4), (2.5, -0.8, 0.6), (-2.5, -0.8, 0.6))
    # The mirror stands on the desk in a frame.
    scene.box("gilt", (-0.5, 0, 0.46), (0.36, 0.5, 0.5))
    scene.box("mirror", (-0.46, 0.04, 0.455), (0.32, 0.46, 0.465))
    scene.box("paper", (-0.34, 0, -0.2), (0.1, 0.003, 0.26), 12)
    scene.sphere("glass", (-0.1, 0.0835, 0.06), 0.08)
    scene.sphere("glass", (0.12, 0.0405, -0.1), 0.04)
    scene.box("red", (0.26, 0, 0.1), (0.5, 0.03, 0.4), -16)
    scene.box("pages", (0.262, 0.004, 0.095), (0.495, 0.026, 0.395), -16)
    scene.box("navy", (0.28, 0.03, 0.13), (0.49, 0.065, 0.39), -4)
    scene.turned("ink", (-0.4, 0, 0.2), [(0, 0), (0.06, 0), (0.06, 0.05), (0.025, 0.065), (0.025, 0.08), (0, 0.08)])
    scene.write()


if __name__ == "__main__":
    for write in (slit, glossy_lamps, ceiling_lamp, corridor, one_lamp, paperweight):
        write()
