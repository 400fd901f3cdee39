"""STAC: every file fits its schemas, every link leads somewhere, and several runs make one catalogue."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import geopandas as gpd
import jsonschema
import pyarrow.parquet as pq
import pystac
import pytest
import shapely
from click.testing import CliRunner
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT7
from shapely import LineString

import catalogs
from catalogs.features import safe_file_stem
from catalogs.published.columns import ROW_KEYS
from catalogs.published.items import write_items
from catalogs.published.snapshot import SnapshotFolder
from catalogs.query.execution import query
from catalogs.stac.catalog import write_catalog
from catalogs.stac.facts import BlockFacts, DataSourceFacts, ModelFacts, RunFacts, SnapshotFacts, StreetFacts
from catalogs.stac.items import CITY3D, FILE, PROCESSING, PROJECTION, VERSION, ZARR
from catalogs.stac.snapshot import write_stac
from facade_core.core.errors import InputError
from flows.cli.commands import command_line

CORE = Path(pystac.__file__).parent / "validation" / "jsonschemas"
assert catalogs.__file__
VENDORED = Path(catalogs.__file__).parent / "stac" / "schemas"
KINDS = {
    "Feature": "item-spec/json-schema/item",
    "Collection": "collection-spec/json-schema/collection",
    "Catalog": "catalog-spec/json-schema/catalog",
}


def row(identifier: str, number: int = 0, **changes: Any) -> dict[str, Any]:
    """A facade 15 m wide in central Helsinki, every further one 20 m east."""
    x = 385_700 + 20 * number
    known = {
        "id": identifier,
        "kind": "facade",
        "block": "demo",
        "building": identifier.partition("-f")[0],
        "geometry": LineString([(x, 6_671_700, 3), (x + 15, 6_671_704.25, 3)]),
        "street": "Itäinen Teatterikuja",
        "height_m": 19.25,
        "floors": 6,
        "photo": 0.75,
        "inpainted": 0.25,
        "source": "dam-3.jpg",
        "layout_score": float("-inf"),
        "status": "done",
        "updated": datetime(2026, 11, 1 + number, 12, 30, tzinfo=UTC),
        "code_version": "0.1.0+ab",
        "config_digest": "cd",
    }
    return dict.fromkeys(ROW_KEYS) | known | changes


def aside(identifier: str, kind: str = "building") -> dict[str, Any]:
    return row(identifier, 20, kind=kind, building=None, geometry=None, status="failed", reason="a corner is no number")


MADE = datetime(2026, 11, 21, 12, 30, tzinfo=UTC)
STREETS = [
    StreetFacts("s9", "Itäinen Teatterikuja", LineString([(385_690, 6_671_690), (385_790, 6_671_690)]), "done", None,
                12, 12, "key9", 31.5, MADE),
    StreetFacts("s10", None, LineString([(385_690, 6_671_690), (385_690, 6_671_790)]), "stale", "visible surfaces changed",
                4, 0, "key10", 3.5, MADE),
    StreetFacts("s/11", "Lane", LineString([(385_690, 6_671_690), (385_690, 6_671_700)]), "unseen", "no wall is seen from it",
                0, 0, None, None, None),
]  # fmt: skip
RUN = RunFacts(
    MADE.replace(hour=11), MADE, {"facades": {"done": 3, "failed": 2}, "streets": {"done": 1, "stale": 1}}, 99.126
)


def facts(snapshot: str = "SNAP", **changes: Any) -> BlockFacts:
    """What is said of the block: one building, 40 m square."""
    known: dict[str, Any] = {
        "name": "demo",
        "crs": "EPSG:32635",
        "snapshot": snapshot,
        "code_version": "0.1.0+ab",
        "config_digest": "cd",
        "updated": MADE,
        "footprint": shapely.box(385_700, 6_671_700, 385_740, 6_671_740),
        "counts": {"buildings": 3, "facades_done": 4, "facades_failed": 1},
        "settings": {"texture.walls": "exemplar", "seed": 7, "geoid_separation": None},
        "sources": (
            DataSourceFacts("buildings.path", "city.osm.pbf", "ODbL"),
            DataSourceFacts("imagery.photos.path", "photos", None),
        ),
        "notes": ("no heights",),
    }
    return BlockFacts(**known | changes)


def models(folder: Path) -> list[ModelFacts]:
    card = folder / "network.md"
    card.write_text("# Model card")
    return [ModelFacts("network", "facade parser", "parse/network.onnx", 12, "ab" * 32, card, {"ECP": "MIT"})]


def publish(out: Path, rows: list[dict[str, Any]], snapshot: str = "SNAP", predecessor: str | None = None) -> Path:
    """What a run leaves in `out`: table, model, report with pictures of every facade, STAC, `current` and catalog.json."""
    folder = out / "published" / snapshot
    (folder / "report" / "images").mkdir(parents=True)
    (out / "store").mkdir(exist_ok=True)
    write_items(folder / "items.parquet", rows, "EPSG:32635")
    (folder / "block.glb").write_bytes(b"glTF")
    (folder / "report" / "index.html").write_text("<html></html>")
    for name in ("above.jpg", "panorama-0.jpg"):
        (folder / "report" / "images" / name).write_bytes(b"jpg")
    for one in rows:
        for stage in ("result", "level-0"):
            (folder / "report" / "images" / f"{safe_file_stem(one['id'])}-{stage}.webp").write_bytes(b"webp")
    write_stac(
        folder,
        rows=rows,
        facts=SnapshotFacts(facts(snapshot), STREETS, RUN, models(out / "store")),
        predecessor=predecessor,
    )
    (out / "current").write_text(snapshot + "\n")
    write_catalog(out)
    return folder


@cache
def registry() -> Registry[Any]:
    """Schemas by address; the core's `$id`s are not all as they are referred to."""
    spec = CORE / "stac-spec" / "v1.1.0"
    found = {f"https://geojson.org/schema/{p.name}": p for p in (CORE / "geojson").glob("*.json")}
    for path in spec.glob("*.json"):
        folder = next((f for f in ("catalog", "collection") if path.stem == f), "item")
        found[f"https://schemas.stacspec.org/v1.1.0/{folder}-spec/json-schema/{path.name}"] = path
    for path in VENDORED.glob("*/*/schema.json"):
        extension, version = path.parts[-3:-1]
        base = "cityjson.github.io/stac-city3d" if extension == "city3d" else f"stac-extensions.github.io/{extension}"
        found[f"https://{base}/{version}/schema.json"] = path

    def without_id(path: Path) -> Any:
        return {key: value for key, value in json.loads(path.read_text()).items() if key != "$id"}

    loaded = [(address, Resource(without_id(path), DRAFT7)) for address, path in found.items()]
    return Registry().with_resources(
        [*loaded, ("http://json-schema.org/draft-07/schema", Resource(DRAFT7_META, DRAFT7))]
    )


