"""Models of street objects: procedural meshes of at most 850 triangles with colours of vertices.

x runs along the front, y ahead of it, z up, in metres around the middle of the foot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.linear_light import srgb_to_linear
from facade_core.core.street_objects import ObjectKind, PlacedObjects, heading_axes

Colour = tuple[int, int, int]
_BARK, _STEEL, _DARK, _WOOD, _GLASS, _RUBBER = (
    (92, 76, 62), (88, 92, 96), (52, 55, 58), (134, 100, 66), (150, 166, 172), (38, 38, 40)
)  # fmt: skip
_LAMP = (236, 230, 208)
_LEAVES: tuple[Colour, ...] = ((88, 108, 56), (104, 120, 64), (74, 98, 52), (112, 118, 58))
_NEEDLES: tuple[Colour, ...] = ((52, 76, 52), (62, 84, 58))
_PAINTS: tuple[Colour, ...] = ((150, 154, 160), (54, 62, 78), (132, 42, 38))
# Light of the sky on a surface that faces up, to the side and down: what unlit models show of it.
_SKY_LIGHT = (1.0, 0.78, 0.5)


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """Triangles of a model.

    Attributes
    ----------
    position : (v, 3) metres.
    normal : (v, 3) outward unit vectors.
    colour : (v, 3) linear, 0 to 1.
    triangles : (t, 3) vertex indices, counter-clockwise as seen from outside.
    """

    position: Float64Array
    normal: Float64Array
    colour: Float64Array
    triangles: Int64Array


# Triangles (t, 3, 3) with normals (t, 3, 3) and their colour, or colours of corners (t, 3, 3), 0 to 255.
_Part = tuple[Float64Array, Float64Array, Colour | Float64Array]


@lru_cache(maxsize=64)
def build_object_model(kind: ObjectKind, variant: int) -> ObjectModel:
    """Build a variant of the model of a kind, of its usual size."""
    parts = _BUILDERS[kind.name](kind, variant)
    corners = np.concatenate([part[0] for part in parts]).reshape(-1, 3)
    normals = np.concatenate([part[1] for part in parts]).reshape(-1, 3)
    paints = np.concatenate([np.broadcast_to(colour, part.shape) for part, _, colour in parts]).reshape(-1, 3)
    colours = srgb_to_linear(np.clip(paints, 0, 255).astype(np.uint8)).astype(np.float64)
    rows = np.round(np.column_stack([corners, normals, colours * sky_light(normals)[:, None]]), 5)
    unique, index = np.unique(rows, axis=0, return_inverse=True)
    return ObjectModel(unique[:, :3], unique[:, 3:6], unique[:, 6:], index.reshape(-1, 3).astype(np.int64))


def place_model(model: ObjectModel, placed: PlacedObjects, kind: ObjectKind, rows: Int32Array) -> Float64Array:
    """Return the points (n, v, 3) of a model as the objects of some rows (n,) of its kind have them, world metres."""
    points = model.position * (placed.size[rows] / kind.size)[:, None]
    placed_points: Float64Array = points @ heading_axes(placed.heading[rows]) + placed.position[rows, None]
    return placed_points


def sky_light(normals: Float64Array) -> Float64Array:
    """Return the share of the sky's light (n,) on surfaces of some normals (n, 3)."""
    up, side, down = _SKY_LIGHT
    light: Float64Array = side + np.where(normals[:, 2] > 0, up - side, side - down) * normals[:, 2]
    return light


def _flat(triangles: Float64Array, colour: Colour) -> _Part:
    """Return triangles (t, 3, 3) with the normals of their planes."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return triangles, np.repeat(normal[:, None], 3, axis=1), colour


def _box(low: Sequence[float], high: Sequence[float], colour: Colour, taper: float = 0.0) -> _Part:
    """Return a box; its top is narrower by `taper` on each side."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    t = taper
    foot = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]
    top = [(x0 + t, y0 + t, z1), (x1 - t, y0 + t, z1), (x1 - t, y1 - t, z1), (x0 + t, y1 - t, z1)]
    corners = np.array(foot + top)
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return _flat(corners[np.array([(f[0], *pair) for f in faces for pair in (f[1:3], f[2:4])])], colour)


def _tube(foot: Sequence[float], top: Sequence[float], radii: tuple[float, float], sides: int, colour: Colour) -> _Part:
    """Return a closed tapered tube between two points."""
    a, b = np.array(foot, float), np.array(top, float)
    axis = (b - a) / np.linalg.norm(b - a)
    right = np.cross(axis, (0.0, 1.0, 0.0) if abs(axis[1]) < 0.9 else (1.0, 0.0, 0.0))
    right /= np.linalg.norm(right)
    turn = 2 * np.pi * np.arange(sides) / sides
    round_ = np.outer(np.cos(turn), right) + np.outer(np.sin(turn), np.cross(axis, right))
    low, high = a + radii[0] * round_, b + radii[1] * round_
    after = np.roll(np.arange(sides), -1)
    faces = [np.stack([low, low[after], high[after]], 1), np.stack([low, high[after], high], 1)]
    faces.append(np.stack([np.broadcast_to(b, high.shape), high, high[after]], 1))
    return _flat(np.concatenate(faces), colour)


