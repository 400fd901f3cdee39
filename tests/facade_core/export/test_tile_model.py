"""Tiles show what the atlas shows, stand where the block does, and are joined without a byte of their pictures changed."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from facade_core.export.models import pages
from facade_core.export.models.glb_merge import merge_glbs, read_glb_file_header
from facade_core.export.models.textured_mesh import TexturedMesh, mesh_y_up_frame
from facade_core.export.tiles.overview import encode_overview, overview_scale, select_overview_charts
from facade_core.export.tiles.settings import OverviewSettings
from facade_core.export.tiles.tile_model import (
    COARSE_DIVISOR,
    EarlierTile,
    TileModel,
    build_tile_model,
    coarse_rasters,
    coarse_size,
)
from facade_core.geometry.charts import ChartKind
from tests.facade_core.export.conftest import colour_of

NAMES = {0: "a", 1: "b"}


def tile(source: TexturedMesh, building: int, origin: list[float]) -> tuple[np.ndarray, TileModel]:
    charts = source.select_charts(np.array([building]))
    read: list[int] = []

    def rasters(chosen: np.ndarray) -> dict[int, np.ndarray]:
        read.extend(chosen.tolist())
        return {chart: source.raster(chart) for chart in chosen.tolist()}

    digests = [str(chart) for chart in charts.tolist()]
    made = build_tile_model(source, charts, digests, NAMES, rasters, {"origin": origin, "crs": "EPSG:32635"})
    assert sorted(read) == charts.tolist(), "each chart is read once"
    return charts, made


@pytest.mark.parametrize("changed", [None, 0, -1])
def test_pictures_of_which_no_chart_changed_are_taken_from_the_tile_of_before(
    coloured: TexturedMesh, monkeypatch: pytest.MonkeyPatch, changed: int | None
) -> None:
    monkeypatch.setattr(pages, "MAX_SHELF_PAGE_TEXELS", 256)
    monkeypatch.setattr(pages.lay_out_shelves, "__kwdefaults__", {"largest": 256})
    charts = coloured.select_charts(np.array([0, 1]))
    extras = {"origin": [0.0, 0.0, 0.0]}
    read: list[int] = []
    other = set() if changed is None else {int(charts[changed])}

    def raster(chart: int, new: bool) -> np.ndarray:
        return coloured.raster(chart) // 2 if new and chart in other else coloured.raster(chart)

    def rasters(new: bool) -> Callable[[np.ndarray], dict[int, np.ndarray]]:
        def of(chosen: np.ndarray) -> dict[int, np.ndarray]:
            read.extend(chosen.tolist())
            return {chart: raster(chart, new) for chart in chosen.tolist()}

        return of

    digests = [str(chart) for chart in charts.tolist()]
    before = build_tile_model(coloured, charts, digests, NAMES, rasters(False), extras)
    assert len(before.picture_digests) > 2
    now = [f"{digest} again" if int(digest) in other else digest for digest in digests]
    fresh = build_tile_model(coloured, charts, now, NAMES, rasters(True), extras)
    read.clear()
    again = build_tile_model(
        coloured,
        charts,
        now,
        NAMES,
        rasters(True),
        extras,
        EarlierTile(before.glb, before.coarse, before.picture_digests),
    )
    assert other <= set(read)
    assert len(read) < len(charts)
    assert bool(read) == bool(other)
    assert again.glb == fresh.glb
    assert again.picture_digests == fresh.picture_digests
    np.testing.assert_array_equal(again.coarse, fresh.coarse)


def document(data: bytes) -> dict[str, Any]:
    return json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])


def pictures(data: bytes) -> list[bytes]:
    said = document(data)
    start = 20 + struct.unpack_from("<I", data, 12)[0] + 8
    views = [said["bufferViews"][image["bufferView"]] for image in said["images"]]
    return [data[start + view["byteOffset"] :][: view["byteLength"]] for view in views]


def test_every_triangle_of_a_tile_shows_its_own_chart(coloured: TexturedMesh) -> None:
    origin = [385024.0, 6671360.0, 0.0]
    charts, made = tile(coloured, 0, origin)
    model = trimesh.load(io.BytesIO(made.glb), file_type="glb")
    checked = 0
    for part in model.geometry.values():
        image = np.asarray(part.visual.material.baseColorTexture.convert("RGB")).astype(int)
        middle = part.visual.uv[part.faces].mean(axis=1)
        shape = np.array(image.shape[:2])
        pixels = image[tuple((np.column_stack([1 - middle[:, 1], middle[:, 0]]) * shape).astype(int).T)]
        for face, pixel in zip(part.faces, pixels, strict=True):
            x, y, z = part.vertices[face].mean(axis=0)
            point = np.array([x, -z, y]) + origin
            on = [c for c in charts.tolist() if np.abs(colour_of(c).astype(int) - pixel).max() <= 4]
            normal = coloured.charts.normals()
            assert any(abs((point - coloured.charts.origin[c]) @ normal[c]) < 0.01 for c in on)
            checked += 1
    assert checked == np.isin(coloured.mesh.chart, charts).sum()
    walls = charts[coloured.charts.kind[charts] == ChartKind.WALL]
    assert made.box[0] == pytest.approx([386000, 6671990, 0], abs=0.01)
    assert made.box[1] == pytest.approx([386020, 6672000, coloured.charts.size[walls, 1].max()], abs=0.01)


def test_coarse_rasters_are_those_of_the_charts(coloured: TexturedMesh) -> None:
    charts, made = tile(coloured, 1, [0.0, 0.0, 0.0])
    found = coarse_rasters(coloured.texels, charts, made.coarse)
    assert list(found) == charts.tolist()
    for chart, raster in found.items():
        width, height = coloured.texels[chart].tolist()
        assert raster.shape[:2] == (-(-height // COARSE_DIVISOR), -(-width // COARSE_DIVISOR))
        assert np.abs(raster.astype(int) - colour_of(chart)).max() <= 1


def test_joined_tiles_are_the_block(
    coloured: TexturedMesh, tmp_path: Path, gltf_issues: Callable[..., list[dict[str, Any]]]
) -> None:
    parts = []
    for building, origin in ((0, [385024.0, 6671360.0, 0.0]), (1, [386048.0, 6671360.0, -3.0]), (-1, [0.0, 0.0, 0.0])):
        (tmp_path / f"{building}.glb").write_bytes(tile(coloured, building, origin)[1].glb)
        parts.append(tmp_path / f"{building}.glb")
    origin = mesh_y_up_frame(coloured.mesh).origin.tolist()
    whole = tmp_path / "block.glb"
    size = merge_glbs(
        whole, list(map(read_glb_file_header, parts)), origin, extras={"crs": "EPSG:32635"}, copyright="© A; © B"
    )
    assert size == whole.stat().st_size == struct.unpack_from("<I", whole.read_bytes(), 8)[0]
    assert pictures(whole.read_bytes()) == [one for part in parts for one in pictures(part.read_bytes())]
    said = document(whole.read_bytes())
    assert said["asset"]["copyright"] == "© A; © B"
    again = tmp_path / "twice.glb"
    merge_glbs(again, [read_glb_file_header(whole)] * 2, origin, extras={}, copyright="© B; © C")
    assert document(again.read_bytes())["asset"]["copyright"] == "© B; © C; © A"
    assert [node["name"] for node in said["nodes"]] == ["a", "b", "ground"]
    assert said["scenes"][0]["extras"] == {"origin": origin, "crs": "EPSG:32635"}
    low, high = trimesh.load(whole).bounds
    points = coloured.mesh.vertices[coloured.mesh.triangles.reshape(-1)] - origin
    # the ground's own origin is so far away that its coordinates are rounded to half a metre
    np.testing.assert_allclose([low[0], -high[2]], [points[:, 0].min(), points[:, 1].min()], atol=0.6)
    only = tmp_path / "walls.glb"
    merge_glbs(only, list(map(read_glb_file_header, parts[:2])), origin, extras={})
    low, high = trimesh.load(only).bounds
    built = coloured.mesh.vertices[coloured.charts.building[coloured.mesh.vertex_chart] >= 0] - origin
    np.testing.assert_allclose(low, [built[:, 0].min(), built[:, 2].min(), -built[:, 1].max()], atol=1e-3)
    np.testing.assert_allclose(high, [built[:, 0].max(), built[:, 2].max(), -built[:, 1].min()], atol=1e-3)
    empty = tmp_path / "empty.glb"
    merge_glbs(empty, [], origin, extras={})
    for path, issues in zip([whole, *parts, empty], gltf_issues(whole, *parts, empty), strict=True):
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), (path.name, issues["messages"][:3])


def test_what_is_no_model_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cut.glb").write_bytes(b"glTF")
    with pytest.raises(ValueError, match="no GLB file"):
        read_glb_file_header(tmp_path / "cut.glb")


@pytest.mark.parametrize("most", [8_000_000, 40_000, 12_000, 5_000])
def test_an_overview_is_as_small_as_it_must_be(coloured: TexturedMesh, most: int) -> None:
    settings = OverviewSettings(max_overview_bytes=most)
    charts = select_overview_charts(coloured, settings)
    coarse = coarse_size(coloured.texels)
    size = np.maximum(1, np.ceil(coarse * overview_scale(coarse[charts], settings))).astype(np.int64)

    def raster(chart: int) -> np.ndarray:
        return pages.downscale(coloured.raster(chart), tuple(size[chart].tolist()))

    whole = replace(coloured, texels=size, raster=raster)
    data = encode_overview(whole, charts, {"origin": [386000.0, 6671990.0, 0.0]}, settings=settings)
    assert len(data) <= most
    model = trimesh.load(io.BytesIO(data), file_type="glb")
    shown = sum(len(part.faces) for part in model.geometry.values())
    assert 0 < shown <= len(coloured.mesh.triangles)
    if settings == OverviewSettings():
        assert shown == len(coloured.mesh.triangles)
    area = coloured.charts.size.prod(axis=1)
    left_out = np.setdiff1d(np.unique(coloured.mesh.chart), charts)
    assert not len(left_out) or area[left_out].max() <= area[charts].min()