DRAFT7_META = jsonschema.Draft7Validator.META_SCHEMA


def problems(value: dict[str, Any]) -> list[str]:
    """What the core and the declared extensions have to say against a STAC object."""
    core = f"https://schemas.stacspec.org/v1.1.0/{KINDS[value['type']]}.json"
    found = []
    for address in (core, *value.get("stac_extensions", ())):
        validator = jsonschema.Draft7Validator({"$ref": address}, registry=registry())
        found += [f"{address}: {error.json_path}: {error.message}"[:400] for error in validator.iter_errors(value)]
    return found


def stac_files(folder: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    for path in sorted(folder.rglob("*.json")):
        yield path, json.loads(path.read_text(encoding="utf-8"))


ROWS = [
    row("w9-f1", 0),
    row("w10-f2", 1, status="failed", reason="too dark", photo=None, inpainted=None, source=None),
    row("NL.IMBAG/0599-f3", 2, building="NL.IMBAG/0599"),
    row("Größe 7-f1", 3, building="Größe 7"),
    row(
        "w11-f1", 4, geometry=shapely.from_wkt("LINESTRING (nan 0, 385700 6671700)"), status="failed", reason="no place"
    ),
    aside("w12"),
    aside("w9-f1", "photo"),
]


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "helsinki"
    publish(folder, ROWS)
    return folder


def test_every_file_fits_the_core_and_its_extensions(out: Path) -> None:
    files = list(stac_files(out))
    # four facades with a place, three streets, the block, its run and a model
    assert sorted(value["type"] for _, value in files) == ["Catalog"] + ["Collection"] * 5 + ["Feature"] * 10
    for path, value in files:
        assert problems(value) == [], path
    declared = {extension for _, value in files for extension in value.get("stac_extensions", ())}
    assert declared == {PROJECTION, FILE, PROCESSING, VERSION, CITY3D, ZARR}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("facades/collection.json", {"extent": None}),
        ("streets/collection.json", {"license": 5}),
        ("facades/w9/w9-f1.json", {"properties": {}}),
        ("facades/w9/w9-f1.json", {"bbox": [1]}),
        ("facades/w9/w9-f1.json", {"properties": {"datetime": "2026-01-01T00:00:00Z", "proj:code": 32635}}),
        ("facades/w9/w9-f1.json", {"properties": {"datetime": "2026-01-01T00:00:00Z", "processing:level": 4}}),
        ("facades/w9/w9-f1.json", {"assets": {"x": {"href": "x", "file:checksum": "no"}}}),
        ("blocks/demo.json", {"properties": {"datetime": "2026-01-01T00:00:00Z", "city3d:version": "two"}}),
        ("runs/run.json", {"properties": {"datetime": "2026-01-01T00:00:00Z", "version": 7}}),
        ("models/collection.json", {"deprecated": "no"}),
        ("blocks/demo.json", {"assets": {"x": {"href": "x", "zarr:zarr_format": 4}}}),
    ],
)
def test_the_schemas_do_check(out: Path, name: str, change: dict[str, Any]) -> None:
    value = json.loads((out / "published" / "SNAP" / "stac" / name).read_text(encoding="utf-8"))
    assert problems(value) == []
    assert problems(value | change)