def _leaves(points: Float64Array, out: Float64Array, side: float, colour: Colour, seed: int) -> _Part:
    """Return pieces of leaves at points (n, 3) that look about outward (n, 3), lighter above."""
    random = np.random.default_rng(seed)
    tilt = _unit(out + 0.8 * _unit(random.normal(size=out.shape)))
    right = _unit(np.cross(tilt, random.normal(size=out.shape)))
    up = np.cross(tilt, right)
    reach = side * random.uniform(0.4, 0.75, (len(points), 1))
    pieces = np.stack([points + reach * (np.cos(a) * right + np.sin(a) * up) for a in 2 * np.pi / 3 * np.arange(3)], 1)
    return _tint(pieces, np.repeat(out[:, None], 3, axis=1), colour, 0.16 * random.random((len(points), 1, 1)))


def _tint(
    triangles: Float64Array, normals: Float64Array, colour: Colour | Float64Array, lighter: Float64Array | float
) -> _Part:
    """Return leaves (t, 3, 3) whose colours are darker below."""
    low, high = triangles[..., 2].min(), triangles[..., 2].max()
    return triangles, normals, np.array(colour) * (0.66 + 0.4 * (triangles[..., 2:] - low) / (high - low) + lighter)


def _unit(vectors: Float64Array) -> Float64Array:
    units: Float64Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return units


@lru_cache(maxsize=1)
def _icosahedron() -> Float64Array:
    """Return the triangles (20, 3, 3) of an icosahedron of radius 1."""
    g = (1 + 5**0.5) / 2
    points = _unit(np.array([np.roll((a, b * g, 0.0), k) for k in range(3) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]))
    near = np.linalg.norm(points[:, None] - points, axis=2) < 1.1
    faces = [
        [i, j, k] for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = points[faces]
    is_inward = np.linalg.det(triangles) < 0
    triangles[is_inward] = triangles[is_inward][:, ::-1]
    return triangles


def _crown(lobes: Float64Array, leaves: int, side: float, colour: Colour, seed: int) -> list[_Part]:
    """Return a crown of lobes (n, 6), their middles and radii: dark ones within, around them pieces of leaves."""
    own = np.arange(9 * leaves) % len(lobes)
    # an even sequence (Roberts 2018): no lobe is bare anywhere
    up, turn, depth = np.outer([0.819173, 0.671044, 0.549700], np.arange(len(own)) // len(lobes) + seed + 0.5) % 1
    level, turn = np.sqrt(1 - (2 * up - 1) ** 2), 2 * np.pi * turn
    out = np.column_stack([level * np.cos(turn), level * np.sin(turn), 2 * up - 1])
    points = lobes[own, :3] + lobes[own, 3:] * out * (0.85 + 0.15 * depth[:, None])
    apart = np.linalg.norm((points[:, None] - lobes[:, :3]) / lobes[:, 3:], axis=2)
    seen = np.flatnonzero((apart > 0.84).all(axis=1))[:leaves]
    sphere = _icosahedron()
    within = 0.84 * lobes[:, None, None, 3:] * sphere + lobes[:, None, None, :3]
    normals = np.broadcast_to(sphere, within.shape)
    dark = _tint(within.reshape(-1, 3, 3), normals.reshape(-1, 3, 3), colour, -0.15)
    return [dark, _leaves(points[seen], _unit(out[seen] / lobes[own[seen], 3:]), side, colour, seed)]


def _tree(kind: ObjectKind, variant: int) -> list[_Part]:
    """Return a trunk with branches under a crown of lobes."""
    random = np.random.default_rng(100 + variant)
    width, _, height = kind.size
    crown_foot = (0.28, 0.22, 0.33, 0.25)[variant]
    middle, half = height * (1 + crown_foot) / 2, height * (1 - crown_foot) / 2
    parts = [_tube((0, 0, 0), (0.05, 0.0, middle), (0.022 * height, 0.010 * height), 6, _BARK)]
    lobes = [(0, 0, height - 0.52 * half, 0.27 * width, 0.27 * width, 0.46 * half)]
    count = 5 + variant % 2
    turns = 2 * np.pi * (random.random() + np.arange(count) / count)
    for turn in turns.tolist():
        reach, radius = width * random.uniform(0.2, 0.26), width * random.uniform(0.17, 0.21)
        place = (reach * np.cos(turn), reach * np.sin(turn), middle + half * random.uniform(-0.45, 0.2))
        lobes.append((*place, radius, radius, half * random.uniform(0.36, 0.5)))
        parts.append(_tube((0, 0, 0.8 * crown_foot * height), place, (0.010 * height, 0.004 * height), 3, _BARK))
    return [*parts, *_crown(np.array(lobes), 600, 0.098 * width, _LEAVES[variant], 10 * variant)]


def _conifer(kind: ObjectKind, variant: int) -> list[_Part]:
    """Return a trunk with layers of needles."""
    random = np.random.default_rng(200 + variant)
    width, _, height = kind.size
    parts = [_tube((0, 0, 0), (0, 0, 0.4 * height), (0.018 * height, 0.012 * height), 6, _BARK)]
    dark = _tube((0, 0, 0.14 * height), (0, 0, 0.97 * height), (0.32 * width, 0.02), 9, _NEEDLES[variant])
    share, turn = 1 - np.sqrt(random.random(480)), 2 * np.pi * random.random(480)
    # whorls of branches
    radius = (width / 2 - 0.35) * (1 - share) * (0.72 + 0.28 * np.abs(np.sin((5 + variant) * np.pi * share)))
    around = np.column_stack([np.cos(turn), np.sin(turn), np.full(len(turn), 0.35)])
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height * (0.12 + 0.84 * share)])
    return [*parts, _tint(*dark, -0.15), _leaves(points, _unit(around), 0.13 * width, _NEEDLES[variant], 200 + variant)]


