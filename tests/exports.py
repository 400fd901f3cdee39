"""Readers of the export formats for tests; formats whose package is not installed are skipped, and named."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pyogrio
import pytest
import rasterio
from lxml import etree
from PIL import Image

from facade_core.export.models.glb import read_glb_header
from tasks.export.registry import FORMATS

# The map of the demo, of which the block of the tests is a part.
MAP = "© OpenStreetMap contributors, ODbL 1.0"


def is_installed(name: str) -> bool:
    """Whether the package that a format needs is installed."""
    return not FORMATS[name].package or find_spec(FORMATS[name].package) is not None


def skip_unless_installed(name: str) -> pytest.MarkDecorator:
    """Skip a test where the package that a format needs is missing."""
    reason = f"no {FORMATS[name].package} here; `{FORMATS[name].setup}` installs it"
    return pytest.mark.skipif(not is_installed(name), reason=reason)


def select_formats(names: Iterable[str]) -> list[Any]:
    """Formats as parameters of a test, skipped where a package is missing."""
    return [pytest.param(name, marks=skip_unless_installed(name), id=name) for name in names]


EACH = select_formats(FORMATS)
HERE = [name for name in FORMATS if is_installed(name)]


@dataclass(frozen=True)
class ExportReader:
    """What tests read from an export's folder.

    Attributes
    ----------
    attributions : each statement of sources and licences.
    names : ids of the buildings, or of the facades where the format is of facades.
    """

    attributions: Callable[[Path], Iterable[str]]
    names: Callable[[Path], set[str]]


def copyright_of(file: Path) -> str:
    with file.open("rb") as opened:
        return read_glb_header(opened)[0]["asset"]["copyright"]


def attributions_in_glb(folder: Path) -> Iterable[str]:
    return map(copyright_of, folder.rglob("*.glb"))


def attributions_in_obj(folder: Path) -> Iterable[str]:
    (file,) = folder.glob("*.obj")
    yield file.read_text("utf-8").splitlines()[0].removeprefix("# ")


def attributions_in_tiles(folder: Path) -> Iterable[str]:
    yield json.loads((folder / "tileset.json").read_text())["asset"]["extras"]["attribution"]["line"]
    yield from attributions_in_glb(folder)


def attributions_in_cityjson(folder: Path) -> Iterable[str]:
    """CityJSON's extensions are declared, and named by a plus; the first line of a stream has them."""
    (file,) = (file for file in folder.glob("*.city.*json*"))
    head = json.loads(file.read_text().splitlines()[0])
    assert head["extensions"]["MetadataExtended"]["url"].endswith(".ext.json")
    said = head["+metadata-extended"]
    yield said["constraints"]["userNote"]
    for step in said["lineage"]:
        assert any("buildings.path" in source["description"] for source in step["source"])
        yield step["statement"]


def attributions_in_coco(folder: Path) -> Iterable[str]:
    value = json.loads((folder / "annotations.json").read_text())
    assert MAP.removeprefix("© ") in [one["name"] for one in value["licenses"]]
    yield value["info"]["contributor"]
    yield value["info"]["attribution"]["line"]
    yield from map(copyright_of_png, folder.rglob("*.png"))


def attributions_in_labelme(folder: Path) -> Iterable[str]:
    for file in folder.glob("[!.]*.json"):
        yield json.loads(file.read_text())["attribution"]["line"]
    yield from map(copyright_of_png, folder.glob("*.png"))


def copyright_of_png(file: Path) -> str:
    with Image.open(file) as image:
        return image.text["Copyright"]  # type: ignore[attr-defined]


def attributions_in_geopackage(folder: Path) -> Iterable[str]:
    (file,) = folder.glob("*.gpkg")
    for layer in {name for name, _ in pyogrio.list_layers(file)} - {"layer_styles"}:
        info = pyogrio.read_info(file, layer=layer)
        for said in (info["dataset_metadata"], info["layer_metadata"]):
            assert json.loads(said["sources"])["made"]
            yield said["attribution"]


def attributions_in_geoparquet(folder: Path) -> Iterable[str]:
    for file in folder.glob("*.parquet"):
        said = pq.read_schema(file).metadata
        assert json.loads(said[b"sources"])["made"]
        yield said[b"attribution"].decode()


def attributions_in_cog(folder: Path) -> Iterable[str]:
    for file in folder.glob("*.tif"):
        with rasterio.open(file) as image:
            yield image.tags()["attribution"]
            yield image.tags()["TIFFTAG_COPYRIGHT"]
        said = json.loads(file.with_suffix(".json").read_text())["properties"]
        assert [one["name"] for one in said["providers"]] == ["OpenStreetMap contributors"]
        yield said["streetloom:attribution"]["line"]


def attributions_in_citygml(folder: Path) -> Iterable[str]:
    (file,) = folder.glob("*.gml")
    model = etree.parse(file).getroot()
    yield model.findtext("{*}description")
    yield json.loads(model.findtext("{*}metaDataProperty/{*}GenericMetaData"))["line"]