def test_every_link_and_asset_leads_to_a_file(out: Path) -> None:
    for path, value in stac_files(out):
        assert len(value["links"]) == len({(link["rel"], link["href"]) for link in value["links"]})
        for link in value["links"]:
            assert (path.parent / link["href"]).is_file(), (path, link)
        for asset in value.get("assets", {}).values():
            target = path.parent / asset["href"]
            assert target.exists(), (path, asset)
            if target.is_file():
                assert asset["file:size"] == target.stat().st_size
                assert asset["file:checksum"] == "1220" + hashlib.sha256(target.read_bytes()).hexdigest()
            else:
                assert target.name == "store"


def test_pystac_walks_it(out: Path) -> None:
    root = pystac.Catalog.from_file(str(out / "catalog.json"))
    collections = {collection.id: collection for collection in root.get_children()}
    assert list(collections) == [f"demo-{kind}" for kind in ("facades", "streets", "blocks", "runs", "models")]
    found = {name: [item.id for item in collection.get_items()] for name, collection in collections.items()}
    assert found == {
        "demo-facades": ["Größe 7-f1", "NL.IMBAG/0599-f3", "w9-f1", "w10-f2"],
        "demo-streets": ["s9", "s10", "s/11"],
        "demo-blocks": ["demo"],
        "demo-runs": ["demo-SNAP"],
        "demo-models": ["network"],
    }
    for collection in collections.values():
        assert isinstance(collection, pystac.Collection)
        assert collection.get_root() is root
        assert all(item.get_collection() is collection for item in collection.get_items())
        boxes = [shapely.box(*item.bbox) for item in collection.get_items() if item.bbox]
        if boxes:
            assert collection.extent.spatial.bboxes[0] == list(shapely.unary_union(boxes).bounds)
        assert collection.extent.temporal.intervals == [[datetime(2026, 11, 1, 12, 30, tzinfo=UTC), MADE]]
    facades = collections["demo-facades"]
    assert facades.summaries.get_list("streetloom:status") == ["done", "failed"]
    assert set(facades.assets) == {"items", "model", "report", "store", "mirror"}
    assert collections["demo-models"].extent.spatial.bboxes == [[-180, -90, 180, 90]]