def _street_lamp(kind: ObjectKind, variant: int) -> list[_Part]:
    _, reach, height = kind.size
    return [
        _tube((0, 0, 0), (0, 0, 0.9), (0.1, 0.09), 8, _STEEL),
        _tube((0, 0, 0.9), (0, 0, height - 0.3), (0.065, 0.045), 8, _STEEL),
        _tube((0, 0, height - 0.32), (0, reach - 0.45, height - 0.08), (0.04, 0.03), 6, _STEEL),
        _box((-0.14, reach - 0.6, height - 0.1), (0.14, reach, height), _STEEL, 0.03),
        _box((-0.1, reach - 0.55, height - 0.13), (0.1, reach - 0.06, height - 0.1), _LAMP),
    ]


def _catenary_mast(kind: ObjectKind, variant: int) -> list[_Part]:
    _, reach, height = kind.size
    arm = height - 1.2
    return [
        _tube((0, 0, 0), (0, 0, height), (0.12, 0.08), 8, _STEEL),
        _tube((0, 0, arm), (0, reach, arm), (0.04, 0.03), 6, _STEEL),
        _tube((0, 0, height - 0.2), (0, 0.8 * reach, arm), (0.015, 0.015), 3, _STEEL),
    ]


def _tram_wire(kind: ObjectKind, variant: int) -> list[_Part]:
    half, thick, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    return [_box((-half, -thick, height - 2 * thick), (half, thick, height), _DARK)]


def _bench(kind: ObjectKind, variant: int) -> list[_Part]:
    half, depth, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    parts = []
    for k in range(4):
        y = -depth + 0.12 + 0.13 * k
        parts.append(_box((-half, y, 0.42), (half, y + 0.11, 0.46), _WOOD))
    parts += [_box((-half, -depth, z), (half, -depth + 0.04, z + 0.11), _WOOD) for z in (0.55, 0.7)]
    for x in (-half + 0.15, half - 0.23):
        parts.append(_box((x, -depth + 0.02, 0), (x + 0.08, -depth + 0.08, height), _DARK))
        parts.append(_box((x, depth - 0.1, 0), (x + 0.08, depth - 0.04, 0.42), _DARK))
    return parts


def _bollard(kind: ObjectKind, variant: int) -> list[_Part]:
    radius, height = kind.size[0] / 2, kind.size[2]
    return [
        _tube((0, 0, 0), (0, 0, 0.82 * height), (radius, 0.8 * radius), 10, _DARK),
        _tube((0, 0, 0.82 * height), (0, 0, height), (0.95 * radius, 0.5 * radius), 10, _DARK),
    ]


def _waste_basket(kind: ObjectKind, variant: int) -> list[_Part]:
    half, height = kind.size[0] / 2, kind.size[2]
    return [
        _tube((0, 0, 0), (0, 0, 0.3), (0.06, 0.06), 8, _STEEL),
        _tube((0, 0, 0.25), (0, 0, height - 0.12), (0.8 * half, half), 12, _DARK),
        _tube((0, 0, height - 0.1), (0, 0, height), (half, 0.6 * half), 12, _STEEL),
    ]


