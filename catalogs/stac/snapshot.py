"""Static STAC 1.1 of a published snapshot: Items and Collections of each kind."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import shapely

from catalogs.crs import LONLAT
from catalogs.features import natural_sort_key, safe_file_stem
from catalogs.printable_text import escape_invisible_json
from catalogs.published.columns import ItemRow
from catalogs.published.folders import F, Folder, file_sizes, join_path
from catalogs.published.items import transform_foot_lines
from catalogs.stac.assets import (
    block_assets,
    icechunk_store_asset,
    model_card_asset,
    pictures_by_unit,
    report_picture_assets,
    stac_geoparquet_asset,
    tile_assets,
)
from catalogs.stac.collections import COLLECTION_KINDS, build_collection, format_counts
from catalogs.stac.facts import STREET_STATES, BlockFacts, ModelFacts, SnapshotFacts, StreetFacts
from catalogs.stac.items import (
    FacadeFootLine,
    ItemGeometry,
    block_item,
    facade_item,
    model_item,
    project_item_geometry,
    run_item,
    street_item,
)
from catalogs.stac.licences import license_links
from catalogs.stac.parquet import MIRROR_NAME, write_stac_geoparquet

if TYPE_CHECKING:
    from pystac import Asset, Item, Link, STACObject

# A published snapshot has its Collections at stac/<kind>/collection.json.
STAC_FOLDER = "stac"
COLLECTION_FILE = "collection.json"
# Kinds with up to thousands of Items, which are also written to one file.
MIRRORED_KINDS = ("facades", "streets")
# Only on the Item: on a Collection the extension's schema requires these fields of every asset.
_ZARR = {"zarr:node_type": "group", "zarr:zarr_format": 3, "zarr:consolidated": False}
_JSON = "application/json"


def write_stac(
    folder: Path | str,
    *,
    rows: Sequence[ItemRow],
    facts: SnapshotFacts,
    predecessor: str | None = None,
    published: Folder | None = None,
) -> None:
    """Write folder/stac/ for the block in `folder`, which is complete otherwise.

    `folder` is or becomes OUT/published/<snapshot>. The bytes depend only on the arguments and the files. Links are
    relative; the root is OUT/catalog.json (see catalogs.stac.catalog).

    Parameters
    ----------
    rows : as for write_items, geometry in the block's CRS; a facade without a place gets no Item.
    predecessor : snapshot published before; things that it has too are linked as earlier versions.
    published : folder of the predecessor, if it is not next to `folder`.
    """
    from pyproj import CRS

    block, streets, run = facts.block, facts.streets, facts.run
    folder, crs = Path(folder), CRS.from_user_input(block.crs)
    rows = sorted(rows, key=lambda row: natural_sort_key(row["id"]))
    facades = [row for row in rows if row["kind"] == "facade"]
    ends = [row["geometry"] for row in facades]
    feet = [
        FacadeFootLine(row, lonlat, own)
        for row, lonlat, own in zip(
            facades, transform_foot_lines(ends, crs, LONLAT), transform_foot_lines(ends, crs, crs), strict=True
        )
        if lonlat is not None
    ]
    place = project_item_geometry(block.footprint, crs) if block.footprint is not None else _facades_place(feet)
    writer = _StacWriter(folder, block, predecessor, published or folder.parent)

    pictures = pictures_by_unit(folder, [row["id"] for row in facades])
    hrefs = {f"block/{block.name}": f"blocks/{item_file_stem(block.name)}.json"}
    hrefs |= {f"street/{street.id}": f"streets/{item_file_stem(street.id)}.json" for street in streets}
    for foot in feet:
        item = facade_item(foot, block)
        item.assets = report_picture_assets(folder, pictures.get(item.id, ()), "../../../")
        parents = [hrefs[name] for name in (foot.row["parents"] or "").split(", ") if name in hrefs]
        writer.add_item(
            "facades",
            f"facades/{safe_file_stem(foot.row['building'] or 'none')}/{safe_file_stem(item.id)}.json",
            item,
            parents,
        )

    for street in sorted(streets, key=lambda one: natural_sort_key(one.id)):
        item = street_item(street, project_item_geometry(street.line, crs), block)
        writer.add_item("streets", hrefs[f"street/{street.id}"], item, [hrefs[f"block/{block.name}"]])

    shared = block_assets(folder, "../../")
    item = block_item(block, place)
    item.assets = (
        shared | tile_assets(folder, "../../") | report_picture_assets(folder, pictures.get(None, ()), "../../")
    )
    item.assets["store"] = icechunk_store_asset("../../", _ZARR)
    writer.add_item("blocks", hrefs[f"block/{block.name}"], item)
    if run is not None:
        item = run_item(run, block, place)
        item.assets = {key: asset for key, asset in shared.items() if key == "report"}
        writer.add_item("runs", "runs/run.json", item)
    for model in facts.models:
        _add_model(writer, folder, model, block)

    words = _collection_words(rows, facts)
    times = [row["updated"] for row in rows] + [block.updated]
    for kind in COLLECTION_KINDS:
        assets = shared | {"store": icechunk_store_asset("../../")} if kind in ("facades", "blocks") else {}
        writer.write_collection(kind, words[kind], times, assets)


def _add_model(writer: _StacWriter, folder: Path, model: ModelFacts, block: BlockFacts) -> None:
    """Add the Item of a model, with its card beside it."""
    name = safe_file_stem(model.id)
    item = model_item(model, block)
    if model.card is not None:
        (folder / STAC_FOLDER / "models").mkdir(parents=True, exist_ok=True)
        shutil.copyfile(model.card, folder / STAC_FOLDER / "models" / f"{name}.md")
        item.assets = {"card": model_card_asset(folder / STAC_FOLDER / "models", f"{name}.md")}
    writer.add_item("models", f"models/{name}.json", item)


def _collection_words(rows: Sequence[ItemRow], facts: SnapshotFacts) -> dict[str, str]:
    """Return what each Collection holds, in words."""
    facades = [row for row in rows if row["kind"] == "facade"]
    failed = sum(row["status"] == "failed" for row in facades)
    done = {"done": len(facades) - failed, "failed": failed, "other units failed or refused": len(rows) - len(facades)}
    streets = {state: count for state, count in _count_states(facts.streets).items() if count}
    units = facts.run.units.values() if facts.run else ()
    return {
        "facades": format_counts(done),
        "streets": format_counts(streets or {"streets": 0}),
        "blocks": format_counts(facts.block.counts),
        "runs": format_counts({"failed units": sum(counts.get("failed", 0) for counts in units)}),
        "models": format_counts({"models": len(facts.models)}),
    }


def required_collection_files(folder: F) -> list[tuple[str, F]]:
    """Return (kind, path) of the Collections that a published snapshot must have."""
    return [(kind, join_path(folder, f"{STAC_FOLDER}/{kind}/{COLLECTION_FILE}")) for kind in COLLECTION_KINDS]


class _StacWriter:
    """Writer of Items with their links, and then of each kind's Collection."""

    def __init__(self, folder: Path, block: BlockFacts, predecessor: str | None, published: Folder) -> None:
        self.stac, self.block = folder / STAC_FOLDER, block
        self.items: dict[str, list[tuple[str, Item]]] = {kind: [] for kind in COLLECTION_KINDS}
        self.links: dict[str, list[Link]] = {kind: [] for kind in COLLECTION_KINDS}
        self.predecessor = predecessor
        self.earlier_files = (
            file_sizes(join_path(published, f"{predecessor}/{STAC_FOLDER}")).keys() if predecessor else frozenset()
        )

    def add_item(self, kind: str, href: str, item: Item, parents: Sequence[str] = ()) -> None:
        """Write an Item at `href` within stac/; parents: hrefs of Items that it is derived from."""
        import pystac

        up = "../" * href.count("/")
        collection = f"{up}{kind}/{COLLECTION_FILE}"
        item.links = [
            pystac.Link("root", f"{up}../../../catalog.json", _JSON),
            pystac.Link("parent", collection, _JSON),
            pystac.Link("collection", collection, _JSON),
            *(pystac.Link("derived_from", up + parent, "application/geo+json") for parent in parents),
            *self._predecessor_links(href, up, "application/geo+json"),
        ]
        self._save(href, item)
        self.items[kind].append((href.removeprefix(f"{kind}/"), item))
        self.links[kind].append(
            pystac.Link("item", f"./{href.removeprefix(f'{kind}/')}", "application/geo+json", item.id)
        )

    def write_collection(self, kind: str, words: str, times: Sequence[datetime], assets: Mapping[str, Asset]) -> None:
        """Write the Collection of a kind."""
        import pystac
        from pyproj import CRS

        collection = build_collection(kind, [item for _, item in self.items[kind]], self.block, words, times)
        collection.assets = dict(assets)
        href = f"{kind}/{COLLECTION_FILE}"
        collection.links = [
            pystac.Link("root", "../../../../catalog.json", _JSON),
            pystac.Link("parent", "../../../../catalog.json", _JSON),
            *self._predecessor_links(href, "../", _JSON),
            *(license_links(self.block.sources) if kind != "models" else ()),
            *self.links[kind],
        ]
        if kind in MIRRORED_KINDS:
            (self.stac / kind).mkdir(parents=True, exist_ok=True)
            placed = [(href, item) for href, item in self.items[kind] if item.bbox]
            write_stac_geoparquet(
                self.stac / kind / MIRROR_NAME, placed, collection, CRS.from_user_input(self.block.crs)
            )
            collection.assets["mirror"] = stac_geoparquet_asset(self.stac / kind, MIRROR_NAME)
        self._save(href, collection)

    def _predecessor_links(self, href: str, up: str, media_type: str) -> list[Link]:
        """Return a link to the same thing in the snapshot before, if it is present there."""
        import pystac

        if href not in self.earlier_files:
            return []
        return [pystac.Link("predecessor-version", f"{up}../../{self.predecessor}/{STAC_FOLDER}/{href}", media_type)]

    def _save(self, href: str, value: STACObject) -> None:
        path = self.stac / href
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(stac_object_json(value), encoding="utf-8", newline="")


