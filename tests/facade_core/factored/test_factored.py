"""Factored walls against what they are made from, and against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.labels import FacadeClass
from facade_core.core.linear_light import linear_to_srgb, smooth_known_light, srgb_to_linear
from facade_core.core.types import Element
from facade_core.export.bodies.mouldings import free_wall_mask, most_similar_band, split_wall_into_bands
from facade_core.export.factored.grain_similarity import find_representative_grains
from facade_core.export.factored.image_quilting import WallGrain, synthesise_grain
from facade_core.export.factored.library import FacadeLibrary, build_library
from facade_core.export.factored.settings import WALL_GRAINS
from facade_core.export.factored.texture_packing import MAX_TYPE_DENSITY, pack_textures, texture_memory_bytes
from facade_core.export.factored.units import group_elements_into_units
from facade_core.export.factored.wall_decomposition import StoredFacadeWall, WallDecomposition
from facade_core.export.factored.wall_geometry import (
    FAR_DETAIL,
    NEAR_DETAIL,
    WallDetailLevel,
    WallPiece,
    WallPieces,
    WallPolygon,
    build_wall,
    is_planar_and_valid,
)
from facade_core.geometry.charts import ChartKind, Charts

DENSITY = 32.0


def painted() -> tuple[np.ndarray, np.ndarray, list[Element]]:
    """A wall 8 m wide and 9.5 m high: plaster over a course over stone, six windows, the first of which has a balcony."""
    rng = np.random.default_rng(3)
    image = np.full((304, 256, 3), (190, 170, 140), np.float64)
    image[200:208] = 235
    image[208:] = (90, 95, 100)
    image += rng.normal(0, 4, image.shape[:2])[..., None]
    labels = np.zeros(image.shape[:2], np.uint8)
    elements = []
    for row in range(2):
        for column in range(3):
            x, y = 30 + 76 * column, 30 + 90 * row
            image[y : y + 56, x : x + 40] = (60, 70, 90) if (row + column) % 2 else (150, 130, 100)
            image[y + 26 : y + 30, x : x + 40] = 240
            labels[y : y + 56, x : x + 40] = FacadeClass.WINDOW
            elements.append(Element("window", x, y, x + 40, y + 56))
    image[66:90, 26:74], labels[66:90, 26:74] = (120, 120, 122), FacadeClass.BALCONY
    elements.append(Element("balcony", 26, 66, 74, 90))
    return np.clip(image, 0, 255).astype(np.uint8), labels, elements


@pytest.fixture(scope="module")
def library() -> FacadeLibrary:
    image, labels, elements = painted()
    fine = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)
    return build_library(image, labels, elements, DENSITY, fine, seed=1)


def facade() -> StoredFacadeWall:
    image, labels, elements = painted()
    return StoredFacadeWall(0, image, linear_to_srgb(0.6 * srgb_to_linear(image)), labels, elements, DENSITY)


def laid(library: FacadeLibrary, detail: WallDetailLevel = NEAR_DETAIL) -> tuple[WallPieces, WallPolygon]:
    """The wall, that stands on x to the east and looks south, under six tenths of its light."""
    charts = Charts(
        np.array([ChartKind.WALL], np.uint8),
        np.zeros(1, np.int32),
        np.zeros(1, np.int32),
        np.array([[0.0, 0.0, 9.5]]),
        np.array([[1.0, 0.0, 0.0]]),
        np.array([[0.0, 0.0, -1.0]]),
        np.array([[8.0, 9.5]]),
    )
    outline = shapely.orient_polygons(shapely.box(0, 0, 8, 9.5), exterior_cw=True)
    plane = WallPolygon(outline, charts.points(0, np.array([0, 8, 8, 0.0]), np.array([0, 0, 9.5, 9.5])))
    pieces = WallPieces()
    build_wall(WallDecomposition(facade(), library), [plane], charts, 0, detail, [], pieces)
    return pieces, plane


def area(piece: WallPiece) -> float:
    a, b, c = (piece.position[piece.triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_light_goes_there_and_back() -> None:
    every = np.arange(256, dtype=np.uint8)
    assert (linear_to_srgb(srgb_to_linear(every)) == every).all()


def test_a_mean_over_what_is_known_is_that_of_a_loop() -> None:
    rng = np.random.default_rng(0)
    light, known = rng.random((20, 24, 3)).astype(np.float32), rng.random((20, 24)) < 0.6
    found = smooth_known_light(light, known, 1.5)
    for y, x in ((10, 12), (8, 15)):
        rows, columns = np.mgrid[:20, :24]
        weight = np.exp(-((rows - y) ** 2 + (columns - x) ** 2) / (2 * 1.5**2)) * known
        assert found[y, x] == pytest.approx((light * weight[..., None]).sum(axis=(0, 1)) / weight.sum(), abs=0.02)


def test_a_window_and_its_balcony_are_one_unit_that_lies_back_above_the_balcony() -> None:
    _, _, elements = painted()
    units = group_elements_into_units(elements, DENSITY)
    assert [unit.kind for unit in units].count("window") == 5
    (balcony,) = (unit for unit in units if unit.kind == "balcony")
    assert balcony.box == pytest.approx((26 / 32, 30 / 32, 74 / 32, 90 / 32))
    ((_, top, _, foot),) = balcony.panes
    assert (top, foot) == pytest.approx((30 / 32, 66 / 32))


def test_bands_are_what_was_painted() -> None:
    image, labels, elements = painted()
    free = free_wall_mask(labels, [unit.box for unit in group_elements_into_units(elements, DENSITY)], DENSITY)
    bands = split_wall_into_bands(image, free, DENSITY)
    assert [band.is_moulding for band in bands] == [False, True, False]
    assert [band.top for band in bands] == pytest.approx([0, 200 / 32, 208 / 32], abs=0.1)
    assert bands[-1].foot == pytest.approx(9.5)
    assert [most_similar_band(band, bands) for band in bands] == [0, 1, 2]


def test_grain_goes_on_into_itself_and_has_no_shade() -> None:
    rng = np.random.default_rng(5)
    shade = np.linspace(80, 200, 300)[None, :, None]
    image = np.clip(shade + rng.normal(0, 12, (200, 300, 1)), 0, 255).repeat(3, axis=2).astype(np.uint8)
    found = synthesise_grain(image, np.ones((200, 300), bool), 64.0, 7)
    grain, side = found.relative_light, WALL_GRAINS.texture_sides_px[-1]
    assert grain.shape == (side, side, 3)
    assert found.width_m == pytest.approx(side / 64)
    assert grain.mean(axis=(0, 1)) == pytest.approx(1, abs=1e-3)
    inner, over = (
        np.abs(np.diff(np.pad(grain, [(0, 0), (0, 1), (0, 0)], "wrap"), axis=1)).mean(axis=(0, 2)) for _ in (0, 1)
    )
    assert over[-1] < 1.5 * inner[:-1].mean(), "the last column beside the first is like any two"
    assert np.abs(smooth_known_light(grain, np.ones((side, side), bool), 30.0, wrap=True) - 1).max() < 0.05
    assert (grain == synthesise_grain(image, np.ones((200, 300), bool), 64.0, 7).relative_light).all()


def courses(density: float, every_m: float, seed: int = 0) -> np.ndarray:
    """A wall (h, w, 3) of 8 m of courses with dark joints."""
    side = round(8 * density)
    rng = np.random.default_rng(seed)
    image = 160 + rng.normal(0, 3, (side, side, 1))
    image[(np.arange(side) / density) % every_m < 0.03] -= 60
    return np.clip(image, 0, 255).astype(np.uint8).repeat(3, axis=2)


@pytest.mark.parametrize("density", [64.0, 32.0, 28.0, 16.0])
def test_courses_keep_their_height_at_any_density(density: float) -> None:
    every = 0.5
    found = synthesise_grain(courses(density, every), np.ones((round(8 * density),) * 2, bool), density, 3)
    dark = found.relative_light.mean(axis=(1, 2)) < 0.85
    starts = np.flatnonzero(dark & ~np.roll(dark, 1))
    assert len(starts) == pytest.approx(found.width_m / every, abs=1.01), "but for one where the picture meets itself"


def test_grain_of_no_room_is_even() -> None:
    assert (synthesise_grain(np.zeros((9, 9, 3), np.uint8), np.ones((9, 9), bool), 64.0, 7).relative_light == 1).all()


def test_grains_of_one_material_are_one_and_the_evenest_of_the_finest_stands_for_them() -> None:
    def grain(density: float, every: float, seed: int) -> WallGrain:
        return synthesise_grain(courses(density, every, seed), np.ones((round(8 * density),) * 2, bool), density, seed)

    marked = grain(64, 0.5, 1)
    marked.relative_light[40:60, 30:50] *= 0.4
    plain = WallGrain(1 + np.random.default_rng(4).normal(0, 0.004, (128, 128, 3)).astype(np.float32), 4.0)
    found = find_representative_grains([marked, grain(32, 0.5, 2), grain(64, 0.5, 3), grain(64, 0.125, 4), plain])
    assert found[:3] == [2, 2, 2]
    assert found[3:] == [3, 4], "courses of another height, and plaster, are others"
    assert find_representative_grains([]) == []


def test_types_have_the_pixels_of_the_finer_picture_and_fewer_at_later_levels(library: FacadeLibrary) -> None:
    assert len(library.units) == 6
    for kind in library.types.values():
        width = kind.box[2] - kind.box[0]
        assert kind.pixels_per_metre == 2 * DENSITY
        assert width in (80, 96)
    numbers = [len(np.unique(row)) for row in library.unit_types]
    assert numbers == sorted(numbers, reverse=True)
    assert set(np.unique(library.unit_types).tolist()) <= set(library.types)


def test_a_wall_is_covered_once_and_its_panes_lie_back(library: FacadeLibrary) -> None:
    pieces, _ = laid(library)
    upright = depth = 0.0
    for key, own in pieces.by_picture.items():
        for piece in own:
            facing = np.allclose(piece.normal, [0, -1, 0])
            upright += area(piece) if facing else 0.0
            if key[0] == "type":
                depth = max(depth, float(piece.position[:, 1].max()))
            a, b, c = (piece.position[piece.triangles[:, k]] for k in range(3))
            assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), piece.normal[piece.triangles[:, 0]]) > 0).all()
    assert upright == pytest.approx(8 * 9.5, rel=1e-4)
    assert depth == pytest.approx(0.15)
    assert len(pieces.elements) == 6


def test_from_afar_a_wall_is_flat_of_fewer_triangles_and_its_pictures_are_those_of_near(library: FacadeLibrary) -> None:
    (near, _), (far, _) = laid(library), laid(library, FAR_DETAIL)
    triangles = [sum(len(piece.triangles) for own in one.by_picture.values() for piece in own) for one in (near, far)]
    assert triangles[1] < triangles[0] / 2
    covered = sum(area(piece) for own in far.by_picture.values() for piece in own)
    assert covered == pytest.approx(8 * 9.5, rel=1e-4)
    assert all(np.allclose(piece.position[:, 1], 0) for own in far.by_picture.values() for piece in own)
    types = [{key for key in one.by_picture if key[0] == "type"} for one in (near, far)]
    assert types[1] <= types[0]
    assert len(types[1]) < len(types[0])


def test_pictures_times_light_are_the_wall(library: FacadeLibrary) -> None:
    pieces, _ = laid(library)
    shown = pack_textures(pieces, [library])
    means = []
    for key, own in pieces.by_picture.items():
        for piece in own:
            texture, uv, colour = shown.texture_lookup(key, piece)
            assert colour.max() <= 1
            assert shown.is_repeated[texture] == (key[0] == "grain")
            if not shown.is_repeated[texture]:
                assert (uv >= 0).all()
                assert (uv <= 1 + 1e-9).all()
            elif np.allclose(piece.normal, [0, -1, 0]):
                light = srgb_to_linear(shown.pictures[texture]).mean(axis=(0, 1)) * colour
                means += [light[piece.position[:, 2] > 4]]
    wall = np.concatenate([part for part in means if len(part)]).mean(axis=0)
    assert linear_to_srgb(wall).astype(int) == pytest.approx(
        linear_to_srgb(0.6 * srgb_to_linear(np.array([190, 170, 140], np.uint8))).astype(int), abs=6
    )


def test_no_element_keeps_more_texels_than_are_shown(library: FacadeLibrary) -> None:
    pieces, _ = laid(library)
    near = WallPieces(pieces.by_picture, [(key, 2 * MAX_TYPE_DENSITY) for key, _ in pieces.elements])
    whole, half = pack_textures(pieces, [library]), pack_textures(near, [library])
    assert set(whole.scale.values()) == {1.0}, "64 a metre is what the finer picture has"
    assert set(half.scale.values()) == {0.5}
    assert texture_memory_bytes(
        [p for p, again in zip(half.pictures, half.is_repeated, strict=True) if not again]
    ) < texture_memory_bytes(whole.pictures)
    key = pieces.elements[0][0]
    piece = pieces.by_picture[key][0]
    spans = [
        np.ptp(shown.texture_lookup(key, piece)[1], axis=0) * shown.pictures[shown.placement[key][0]].shape[1::-1]
        for shown in (whole, half)
    ]
    assert spans[1] == pytest.approx(spans[0] / 2, abs=1)


def test_the_same_wall_is_laid_the_same(library: FacadeLibrary) -> None:
    (one, _), (other, _) = laid(library), laid(library)
    for key, own in one.by_picture.items():
        for a, b in zip(own, other.by_picture[key], strict=True):
            assert all((x == y).all() for x, y in zip(a[:5], b[:5], strict=True))


def test_a_bent_wall_is_not_flat() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0.2, 1], [0, 0, 1.0]])
    assert not is_planar_and_valid(WallPolygon(shapely.box(0, 0, 1, 1), corners))
    assert is_planar_and_valid(WallPolygon(shapely.box(0, 0, 1, 1), corners * [1, 0, 1]))
