"""3D Tiles stand where the block does, coarse above fine, and never untextured."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
import trimesh
from pyproj import Transformer

from facade_core.export import tiles
from facade_core.export.attribution import Attribution, Source
from facade_core.export.earth import earth_frame
from facade_core.export.glb import header_of
from facade_core.export.models import Textured, local_frame
from facade_core.export.shells import simplified_shells
from facade_core.export.tiles import count_tiles, quadtree, write_tileset
from facade_core.geometry import ROOF, WALL
from tests.facade_core.export.conftest import colour_of

CRS = "EPSG:32635"
OF = Attribution((Source("buildings.path", "a.pbf", "Mappers, ODbL 1.0"),))


@pytest.mark.parametrize("crs", [CRS, "EPSG:28992"])
def test_the_frame_puts_points_where_they_are_on_the_earth(crs: str) -> None:
    origin = np.array([386000.0, 6672000.0, 5.0] if crs == CRS else [92000.0, 436000.0, -1.0])
    frame = earth_frame(crs, origin, 17.5)
    world = origin + np.array([[0, 0, 0], [800, -300, 40], [0, 1000, 0]])
    model = frame.points(world)
    matrix = frame.transform()
    tile = np.column_stack([model[:, 0], -model[:, 2], model[:, 1]])  # as a viewer turns glTF's y up
    earth = tile @ matrix[:3, :3].T + matrix[:3, 3]
    longitude, latitude, height = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*earth.T)
    expected = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(world[:, 0], world[:, 1])
    np.testing.assert_allclose([longitude, latitude], expected, atol=1e-9)
    np.testing.assert_allclose(height, world[:, 2] + 17.5, atol=1e-4)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    north = frame.directions(np.array([[0.0, 1.0, 0.0]]))[0]
    np.testing.assert_allclose(north, (model[2] - model[0]) / np.linalg.norm(model[2] - model[0]), atol=1e-3)


def test_shells_look_like_their_buildings(coloured: Textured) -> None:
    shells = simplified_shells(coloured, 2.5)
    shown = shells.textured
    assert shells.kept.size == 0
    assert (np.bincount(shown.charts.kind, minlength=2)[[WALL, ROOF]] == [8, 2]).all()
    for chart in range(len(shown.charts)):
        raster = shown.raster(chart).astype(int)
        assert raster.shape[:2] == tuple(shown.texels[chart][::-1])
        point = shown.centres[chart]
        same = np.flatnonzero(
            (coloured.charts.building == shown.charts.building[chart])
            & (coloured.charts.kind == shown.charts.kind[chart])
        )
        nearest = same[np.linalg.norm(coloured.centres[same] - point, axis=1).argmin()]
        assert np.abs(raster - colour_of(nearest)).max() <= 1


def written(source: Textured) -> tuple[dict[str, Any], dict[str, bytes], int]:
    files: dict[str, bytes] = {}
    cells = quadtree(source)
    shells = simplified_shells(source, 10 * tiles.COARSE)
    frame = earth_frame(CRS, local_frame(source.mesh).origin)
    value = write_tileset(
        source, cells, shells, frame, {0: "a", 1: "b"}, 10.0, files.__setitem__, extras={"k": 1}, attribution=OF
    )
    return value, files, count_tiles(cells)


@pytest.mark.parametrize("texels", [tiles.TILE_TEXELS, 60_000, 3_000])
def test_tiles_nest_and_hold_every_building_at_both_levels(
    coloured: Textured, texels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tiles, "TILE_TEXELS", texels)
    value, files, counted = written(coloured)
    assert value["asset"]["version"] == "1.1"
    assert value["asset"]["extras"] == {"k": 1, "attribution": OF.value()}
    assert len(value["root"]["transform"]) == 16
    finest: list[str] = []
    seen: list[str] = []

    def check(tile: dict[str, Any], error: float, around: np.ndarray | None) -> None:
        uri = tile["content"]["uri"]
        seen.append(uri)
        assert tile["geometricError"] <= error
        box = np.array(tile["boundingVolume"]["box"])
        corners = np.stack([box[:3] - box[[3, 7, 11]], box[:3] + box[[3, 7, 11]]])
        assert header_of(io.BytesIO(files[uri]))[0]["asset"]["copyright"] == OF.line
        model = trimesh.load(io.BytesIO(files[uri]), file_type="glb")
        low, high = model.bounds[:, [0, 2, 1]]
        low[1], high[1] = -high[1], -low[1]
        assert (corners[0] <= low + 1e-3).all()
        assert (corners[1] >= high - 1e-3).all()
        assert all(part.visual.material.baseColorTexture is not None for part in model.geometry.values())
        if around is not None:
            assert (corners[0] >= around[0] - 1e-6).all()
            assert (corners[1] <= around[1] + 1e-6).all()
        if "children" not in tile:
            finest.extend(model.graph.nodes_geometry)
            assert tile["geometricError"] == 0
        for child in tile.get("children", ()):
            check(child, tile["geometricError"], corners)

    check(value["root"], value["geometricError"], None)
    assert sorted(seen) == sorted(files)
    assert len(files) == counted >= 2
    assert sorted(name for name in finest if name != "ground") == ["a", "b"], "each building in one finest tile"
    root = trimesh.load(io.BytesIO(files["tiles/coarse.glb"]), file_type="glb")
    assert set(root.graph.nodes_geometry) >= {"a", "b"}