def attributions_in_usd(folder: Path) -> Iterable[str]:
    from pxr import Usd

    for file in (*folder.glob("*.usda"), *folder.glob("*.usdz")):
        stage = Usd.Stage.Open(str(file))
        layer = stage.GetRootLayer()
        yield layer.comment
        yield layer.customLayerData["streetloom"]["attribution"]
        for prim in stage.GetDefaultPrim().GetChildren():
            yield prim.GetCustomDataByKey("streetloom:attribution")


def names_in_glb(folder: Path) -> set[str]:
    return {node["name"] for node in gltf(folder / "block.glb")["nodes"]} - {"ground", "neighbours"}


def names_in_obj(folder: Path) -> set[str]:
    (file,) = folder.glob("*.obj")
    lines = file.read_text("utf-8").splitlines()
    return {line.removeprefix("o ") for line in lines if line.startswith("o ")} - {"ground"}


def names_in_tiles(folder: Path) -> set[str]:
    return {name for path in (folder / "tiles").glob("*.glb") for name in buildings_of(path)} - {""}


def names_in_cityjson(folder: Path) -> set[str]:
    [path] = folder.glob("*.city.json")
    things = json.loads(path.read_text("utf-8"))["CityObjects"]
    return {id for id, thing in things.items() if thing["type"] == "Building"}


def names_in_features(folder: Path) -> set[str]:
    [path] = folder.glob("*.jsonl")
    things = {f["id"]: f for f in map(json.loads, path.read_text("utf-8").splitlines()[1:])}
    return {id for id, f in things.items() if f["CityObjects"][id]["type"] == "Building"}


def names_in_coco(folder: Path) -> set[str]:
    return {image["facade"] for image in json.loads((folder / "annotations.json").read_text("utf-8"))["images"]}


def names_in_labelme(folder: Path) -> set[str]:
    found = [json.loads(path.read_text("utf-8")) for path in folder.glob("[!.]*.json")]
    assert all((folder / one["imagePath"]).is_file() for one in found)
    return {one["imagePath"] for one in found}


def names_in_cog(folder: Path) -> set[str]:
    others = ("export.json", "collection.json")
    found = [json.loads(path.read_text("utf-8")) for path in folder.glob("*.json") if path.name not in others]
    assert {path.name for path in folder.glob("*.tif")} == {
        one["assets"]["orthophoto"]["href"].removeprefix("./") for one in found
    }
    return {one["id"] for one in found}


def names_in_citygml(folder: Path) -> set[str]:
    [path] = folder.glob("*.gml")
    stated = etree.parse(path).iterfind(".//{*}Building/{*}stringAttribute[@name='id']/{*}value")
    return {value.text or "" for value in stated}


def names_in_usd(folder: Path) -> set[str]:
    from pxr import Usd

    [path] = folder.glob("*.usda")
    stage = Usd.Stage.Open(str(path))
    return {prim.GetDisplayName() for prim in stage.GetDefaultPrim().GetChildren()} - {"ground"}


def names_in_geopackage(folder: Path) -> set[str]:
    [path] = folder.glob("*.gpkg")
    return set(pyogrio.read_dataframe(path, layer="buildings").id)


def names_in_geoparquet(folder: Path) -> set[str]:
    return set(pd.read_parquet(folder / "buildings.parquet", columns=["id"]).id)


def buildings_of(tile: Path) -> list[str]:
    """The column of buildings of a tile's property table."""
    document, data = gltf(tile), tile.read_bytes()
    start = 20 + int.from_bytes(data[12:16], "little") + 8
    column = document["extensions"]["EXT_structural_metadata"]["propertyTables"][0]["properties"]["building"]
    views = [document["bufferViews"][column[key]] for key in ("values", "stringOffsets")]
    text, offsets = (data[start + view["byteOffset"] :][: view["byteLength"]] for view in views)
    ends = np.frombuffer(offsets, "<u4").tolist()
    return [text[a:b].decode() for a, b in pairwise(ends)]


def gltf(path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


READERS = {
    "glb": ExportReader(attributions_in_glb, names_in_glb),
    "obj": ExportReader(attributions_in_obj, names_in_obj),
    "3dtiles": ExportReader(attributions_in_tiles, names_in_tiles),
    "cityjson": ExportReader(attributions_in_cityjson, names_in_cityjson),
    "cityjsonseq": ExportReader(attributions_in_cityjson, names_in_features),
    "lod3": ExportReader(attributions_in_cityjson, names_in_cityjson),
    "citygml": ExportReader(attributions_in_citygml, names_in_citygml),
    "coco": ExportReader(attributions_in_coco, names_in_coco),
    "labelme": ExportReader(attributions_in_labelme, names_in_labelme),
    "gpkg": ExportReader(attributions_in_geopackage, names_in_geopackage),
    "geoparquet": ExportReader(attributions_in_geoparquet, names_in_geoparquet),
    "cog": ExportReader(attributions_in_cog, names_in_cog),
    "usd": ExportReader(attributions_in_usd, names_in_usd),
}