def test_an_item_says_what_its_row_does(out: Path) -> None:
    stac = out / "published" / "SNAP" / "stac"
    item = json.loads((stac / "facades" / "w9" / "w9-f1.json").read_text(encoding="utf-8"))
    found = query(out, where="id = 'w9-f1' AND kind = 'facade'").iloc[0]
    assert item["bbox"] == pytest.approx([found.xmin, found.ymin, found.xmax, found.ymax], abs=1e-7)
    said = item["properties"]
    assert said["datetime"] == "2026-11-01T12:30:00Z"
    assert (said["proj:code"], said["proj:bbox"]) == ("EPSG:32635", [385_700, 6_671_700, 385_715, 6_671_704.25])
    assert said["proj:geometry"]["coordinates"][1] == [385_715, 6_671_704.25]
    assert said["processing:software"] == {"streetloom": "0.1.0+ab"}
    assert said["processing:lineage"] == "75% photo, 25% inpainted; from dam-3.jpg"
    assert said["streetloom:floors"] == 6
    assert said["streetloom:street"] == "Itäinen Teatterikuja"
    assert not {"streetloom:layout_score", "streetloom:reason", "streetloom:geometry"} & set(said), (
        "unknown is left out"
    )
    assert {key: (a["type"], a["roles"]) for key, a in item["assets"].items()} == {
        "result": ("image/webp", ["thumbnail", "overview"]),
        "level-0": ("image/webp", ["overview"]),
    }
    failed = json.loads((stac / "facades" / "w10" / "w10-f2.json").read_text(encoding="utf-8"))["properties"]
    assert (failed["streetloom:status"], failed["streetloom:reason"]) == ("failed", "too dark")
    assert "processing:lineage" not in failed


@pytest.mark.parametrize(("kind", "count"), [("facades", 4), ("streets", 3)])
def test_the_mirror_holds_what_the_items_do(out: Path, kind: str, count: int) -> None:
    folder = out / "published" / "SNAP" / "stac" / kind
    table = pq.read_table(folder / "items.parquet")
    assert {"id", "stac_extensions", "geometry", "bbox", "links", "assets"} <= set(table.column_names)
    collection = json.loads((folder / "collection.json").read_text())
    own = collection["assets"].pop("mirror")
    assert (own["href"], own["roles"]) == ("./items.parquet", ["collection-mirror"])
    assert {"assets": {}} | json.loads(table.schema.metadata[b"stac:collection"]) == collection
    frame = gpd.read_parquet(folder / "items.parquet")
    assert len(frame) == count
    assert frame.geometry.name == "geometry"
    assert frame["proj:geometry"].crs == "EPSG:32635"
    hrefs = {link["title"]: link["href"] for link in collection["links"] if link["rel"] == "item"}
    for row in table.to_pylist():
        item = json.loads((folder / hrefs[row["id"]]).read_text())
        for key, value in item["properties"].items():
            if key not in ("datetime", "proj:geometry"):
                assert row[key] == value, key
        assert row["datetime"] == datetime.fromisoformat(item["properties"]["datetime"])
        assert shapely.from_wkb(row["geometry"]) == shapely.geometry.shape(item["geometry"])
        assert list(row["bbox"].values()) == item["bbox"]
        assert [link["rel"] for link in row["links"]] == [link["rel"] for link in item["links"]]
        shown = {key: asset for key, asset in row["assets"].items() if asset and asset["href"]}
        assert set(shown) == set(item["assets"])
        for thing in (*row["links"], *shown.values()):
            assert (folder / thing["href"]).is_file(), thing["href"]


def test_a_facade_leads_to_what_it_is_made_from(tmp_path: Path) -> None:
    parents = "block/demo, building/w1, street/s/11, street/s99, image/a.jpg"
    folder = publish(tmp_path, [row("w1-f1", parents=parents, quality="garbled-inpainting, floors-differ")])
    path = folder / "stac" / "facades" / "w1" / "w1-f1.json"
    item = json.loads(path.read_text())
    assert item["properties"]["streetloom:parents"] == parents
    assert item["properties"]["streetloom:quality"] == "garbled-inpainting, floors-differ"
    origins = [(path.parent / link["href"]).resolve() for link in item["links"] if link["rel"] == "derived_from"]
    assert [json.loads(origin.read_text())["id"] for origin in origins] == ["demo", "s/11"]


