"""Maps of light from labels and materials, against plain references; the same bits whenever they are asked for."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.materials.plain import camera_tones
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import GroundWay, MappedGround, Sun
from facade_core.export.lighting.albedo import divide_light, estimate_shading
from facade_core.export.lighting.ground_materials import GroundMaterialOutlines
from facade_core.export.lighting.height_maps import cavity_visibility, estimate_heights, normals_from_heights
from facade_core.export.lighting.panes import SeededRandom, find_openings, glass_mask, opening_emission
from facade_core.export.lighting.pbr_materials import ROUGHNESS, PbrMaterialClass
from facade_core.export.lighting.relighting import RelightingInputs, StoredChartTexels, build_relightable_mesh
from facade_core.export.lighting.settings import HEIGHT_MAPS
from facade_core.export.models.encoders import ENCODERS
from facade_core.export.models.glb import encode_glb
from facade_core.export.models.gltf_materials import NIGHT, TimeOfDay, encode_textures
from facade_core.export.models.settings import GLTF_MATERIALS
from facade_core.export.models.textured_mesh import (
    TexturedMesh,
    build_nodes,
    draw_page_images,
    mesh_y_up_frame,
    pack_charts_on_pages,
)
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.light import SceneLight
from facade_core.street.materials import field_kernels as field
from facade_core.street.materials.settings import RELIEF
from tests.facade_core.export.conftest import STREET, colour_of

DENSITY = 10.0
SUN = Sun(160.0, 40.0)


def facade(windows: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """A wall of 12 x 9 m at 20 texels a metre with rows of windows with a bright bar, its colour and labels."""
    labels = np.full((180, 240), FacadeClass.WALL, np.uint8)
    colour = np.full((180, 240, 3), 170, np.uint8)
    for k in range(windows):
        row, column = divmod(k, 4)
        y, x = 15 + 60 * row, 20 + 60 * column
        labels[y : y + 30, x : x + 24] = FacadeClass.WINDOW
        colour[y : y + 30, x : x + 24] = 50
        colour[y : y + 30, x + 11 : x + 13] = 220
    return colour, labels


def test_normals_are_those_of_the_heights_differences() -> None:
    height = np.random.default_rng(2).normal(0, 0.02, (9, 7)).astype(np.float32)
    found = normals_from_heights(height, DENSITY)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-6)
    for y in range(1, 8):
        for x in range(1, 6):
            right = (height[y, x + 1] - height[y, x - 1]) * DENSITY / 2
            up = (height[y - 1, x] - height[y + 1, x]) * DENSITY / 2
            slope = np.clip([right, up], -HEIGHT_MAPS.max_slope, HEIGHT_MAPS.max_slope)
            expected = np.array([-slope[0], -slope[1], 1]) / np.sqrt(1 + (slope**2).sum())
            np.testing.assert_allclose(found[y, x], expected, atol=1e-6)


def test_openings_lie_back_and_see_less_sky() -> None:
    colour, labels = facade()
    height = estimate_heights(
        labels, np.full(labels.shape, PbrMaterialClass.PLASTER), np.full(labels.shape, 90, np.float32), labels < 0, 20.0
    )
    assert height[30, 30] == pytest.approx(-RELIEF.opening_depth_m)
    assert height[0, 0] == 0
    built = estimate_heights(
        labels,
        np.full(labels.shape, PbrMaterialClass.PLASTER),
        np.full(labels.shape, 90, np.float32),
        labels < 0,
        20.0,
        has_relief=True,
    )
    np.testing.assert_array_equal(built, np.maximum(height, 0), "geometry sets openings back, and no map does it again")
    found = normals_from_heights(height, 20.0)
    assert found[30, 19, 0] > 0.5, "the left reveal faces right"
    assert found[15, 30, 1] < -0.5, "the head faces down"
    sky = cavity_visibility(height, 20.0)
    assert sky[0, 0] == 1
    assert HEIGHT_MAPS.min_cavity_visibility <= sky[16, 21] < 0.85
    assert colour.shape[:2] == sky.shape


def test_joints_are_where_the_picture_is_dark() -> None:
    grey = np.full((40, 40), 150, np.float32)
    grey[::8] = 100
    height = estimate_heights(None, np.full(grey.shape, PbrMaterialClass.BRICK), grey, np.zeros(grey.shape, bool), 50.0)
    assert height[16].max() < -0.003
    assert height[20].min() > -0.001
    assert (
        estimate_heights(None, np.full(grey.shape, PbrMaterialClass.PLASTER), grey, grey < 0, 50.0)[16] > height[16]
    ).all()


def test_a_smooth_light_is_taken_out_and_a_dark_plinth_stays() -> None:
    rng = np.random.default_rng(5)
    wall = np.full((180, 240, 3), 150.0) * rng.normal(1, 0.03, (180, 240, 1))
    wall[130:] *= 0.6
    labels = np.full((180, 240), FacadeClass.WALL, np.uint8)
    labels[20:50, 30:60] = FacadeClass.WINDOW
    ramp = np.exp(np.linspace(-0.3, 0.3, 240))[None, :, None]
    seen = np.clip(wall * ramp, 0, 255).astype(np.uint8)
    found = estimate_shading(seen, labels, 20.0)
    assert found is not None
    flat = divide_light(seen, found).astype(float).mean(axis=2)
    before, after = (np.log(one[60:120, 200:].mean() / one[60:120, :40].mean()) for one in (seen.astype(float), flat))
    assert abs(after) < 0.15 * before
    assert flat[140:].mean() / flat[60:120].mean() == pytest.approx(0.6, abs=0.1), "a material is no light"
    assert estimate_shading(seen, np.full(labels.shape, FacadeClass.WINDOW, np.uint8), 20.0) is None


def test_panes_lie_within_frames_and_between_bars() -> None:
    colour, labels = facade()
    found = list(find_openings(labels))
    assert len(found) == 12
    clear = glass_mask(found[0], colour[..., 0], 20.0)
    assert not clear[:, [0, 11, 12, 23]].any()
    assert clear[10, 5]
    assert clear[10, 18]


def test_windows_are_lit_by_who_they_are() -> None:
    _, labels = facade()
    everything = {}
    for order in (1, -1):
        for opening in list(find_openings(labels))[::order]:
            light = opening_emission(opening, 20.0, 9.0, SeededRandom(3, 4))
            was = everything.setdefault((opening.left, opening.top), light)
            assert (was is None) == (light is None)
            assert was is None or np.array_equal(was, light)
    one_less = labels.copy()
    one_less[15:45, 20:44] = FacadeClass.WALL
    for opening in find_openings(one_less):
        was, light = everything[opening.left, opening.top], opening_emission(opening, 20.0, 9.0, SeededRandom(3, 4))
        assert (was is None) == (light is None), "whatever becomes of its neighbours"
    lit = [opening_emission(one, 20.0, 9.0, SeededRandom(b, 1)) for b in range(60) for one in find_openings(labels)]
    shone = [one for one in lit if one is not None]
    assert 0.15 < len(shone) / len(lit) < 0.6
    assert all(0 < one.max() <= 1 for one in shone)
    warm = np.array([one[..., 0].mean() > one[..., 2].mean() for one in shone])
    assert 0.7 < warm.mean() < 1, "warm and cool"


def test_ground_is_of_what_its_map_says(houses: Scene) -> None:
    charts = houses.charts
    (piece,) = np.flatnonzero(charts.kind == ChartKind.GROUND)[:1]
    way = GroundWay("w", STREET.line, "road", 4.0, "asphalt", pavement=(2.0, 2.0))
    found = GroundMaterialOutlines(MappedGround((way,))).rasterise(charts, int(piece), (200, 200))
    x, y = ((np.arange(200) + 0.5) / 200 * size for size in charts.size[piece])
    world = charts.points(int(piece), x[None, :], y[:, None])
    away = np.abs(world[..., 1] - 6671980)
    along = (world[..., 0] > 386001) & (world[..., 0] < 386049)
    assert (found[along & (away < 1.7)] == PbrMaterialClass.ASPHALT).all()
    assert (found[along & (away > 2.3) & (away < 3.7)] == PbrMaterialClass.SLABS).all()
    assert (found[along & (away > 4.5)] == PbrMaterialClass.GRAVEL).all()


def lighting(scene: Scene, sun: Sun | None, provenance: int = Provenance.PHOTO) -> RelightingInputs:
    light = SceneLight(scene, np.full((len(scene.charts), 3), 0.4), sun)
    made = np.array(
        [field.SurfaceMaterial.PLASTER, field.SurfaceMaterial.SHEET_METAL, field.SurfaceMaterial.GROUND], np.uint8
    )[np.minimum(scene.charts.kind, ChartKind.GROUND)]
    place = scene.placement

    def texels(chart: int) -> StoredChartTexels:
        shape = place.shape(chart)
        if scene.charts.kind[chart] != ChartKind.WALL or provenance == Provenance.MATERIAL:
            return StoredChartTexels(np.full(shape, provenance, np.uint8), None, None)
        labels = np.full(shape, FacadeClass.WALL, np.uint8)
        labels[shape[0] // 4 : shape[0] // 2, shape[1] // 4 : shape[1] // 2] = FacadeClass.WINDOW
        return StoredChartTexels(np.full(shape, provenance, np.uint8), np.full((*shape, 3), 90, np.uint8), labels)

    return RelightingInputs(
        scene, MappedGround(), made, np.zeros(len(scene.charts), bool), list(range(len(scene.charts))), light, texels
    )


@pytest.mark.parametrize("sun", [None, SUN])
def test_the_light_of_a_colour_is_divided_out(houses: Scene, coloured: TexturedMesh, sun: Sun | None) -> None:
    for chart in coloured.select_charts(np.array([0])).tolist()[:6]:
        raster = np.maximum(coloured.raster(chart) // 2, 60)
        known = lighting(houses, sun, Provenance.MATERIAL)
        assert known.light is not None
        factor = known.light.factor(chart)
        sunny = (camera_tones(raster * factor) + 0.5).astype(np.uint8)
        known = replace(known, texels=lambda c, known=known: known.texels(c)._replace(labels=None, base_layer=None))
        found = build_relightable_mesh(replace(coloured, raster=lambda _, sunny=sunny: sunny), known).raster(chart)
        # a step of a dark or bright tone is several of the material
        assert np.abs(found.astype(int) - raster).mean() < 1.5
        assert np.abs(found.astype(int) - raster).max() <= 9
    walls = coloured.select_charts(np.array([0]))
    wall = int(walls[coloured.charts.kind[walls] == ChartKind.WALL][0])
    assert (build_relightable_mesh(coloured, lighting(houses, sun, Provenance.SYNTHESISED)).raster(wall) == 90).all(), (
        "as the facade stage left it"
    )


def model(source: TexturedMesh, time: TimeOfDay) -> bytes:
    drawn = pack_charts_on_pages(source, source.select_charts(np.array([0, 1, -1])))
    looks = [
        encode_textures(draw_page_images(drawn, page), ENCODERS["jpeg"]) for page in range(len(drawn.layout.pages))
    ]
    return encode_glb(build_nodes([drawn], {0: "a", 1: "b"}, mesh_y_up_frame(source.mesh))[0], looks, time=time)


def document(data: bytes) -> dict[str, Any]:
    return json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])


def test_maps_are_half_as_large_and_say_what_is_what(houses: Scene, coloured: TexturedMesh) -> None:
    source = build_relightable_mesh(coloured, lighting(houses, None))
    assert source.maps is not None
    for chart in source.select_charts(np.array([0, -1])).tolist():
        maps = source.maps(chart)
        width, height = (-(-side // 2) for side in source.texels[chart].tolist())
        assert maps.normal.shape == maps.orm.shape == (height, width, 3)
        assert (maps.orm[..., 2] == 0).all(), "no metal"
        assert all(a is b or np.array_equal(a, b) for a, b in zip(maps, source.maps(chart), strict=True))
    ground = int(source.select_charts(np.array([-1]))[0])
    assert (source.maps(ground).orm[..., 1] == round(float(ROUGHNESS[PbrMaterialClass.GRAVEL]) * 255)).all()
    assert np.abs(colour_of(ground).astype(int) - source.raster(ground)).max() <= 1


def test_a_photographed_wall_that_was_parsed_has_maps_too(houses: Scene, coloured: TexturedMesh) -> None:
    known = lighting(houses, None)
    source = build_relightable_mesh(coloured, replace(known, has_source_texture=np.ones(len(houses.charts), bool)))
    assert source.maps is not None
    wall = next(c for c in source.select_charts(np.array([0])).tolist() if known.texels(c).labels is not None)
    width, height = (-(-side // 2) for side in source.texels[wall].tolist())
    maps = source.maps(wall)
    assert maps.normal.shape == maps.orm.shape == (height, width, 3)
    assert len(np.unique(maps.orm[..., 1])) == 1, "nothing is told apart but where it lies"


@pytest.mark.parametrize("time", ["day", "night", "day or night", "night or day"])
def test_lit_models_are_valid_and_have_their_time_of_day(
    houses: Scene, coloured: TexturedMesh, gltf_issues: Callable[..., list[dict]], tmp_path: Path, time: TimeOfDay
) -> None:
    data = model(build_relightable_mesh(coloured, lighting(houses, None)), time)
    assert data == model(build_relightable_mesh(coloured, lighting(houses, None)), time)
    (tmp_path / "lit.glb").write_bytes(data)
    (issues,) = gltf_issues(tmp_path / "lit.glb")
    assert issues["numErrors"] == issues["numWarnings"] == 0, issues["messages"]
    said = document(data)
    assert "KHR_materials_unlit" not in said.get("extensionsUsed", [])
    shines = [("emissiveTexture" in one) for one in said["materials"]]
    assert any(shines) == (time != "day")
    for primitive in (one for mesh in said["meshes"] for one in mesh["primitives"]):
        first = said["materials"][primitive["material"]]
        if not any(shines):
            continue
        assert ("emissiveTexture" in first) == time.startswith(NIGHT)
        variants = primitive.get("extensions", {}).get("KHR_materials_variants")
        assert bool(variants) == (" or " in time)
        for mapping in variants["mappings"] if variants else ():
            night = mapping["variants"] == [1]
            shown = said["materials"][mapping["material"]]
            assert ("emissiveTexture" in shown) == night
            if night:
                assert shown["extensions"]["KHR_materials_emissive_strength"] == {
                    "emissiveStrength": GLTF_MATERIALS.emissive_strength
                }
