"""Every format, and what is published, names whom the block is from and under which licence, in the file itself."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pyogrio
import pytest
import rasterio
from lxml import etree
from PIL import Image

from facade_core.export.models.glb import read_glb_header
from tasks.export.formats import FORMATS, export_run
from tasks.publish.published_run import PublishedBlock
from tests.exports import EACH

Run = tuple[Path, dict[str, Any]]
# The demo's map, of which the block is a part.
MAP = "© OpenStreetMap contributors, ODbL 1.0"


def copyright_of(file: Path) -> str:
    with file.open("rb") as opened:
        return read_glb_header(opened)[0]["asset"]["copyright"]


def of_glb(folder: Path) -> Iterable[str]:
    return map(copyright_of, folder.rglob("*.glb"))


def of_tiles(folder: Path) -> Iterable[str]:
    yield json.loads((folder / "tileset.json").read_text())["asset"]["extras"]["attribution"]["line"]
    yield from of_glb(folder)


def of_cityjson(folder: Path) -> Iterable[str]:
    """CityJSON's extensions are declared, and named by a plus; the first line of a stream has them."""
    (file,) = (file for file in folder.glob("*.city.*json*"))
    head = json.loads(file.read_text().splitlines()[0])
    assert head["extensions"]["MetadataExtended"]["url"].endswith(".ext.json")
    said = head["+metadata-extended"]
    yield said["constraints"]["userNote"]
    for step in said["lineage"]:
        assert any("buildings.path" in source["description"] for source in step["source"])
        yield step["statement"]


def of_coco(folder: Path) -> Iterable[str]:
    value = json.loads((folder / "annotations.json").read_text())
    assert MAP.removeprefix("© ") in [one["name"] for one in value["licenses"]]
    yield value["info"]["contributor"]
    yield value["info"]["attribution"]["line"]
    yield from map(of_png, folder.rglob("*.png"))


def of_labelme(folder: Path) -> Iterable[str]:
    for file in folder.glob("[!.]*.json"):
        yield json.loads(file.read_text())["attribution"]["line"]
    yield from map(of_png, folder.glob("*.png"))


def of_png(file: Path) -> str:
    with Image.open(file) as image:
        return image.text["Copyright"]  # type: ignore[attr-defined]


def of_geopackage(folder: Path) -> Iterable[str]:
    (file,) = folder.glob("*.gpkg")
    for layer in {name for name, _ in pyogrio.list_layers(file)} - {"layer_styles"}:
        info = pyogrio.read_info(file, layer=layer)
        for said in (info["dataset_metadata"], info["layer_metadata"]):
            assert json.loads(said["sources"])["made"]
            yield said["attribution"]


def of_geoparquet(folder: Path) -> Iterable[str]:
    for file in folder.glob("*.parquet"):
        said = pq.read_schema(file).metadata
        assert json.loads(said[b"sources"])["made"]
        yield said[b"attribution"].decode()


def of_cog(folder: Path) -> Iterable[str]:
    for file in folder.glob("*.tif"):
        with rasterio.open(file) as image:
            yield image.tags()["attribution"]
            yield image.tags()["TIFFTAG_COPYRIGHT"]
        said = json.loads(file.with_suffix(".json").read_text())["properties"]
        assert [one["name"] for one in said["providers"]] == ["OpenStreetMap contributors"]
        yield said["streetloom:attribution"]["line"]


def of_citygml(folder: Path) -> Iterable[str]:
    (file,) = folder.glob("*.gml")
    model = etree.parse(file).getroot()
    yield model.findtext("{*}description")
    yield json.loads(model.findtext("{*}metaDataProperty/{*}GenericMetaData"))["line"]


def of_usd(folder: Path) -> Iterable[str]:
    from pxr import Usd

    for file in (*folder.glob("*.usda"), *folder.glob("*.usdz")):
        stage = Usd.Stage.Open(str(file))
        layer = stage.GetRootLayer()
        yield layer.comment
        yield layer.customLayerData["streetloom"]["attribution"]
        for prim in stage.GetDefaultPrim().GetChildren():
            yield prim.GetCustomDataByKey("streetloom:attribution")


NAMED: dict[str, Callable[[Path], Iterable[str]]] = {
    "glb": of_glb,
    "3dtiles": of_tiles,
    "cityjson": of_cityjson,
    "cityjsonseq": of_cityjson,
    "lod3": of_cityjson,
    "citygml": of_citygml,
    "coco": of_coco,
    "labelme": of_labelme,
    "gpkg": of_geopackage,
    "geoparquet": of_geoparquet,
    "cog": of_cog,
    "usd": of_usd,
}


def test_each_format_is_asked() -> None:
    assert tuple(NAMED) == FORMATS


@pytest.mark.parametrize("style", EACH)
def test_a_format_names_the_licence_of_the_map(
    found: PublishedBlock, undisturbed: Run, tmp_path: Path, style: str
) -> None:
    name = found.names[int(found.plan.facades.building[found.select_finished_facades(found.select_buildings(()))[0]])]
    line = found.attribution.line
    folder = export_run(undisturbed[0], style, tmp_path / style, [name]).path
    said = list(NAMED[style](Path(str(folder))))
    assert line.startswith(MAP)
    assert said
    assert set(said) == {line}


def test_what_is_published_names_it_without_a_day(found: PublishedBlock) -> None:
    line = replace(found.attribution, production_date=None).line
    folder = Path(str(found.snapshot.folder))
    assert line.startswith(MAP)
    models = [folder / "block.glb", folder / "overview.glb", *(folder / "tiles").glob("*.glb")]
    assert len(models) > 2
    assert {copyright_of(model) for model in models} == {line}
    assert json.loads((folder / "tiles/index.json").read_text())["attribution"]["line"] == line
    for kind in ("facades", "streets", "blocks", "runs"):
        collection = json.loads((folder / f"stac/{kind}/collection.json").read_text())
        licensors = [one for one in collection["providers"] if "licensor" in one["roles"]]
        assert [one["name"] for one in licensors] == ["OpenStreetMap contributors"]
        assert "ODbL 1.0" in licensors[0]["description"]
        assert [link["href"] for link in collection["links"] if link["rel"] == "license"]
        assert collection["license"] == "other", "the exemplars and photos of the block file state none"
    models_of = json.loads((folder / "stac/models/collection.json").read_text())
    assert [one["name"] for one in models_of["providers"]] == ["Streetloom"]