def properties(out: Path, name: str) -> dict[str, Any]:
    said = json.loads((out / "published" / "SNAP" / "stac" / name).read_text(encoding="utf-8"))["properties"]
    return {key.removeprefix("streetloom:"): value for key, value in said.items()}


def test_streets(out: Path) -> None:
    said = properties(out, "streets/s9.json")
    for key in ("viewpoints", "viewpoints_done", "key", "seconds", "name"):
        assert said[key] == getattr(STREETS[0], key)
    assert (said["status"], said["length_m"], said["version"], said["deprecated"]) == ("done", 100, "SNAP", False)
    assert said["proj:geometry"]["coordinates"] == [[385_690, 6_671_690], [385_790, 6_671_690]]
    assert properties(out, "streets/s10.json")["reason"] == "visible surfaces changed"
    assert not {"seconds", "key"} & set(properties(out, f"streets/{safe_file_stem('s/11')}.json"))
    collection = json.loads((out / "published" / "SNAP" / "stac" / "streets" / "collection.json").read_text())
    assert collection["description"].endswith(": 1 done, 1 stale, 1 unseen.")
    assert collection["summaries"]["streetloom:viewpoints_done"] == {"minimum": 0, "maximum": 12}


def test_a_street_may_be_called_collection(tmp_path: Path) -> None:
    write_stac(tmp_path, rows=[], facts=SnapshotFacts(facts(), [replace(STREETS[0], id="collection")]))
    folder = tmp_path / "stac" / "streets"
    links = json.loads((folder / "collection.json").read_text())["links"]
    (href,) = [link["href"] for link in links if link["rel"] == "item"]
    assert json.loads((folder / href).read_text())["properties"]["streetloom:kind"] == "street"


def test_the_block(out: Path) -> None:
    block = json.loads((out / "published" / "SNAP" / "stac" / "blocks" / "demo.json").read_text(encoding="utf-8"))
    assert set(block["assets"]) >= {"model", "items", "report", "store", "above", "panorama-0"}
    assert block["assets"]["model"]["type"] == "model/gltf-binary"
    assert block["assets"]["store"]["zarr:zarr_format"] == 3
    said = block["properties"]
    assert said["city3d:city_objects"] == said["streetloom:buildings"] == 3
    assert said["streetloom:settings"] == {"texture.walls": "exemplar", "seed": 7, "geoid_separation": None}
    assert said["streetloom:sources"] == [
        {"key": "buildings.path", "name": "city.osm.pbf", "licence": "ODbL"},
        {"key": "imagery.photos.path", "name": "photos"},
    ]
    assert said["proj:bbox"] == [385_700, 6_671_700, 385_740, 6_671_740]
    assert shapely.geometry.shape(block["geometry"]).exterior.is_ccw


def test_the_run_and_its_models(out: Path) -> None:
    said = properties(out, "runs/run.json")
    assert (said["start_datetime"], said["end_datetime"]) == ("2026-11-21T11:30:00Z", "2026-11-21T12:30:00Z")
    assert (said["units_done"], said["units_failed"], said["units_stale"], said["seconds"]) == (4, 2, 1, 99.13)
    assert said["units"] == RUN.units
    assert (said["config_digest"], said["snapshot"]) == ("cd", "SNAP")
    said = properties(out, "models/network.json")
    assert (said["checksum"], said["trained_on"]) == ("1220" + "ab" * 32, [{"name": "ECP", "licence": "MIT"}])