def _bicycle_stand(kind: ObjectKind, variant: int) -> list[_Part]:
    half, depth, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    parts = []
    for x in np.linspace(-half + 0.1, half - 0.1, 4).tolist():
        for y in (-depth + 0.05, depth - 0.05):
            parts.append(_tube((x, y, 0), (x, y, height - 0.05), (0.025, 0.025), 6, _STEEL))
        parts.append(_tube((x, -depth, height - 0.05), (x, depth, height - 0.05), (0.025, 0.025), 6, _STEEL))
    return parts


def _shelter(kind: ObjectKind, variant: int) -> list[_Part]:
    half, depth, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    posts = [(x, y) for x in (-half + 0.1, half - 0.1) for y in (-depth + 0.08, depth - 0.2)]
    return [
        *(_tube((x, y, 0), (x, y, height - 0.12), (0.045, 0.045), 6, _STEEL) for x, y in posts),
        _box((-half, -depth, height - 0.14), (half, depth, height), _STEEL, 0.04),
        _box((-half + 0.12, -depth + 0.06, 0.25), (half - 0.12, -depth + 0.1, height - 0.3), _GLASS),
        _box((-half + 0.5, -depth + 0.14, 0.42), (half - 0.5, -depth + 0.5, 0.47), _WOOD),
    ]


def _parked_car(kind: ObjectKind, variant: int) -> list[_Part]:
    half, depth, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    paint = _PAINTS[variant]
    cabin_front = depth - 1.35
    parts = [
        _box((-half, -depth, 0.3), (half, depth, 0.62), paint),
        _box((-half, -depth, 0.62), (half, depth, 0.9), paint, 0.07),
        _box((-half + 0.08, -depth + 0.35, 0.88), (half - 0.08, cabin_front, height - 0.06), _DARK, 0.28),
        _box((-half + 0.35, -depth + 0.62, height - 0.07), (half - 0.35, cabin_front - 0.27, height), paint, 0.04),
        _box((-half + 0.1, depth - 0.02, 0.62), (half - 0.1, depth + 0.01, 0.74), _LAMP),
    ]
    for x in (-half - 0.01, half - 0.2):
        for y in (-depth + 0.8, depth - 0.8):
            parts.append(_tube((x, y, 0.31), (x + 0.21, y, 0.31), (0.31, 0.31), 10, _RUBBER))
            parts.append(_tube((x + 0.21, y, 0.31), (x, y, 0.31), (0.3, 0.3), 10, _RUBBER))
    return parts


def _fence(kind: ObjectKind, variant: int) -> list[_Part]:
    half, depth, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    parts = [_box((-half, -depth / 2, z), (half, depth / 2, z + 0.05), _DARK) for z in (0.12, height - 0.1)]
    parts.append(_box((-half, -depth, 0), (-half + 0.08, depth, height), _DARK))
    for x in np.linspace(-half + 0.2, half - 0.12, 10).tolist():
        parts.append(_box((x, -0.011, 0.1), (x + 0.022, 0.011, height - 0.06), _DARK))
    return parts


def _hedge(kind: ObjectKind, variant: int) -> list[_Part]:
    """Return a hedge whose ends meet those of its neighbours: a block under leaves."""
    half, depth, height = kind.size[0] / 2, kind.size[1] / 2, kind.size[2]
    colour = _LEAVES[2 * variant]
    triangles, normals, _ = _box((-half, -0.8 * depth, 0), (half, 0.8 * depth, 0.9 * height), colour)
    along, share, place = np.random.default_rng(300 + variant).random((3, 480))
    side = np.where(place < 0.3, 2 * share - 1, np.where(place < 0.65, -1.0, 1.0))  # of the top, and of two sides
    up = np.where(place < 0.3, 0.92, 0.1 + 0.8 * share)
    out = _unit(np.column_stack([0 * side, np.where(place < 0.3, 0, side), np.where(place < 0.3, 1, 0.3)]))
    points = np.column_stack([(2 * along - 1) * 0.95 * half, 0.86 * depth * side, up * height])
    leaves = _leaves(points, out, 0.18, colour, variant)
    return [_tint(triangles, normals, colour, -0.08), leaves]


_BUILDERS: Mapping[str, Callable[[ObjectKind, int], list[_Part]]] = {
    "tree": _tree,
    "conifer": _conifer,
    "street_lamp": _street_lamp,
    "bench": _bench,
    "bollard": _bollard,
    "waste_basket": _waste_basket,
    "bicycle_stand": _bicycle_stand,
    "shelter": _shelter,
    "parked_car": _parked_car,
    "fence": _fence,
    "hedge": _hedge,
    "catenary_mast": _catenary_mast,
    "tram_wire": _tram_wire,
}
