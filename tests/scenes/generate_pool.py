#!/usr/bin/env python3
"""Writes pool.pbrt: a tiled pool under a small lamp, seen through its waves."""

import math

CELLS = 24
HALF = 2.0


def height(x, z):
    return 0.035 * math.sin(3.1 * x + 0.7 * z) + 0.025 * math.sin(2.3 * z - 1.9 * x + 1) + 0.012 * math.sin(4.2 * x + 4.1 * z)


def mesh():
    at = [-HALF + 2 * HALF * i / CELLS for i in range(CELLS + 1)]
    points = " ".join(f"{x:.3g} {height(x, z):.4f} {z:.3g}" for z in at for x in at)
    indices = []
    for j in range(CELLS):
        for i in range(CELLS):
            a = j * (CELLS + 1) + i
            indices += [a, a + CELLS + 2, a + 1, a, a + CELLS + 1, a + CELLS + 2]
    return f'Shape "trianglemesh" "integer indices" [ {" ".join(map(str, indices))} ]\n  "point3 P" [ {points} ]'


def wall(*corners):
    points = "  ".join(" ".join(f"{v:g}" for v in c) for c in corners)
    return (f'Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ {points} ]'
            ' "point2 uv" [ 0 0  1 0  1 1  0 1 ]')


def scene():
    h, deep, rim = HALF, -1.4, 0.35
    walls = [
        wall((-h, deep, h), (h, deep, h), (h, rim, h), (-h, rim, h)),
        wall((-h, deep, -h), (-h, deep, h), (-h, rim, h), (-h, rim, -h)),
        wall((h, deep, h), (h, deep, -h), (h, rim, -h), (h, rim, h)),
        wall((h, deep, -h), (-h, deep, -h), (-h, rim, -h), (h, rim, -h)),
    ]
    return "\n".join([
        "# pool -- our own scene, dedicated to the public domain (CC0); written by generate_pool.py.",
        "# A tiled pool at night under one small lamp. What lights its floor came through the waves, and is seen through them:",
        "# only a camera path that hits the lamp by chance finds it, and a job has to say so.",
        "LookAt 0.3 3.4 -3.9  0 -0.75 0.15  0 1 0",
        'Camera "perspective" "float fov" [ 42 ]',
        'Film "rgb" "integer xresolution" [ 320 ] "integer yresolution" [ 180 ] "string filename" "pool.exr"',
        'PixelFilter "box"',
        'Sampler "halton" "integer pixelsamples" [ 64 ]',
        'Integrator "bdpt" "integer maxdepth" [ 8 ]',
        "",
        "WorldBegin",
        "",
        "AttributeBegin",
        "  Translate 1.1 4.5 0.9",
        '  AreaLightSource "diffuse" "rgb L" [ 468000 414000 324000 ]',
        '  Material "diffuse" "rgb reflectance" [ 0 0 0 ]',
        '  Shape "sphere" "float radius" [ 0.01 ]',
        "AttributeEnd",
        'LightSource "infinite" "rgb L" [ 0.03 0.045 0.08 ]',
        "",
        'Texture "tiles" "spectrum" "checkerboard" "float uscale" [ 16 ] "float vscale" [ 16 ]'
        ' "rgb tex1" [ 0.62 0.74 0.76 ] "rgb tex2" [ 0.4 0.6 0.68 ]',
        'Texture "bands" "spectrum" "checkerboard" "float uscale" [ 16 ] "float vscale" [ 7 ]'
        ' "rgb tex1" [ 0.66 0.74 0.74 ] "rgb tex2" [ 0.5 0.64 0.68 ]',
        'Material "diffuse" "texture reflectance" "tiles"',
        wall((-h, deep, -h), (h, deep, -h), (h, deep, h), (-h, deep, h)),
        'Material "diffuse" "texture reflectance" "bands"',
        *walls,
        'Material "diffuse" "rgb reflectance" [ 0.55 0.5 0.44 ]',
        wall((-8, rim, h), (8, rim, h), (8, rim, 8), (-8, rim, 8)),
        wall((-8, rim, -8), (-h, rim, -8), (-h, rim, h), (-8, rim, h)),
        wall((h, rim, -8), (8, rim, -8), (8, rim, h), (h, rim, h)),
        wall((-h, rim, -8), (h, rim, -8), (h, rim, -h), (-h, rim, -h)),
        "AttributeBegin",
        "  Translate -0.75 -1.05 0.35",
        '  Material "diffuse" "rgb reflectance" [ 0.75 0.2 0.08 ]',
        '  Shape "sphere" "float radius" [ 0.35 ]',
        "AttributeEnd",
        'Material "dielectric" "float eta" [ 1.33 ]',
        mesh(),
    ]) + "\n"


if __name__ == "__main__":
    import pathlib

    pathlib.Path(__file__).with_name("pool.pbrt").write_text(scene())