def test_a_later_snapshot_leads_to_the_earlier_which_says_that_it_is_outdated(tmp_path: Path) -> None:
    publish(tmp_path, [row("w1-f1"), row("w1-f2", 1)], "ONE")
    publish(tmp_path, [row("w1-f1"), row("w1-f3", 1)], "TWO", predecessor="ONE")

    def linked(path: Path, rel: str) -> list[Path]:
        links = json.loads(path.read_text())["links"]
        return [(path.parent / link["href"]).resolve() for link in links if link["rel"] == rel]

    for path, value in stac_files(tmp_path):
        assert problems(value) == [], path
        if value["type"] != "Catalog":
            said = value.get("properties", value)
            snapshot = path.relative_to(tmp_path).parts[1]
            assert (said["version"], said["deprecated"]) == (snapshot, snapshot == "ONE"), path
    for name in (
        "facades/w1/w1-f1.json",
        "facades/collection.json",
        "blocks/demo.json",
        "runs/run.json",
        "streets/s9.json",
    ):
        one, two = (tmp_path / "published" / snapshot / "stac" / name for snapshot in ("ONE", "TWO"))
        assert linked(two, "predecessor-version") == [one.resolve()]
        assert linked(one, "latest-version") == [two.resolve()]
    folder = tmp_path / "published"
    assert linked(folder / "TWO" / "stac" / "facades" / "w1" / "w1-f3.json", "predecessor-version") == []
    assert linked(folder / "ONE" / "stac" / "facades" / "w1" / "w1-f2.json", "latest-version") == []
    before = (folder / "ONE" / "stac" / "facades" / "w1" / "w1-f2.json").stat().st_mtime_ns
    publish(tmp_path, [row("w1-f2")], "THREE", predecessor="TWO")
    assert linked(folder / "ONE" / "stac" / "facades" / "w1" / "w1-f2.json", "latest-version")[0].parts[-5] == "THREE"
    assert (folder / "ONE" / "stac" / "facades" / "w1" / "w1-f2.json").stat().st_mtime_ns > before
    stamps = [path.stat().st_mtime_ns for path, _ in stac_files(tmp_path)]
    write_catalog(tmp_path)
    assert [path.stat().st_mtime_ns for path, _ in stac_files(tmp_path)] == stamps, "nothing is written twice"


def test_same_rows_same_bytes_in_any_order(out: Path, tmp_path: Path) -> None:
    publish(tmp_path / "helsinki", ROWS[::-1])
    for path, _ in stac_files(out):
        other = tmp_path / "helsinki" / path.relative_to(out)
        if path.name != "collection.json":
            assert other.read_bytes() == path.read_bytes(), path
    assert len(list(stac_files(tmp_path))) == len(list(stac_files(out)))


@pytest.mark.parametrize("rows", [[], [aside("w1")]])
def test_a_block_without_facades(tmp_path: Path, rows: list[dict[str, Any]]) -> None:
    folder = publish(tmp_path, rows)
    write_stac(folder, rows=rows, facts=SnapshotFacts(facts(footprint=None)))
    files = dict(stac_files(tmp_path))
    assert [problem for value in files.values() for problem in problems(value)] == []
    assert files[folder / "stac" / "facades" / "collection.json"]["extent"]["spatial"]["bbox"] == [[-180, -90, 180, 90]]
    block = files[folder / "stac" / "blocks" / "demo.json"]
    assert block["geometry"] is None
    assert "bbox" not in block


def test_a_frame_without_a_code_and_places_that_are_none(tmp_path: Path) -> None:
    frame = "+proj=tmerc +lat_0=60.1 +lon_0=24.9 +x_0=385000 +y_0=6671000 +ellps=GRS80 +units=m"
    street = replace(STREETS[0], line=LineString([(float("nan"), 0), (385_690, 6_671_690)]))
    write_stac(tmp_path, rows=[row("w1-f1")], facts=SnapshotFacts(facts(crs=frame, footprint=None), [street]))
    item = json.loads((tmp_path / "stac" / "facades" / "w1" / "w1-f1.json").read_text(encoding="utf-8"))
    assert item["properties"]["proj:code"] is None
    assert item["properties"]["proj:wkt2"].startswith("PROJCRS")
    assert problems(item) == []
    assert item["assets"] == {}
    assert json.loads((tmp_path / "stac" / "blocks" / "demo.json").read_text())["geometry"]["type"] == "LineString"
    assert json.loads((tmp_path / "stac" / "streets" / "s9.json").read_text())["geometry"] is None