def stac_object_json(value: STACObject) -> str:
    """Return an object as JSON text, links unchanged.

    pystac's own output depends on the installed JSON library.
    """
    return stac_fields_json(value.to_dict(include_self_link=False, transform_hrefs=False))


def stac_fields_json(fields: Mapping[str, object]) -> str:
    """Return the fields of a STAC object as they are written to its file."""
    return escape_invisible_json(json.dumps(fields, indent=1, ensure_ascii=False, allow_nan=False)) + "\n"


def item_file_stem(identifier: str) -> str:
    """Return features.file_stem, but never the stem of the Collection's file."""
    stem = safe_file_stem(identifier)
    return f"{stem}_" if f"{stem}.json" == COLLECTION_FILE else stem


def _facades_place(feet: Sequence[FacadeFootLine]) -> ItemGeometry:
    """Return the convex hull of the facades' foot lines; polygons are anticlockwise."""
    if not feet:
        return ItemGeometry(None, None)
    lines = [foot.lonlat for foot in feet], [foot.in_frame for foot in feet]
    hulls = (shapely.MultiLineString(part).convex_hull for part in lines)
    lonlat, in_frame = (shapely.geometry.polygon.orient(h) if h.geom_type == "Polygon" else h for h in hulls)
    return ItemGeometry(lonlat, in_frame)


def _count_states(streets: Sequence[StreetFacts]) -> dict[str, int]:
    found = Counter(street.state for street in streets)
    return {state: found[state] for state in STREET_STATES}
