"""Exports before validators of others: Khronos' for every GLB, GDAL for tables.

val3dity: `tests/tasks/export/test_export.py`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import geopandas as gpd
import pyogrio
import pytest

from benchmarks.clients.validators import gltf_issues
from benchmarks.programs import package
from tasks.export.formats import export_run
from tests.clients.conftest import Exported, first, present
from tests.tasks.export.cities import write_city

# What the validator has no list of yet: the two are of an extension that it does not know.
KTX2 = {"VALUE_NOT_IN_LIST", "IMAGE_UNRECOGNIZED_FORMAT"}


def said(*files: Path) -> set[str]:
    """The codes of errors and warnings in GLB files, of which there is at least one."""
    assert files
    with present():
        issues = gltf_issues(*files)
    return {message["code"] for one in issues for message in one["messages"] if message["severity"] < 2}


@pytest.mark.parametrize("lit", [False, True])
def test_every_model_is_valid(exported: Exported, lit: bool) -> None:
    assert said(*exported("glb", lit=lit).rglob("*.glb")) == set()


def test_every_tile_is_valid(textures: str, exported: Exported) -> None:
    found = said(*(exported("3dtiles", textures=textures) / "tiles").glob("*.glb"))
    assert found <= (KTX2 if textures == "ktx2" else set())


def test_every_tile_of_a_city_is_valid(undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    with present():
        package("gltf-validator")
    city = write_city(tmp_path / "city", undisturbed[0], ["a", "b"])
    folder = export_run(city, "3dtiles", tmp_path / "tiles").path
    tiles = list(folder.rglob("*.glb"))  # type: ignore[union-attr]
    assert {tile.relative_to(folder).parts[:2] for tile in tiles} == {("blocks", "a"), ("blocks", "b")}
    assert said(*tiles) == set()


def test_what_is_published_is_valid(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    out = undisturbed[0]
    folder = out / "published" / (out / "current").read_text().strip()
    assert said(*folder.glob("*.glb"), *(folder / "tiles").glob("*.glb")) == set()


def test_gdal_reads_every_layer_of_a_geopackage(exported: Exported, undisturbed: tuple[Path, dict[str, Any]]) -> None:
    path = first(exported("gpkg"))
    items = gpd.read_parquet(undisturbed[1]["outputs"]["items"])
    crs = json.loads((path.parent / "export.json").read_text())["crs"]
    layers = [name for name, geometry in pyogrio.list_layers(path) if geometry is not None]
    assert {"facades", "buildings"} <= set(layers)
    for layer in layers:
        read = pyogrio.read_dataframe(path, layer=layer)
        assert len(read) == pyogrio.read_info(path, layer)["features"] > 0
        assert read.crs == crs
        assert not read.geometry.is_empty.any()
    facades = pyogrio.read_dataframe(path, layer="facades").set_index("id")
    rows = items[items.kind == "facade"].set_index("id")
    assert (facades.floors.reindex(rows.index) == rows.floors).all()