def test_a_new_snapshot_and_a_folder_of_runs(tmp_path: Path) -> None:
    publish(tmp_path / "a", [row("w1-f1")], "ONE")
    publish(tmp_path / "city" / "b", [row("w1-f1"), row("w1-f2", 1)])
    (tmp_path / "new" / "store").mkdir(parents=True)
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "current").write_text("../../etc")
    (tmp_path / "city" / "b" / "catalog.json").unlink()
    done = CliRunner().invoke(command_line, ["catalog", str(tmp_path)])
    assert done.exit_code == 0
    assert sorted(line.split(" is left out")[0] for line in done.stderr.splitlines()) == [
        "streetloom: bad",
        "streetloom: new",
    ]
    value = json.loads((tmp_path / "catalog.json").read_text())
    assert problems(value) == []
    assert [link["href"] for link in value["links"] if link["rel"] == "child"] == [
        "./a/catalog.json",
        "./city/b/catalog.json",
    ]

    before = (tmp_path / "catalog.json").read_bytes()
    leads_to_one = (tmp_path / "a" / "catalog.json").read_bytes()
    publish(tmp_path / "a", [row("w1-f1"), row("w1-f2", 1), row("w1-f3", 2)], "TWO")
    root = pystac.Catalog.from_file(str(tmp_path / "catalog.json"))
    facades = [i for i in root.get_items(recursive=True) if i.properties.get("streetloom:kind") == "facade"]
    assert len(facades) == 5, "leads to the new snapshot"
    (tmp_path / "a" / "catalog.json").write_bytes(leads_to_one)
    write_catalog(tmp_path)
    assert "published/TWO/stac" in (tmp_path / "a" / "catalog.json").read_text(), "an old one is mended"
    assert (tmp_path / "catalog.json").read_bytes() == before
    assert not [p for p in tmp_path.rglob("*.tmp")]


def test_nothing_to_catalogue_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing is published there"):
        write_catalog(tmp_path)
    publish(tmp_path / "a", [row("w1-f1")])
    (tmp_path / "a" / "published" / "SNAP" / "stac" / "facades" / "collection.json").unlink()
    with pytest.raises(InputError, match=r"collection.json is missing; `streetloom run"):
        write_catalog(tmp_path / "a")
    (tmp_path / "a" / "catalog.json").unlink()
    with pytest.raises(InputError, match="nothing is published there"):
        write_catalog(tmp_path)
    assert not (tmp_path / "catalog.json").exists()


def test_two_that_publish_at_once(tmp_path: Path) -> None:
    """Whatever the order of its writers, catalog.json is whole and leads to what `current` names."""
    for snapshot in ("S0", "S1"):
        publish(tmp_path, [row("w1-f1")], snapshot)
    stop, torn = threading.Event(), []

    def read() -> None:
        while not stop.is_set():
            try:
                json.loads((tmp_path / "catalog.json").read_text())
            except (OSError, ValueError) as error:
                torn.append(error)

    def write(snapshot: str) -> None:
        for _ in range(20):
            pointer = tmp_path / f".current.{snapshot}"
            pointer.write_text(snapshot)
            pointer.replace(tmp_path / "current")
            write_catalog(tmp_path)

    reader = threading.Thread(target=read)
    writers = [threading.Thread(target=write, args=(snapshot,)) for snapshot in ("S0", "S1")]
    for thread in (reader, *writers):
        thread.start()
    for thread in writers:
        thread.join()
    stop.set()
    reader.join()
    assert torn == []
    links = json.loads((tmp_path / "catalog.json").read_text())["links"]
    assert {link["href"].split("/")[2] for link in links if link["rel"] == "child"} == {
        (tmp_path / "current").read_text()
    }
    assert sorted(p.name for p in tmp_path.iterdir()) == ["catalog.json", "current", "published", "store"]


def test_a_snapshot_published_meanwhile_is_seen(tmp_path: Path) -> None:
    """`current` changes after it was read: the catalogue is written again."""
    found = [SnapshotFolder(publish(tmp_path, [row("w1-f1")], snapshot)) for snapshot in ("ONE", "TWO")]
    answers = iter([*found, found[1]])
    write_catalog(tmp_path, find_snapshot=lambda _: next(answers))
    assert "published/TWO/stac" in (tmp_path / "catalog.json").read_text()


def test_a_picture_is_of_the_longest_unit_that_fits(tmp_path: Path) -> None:
    publish(tmp_path, [row("w1"), row("w1-f1", 1)])
    for unit, folder in (("w1", "w1"), ("w1-f1", "w1")):
        path = tmp_path / "published" / "SNAP" / "stac" / "facades" / folder / f"{unit}.json"
        assert set(json.loads(path.read_text())["assets"]) == {"result", "level-0"}
