"""The catalogue of a published snapshot as STAC 1.1: Collections of facades, streets, blocks, runs and models."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shapely

from catalogs.crs import LONLAT
from catalogs.features import file_stem, natural_sort_key
from catalogs.printable_text import escape_invisible_json
from catalogs.published.folders import F, Folder, at, sizes_in
from catalogs.published.items import feet_in
from catalogs.stac.assets import (
    block_assets,
    card_asset,
    mirror_asset,
    picture_assets,
    pictures_by_unit,
    store_asset,
    tile_assets,
)
from catalogs.stac.collections import KINDS, collection_of, counted
from catalogs.stac.facts import STATES, BlockFacts, ModelFacts, RunFacts, StreetFacts
from catalogs.stac.items import (
    Foot,
    Place,
    block_item,
    facade_item,
    model_item,
    place_of,
    run_item,
    street_item,
)
from catalogs.stac.licences import license_links
from catalogs.stac.parquet import MIRROR, write_mirror

if TYPE_CHECKING:
    from pystac import Item, Link, STACObject

# Where a published snapshot has its Collections: stac/<kind>/collection.json.
STAC, COLLECTION = "stac", "collection.json"
# Kinds of which there may be thousands, and whose Items are also in one file.
MIRRORED = ("facades", "streets")
# The store's asset is described on the Item alone: for a Collection the extension's schema asks it of every asset.
_ZARR = {"zarr:node_type": "group", "zarr:zarr_format": 3, "zarr:consolidated": False}
_JSON = "application/json"


def write_stac(
    folder: Path | str,
    *,
    rows: Sequence[Mapping[str, Any]],
    block: BlockFacts,
    streets: Sequence[StreetFacts] = (),
    run: RunFacts | None = None,
    models: Sequence[ModelFacts] = (),
    predecessor: str | None = None,
    published: Folder | None = None,
) -> None:
    """Write folder/stac/ for the block in `folder`, which is or becomes OUT/published/<snapshot> and holds all else already.

    rows: as for write_items, geometry in the block's CRS, metres; a facade without a place has no Item.
    predecessor: the snapshot published before, beside this one: what it has too is linked as an earlier version. published:
    where it lies, where that is not beside `folder` yet.
    The bytes follow from the arguments and the files alone. Links are relative; the root is OUT/catalog.json, see
    catalogs.stac.catalog.
    """
    from pyproj import CRS

    folder, crs = Path(folder), CRS.from_user_input(block.crs)
    rows = sorted(rows, key=lambda row: natural_sort_key(row["id"]))
    facades = [row for row in rows if row["kind"] == "facade"]
    ends = [row["geometry"] for row in facades]
    feet = [
        Foot(row, lonlat, own)
        for row, lonlat, own in zip(facades, feet_in(ends, crs, LONLAT), feet_in(ends, crs, crs), strict=True)
        if lonlat is not None
    ]
    place = place_of(block.footprint, crs) if block.footprint is not None else _hull(feet)
    writer = _Writer(folder, block, predecessor, published or folder.parent)

    pictures = pictures_by_unit(folder, [row["id"] for row in facades])
    hrefs = {f"block/{block.name}": f"blocks/{item_stem(block.name)}.json"}
    hrefs |= {f"street/{street.id}": f"streets/{item_stem(street.id)}.json" for street in streets}
    for foot in feet:
        item = facade_item(foot, block)
        item.assets = picture_assets(folder, pictures.get(item.id, ()), "../../../")
        parents = [hrefs[name] for name in (foot.row["parents"] or "").split(", ") if name in hrefs]
        writer.add(
            "facades", f"facades/{file_stem(foot.row['building'] or 'none')}/{file_stem(item.id)}.json", item, parents
        )

    for street in sorted(streets, key=lambda street: natural_sort_key(street.id)):
        item = street_item(street, place_of(street.line, crs), block)
        writer.add("streets", hrefs[f"street/{street.id}"], item, [hrefs[f"block/{block.name}"]])

    shared = block_assets(folder, "../../")
    item = block_item(block, place)
    item.assets = shared | tile_assets(folder, "../../") | picture_assets(folder, pictures.get(None, ()), "../../")
    item.assets["store"] = store_asset("../../", _ZARR)
    writer.add("blocks", hrefs[f"block/{block.name}"], item)
    if run is not None:
        item = run_item(run, block, place)
        item.assets = {key: asset for key, asset in shared.items() if key == "report"}
        writer.add("runs", "runs/run.json", item)
    for model in models:
        name = file_stem(model.id)
        item = model_item(model, block)
        if model.card is not None:
            (folder / STAC / "models").mkdir(parents=True, exist_ok=True)
            shutil.copyfile(model.card, folder / STAC / "models" / f"{name}.md")
            item.assets = {"card": card_asset(folder / STAC / "models", f"{name}.md")}
        writer.add("models", f"models/{name}.json", item)

    failed = sum(row["status"] == "failed" for row in facades)
    words = {
        "facades": counted(
            {"done": len(facades) - failed, "failed": failed, "units set aside": len(rows) - len(facades)}
        ),
        "streets": counted({s: n for s, n in _states(streets).items() if n} or {"streets": 0}),
        "blocks": counted(block.counts),
        "runs": counted({"failed units": sum(counts.get("failed", 0) for counts in run.units.values()) if run else 0}),
        "models": counted({"models": len(models)}),
    }
    times = [row["updated"] for row in rows] + [block.updated]
    for kind in KINDS:
        assets = shared | {"store": store_asset("../../")} if kind in ("facades", "blocks") else {}
        writer.finish(kind, words[kind], times, assets)


def collections_in(folder: F) -> list[tuple[str, F]]:
    """The Collections (kind, path) that a published snapshot's folder must have."""
    return [(kind, at(folder, f"{STAC}/{kind}/{COLLECTION}")) for kind in KINDS]


class _Writer:
    """Writes Items with their links as they come, and then the Collections of each kind."""

    def __init__(self, folder: Path, block: BlockFacts, predecessor: str | None, published: Folder) -> None:
        self.stac, self.block = folder / STAC, block
        self.items: dict[str, list[tuple[str, Item]]] = {kind: [] for kind in KINDS}
        self.links: dict[str, list[Link]] = {kind: [] for kind in KINDS}
        self.predecessor = predecessor
        self.before = sizes_in(at(published, f"{predecessor}/{STAC}")).keys() if predecessor else frozenset()

    def add(self, kind: str, href: str, item: Item, parents: Sequence[str] = ()) -> None:
        """Write an Item at `href` within stac/. parents: Items that it is made from, by theirs."""
        import pystac

        up = "../" * href.count("/")
        collection = f"{up}{kind}/{COLLECTION}"
        item.links = [
            pystac.Link("root", f"{up}../../../catalog.json", _JSON),
            pystac.Link("parent", collection, _JSON),
            pystac.Link("collection", collection, _JSON),
            *(pystac.Link("derived_from", up + parent, "application/geo+json") for parent in parents),
            *self._earlier(href, up, "application/geo+json"),
        ]
        self._save(href, item)
        self.items[kind].append((href.removeprefix(f"{kind}/"), item))
        self.links[kind].append(
            pystac.Link("item", f"./{href.removeprefix(f'{kind}/')}", "application/geo+json", item.id)
        )

    def finish(self, kind: str, words: str, times: Sequence[datetime], assets: Mapping[str, Any]) -> None:
        """Write the Collection of a kind."""
        import pystac
        from pyproj import CRS

        collection = collection_of(kind, [item for _, item in self.items[kind]], self.block, words, times)
        collection.assets = dict(assets)
        href = f"{kind}/{COLLECTION}"
        collection.links = [
            pystac.Link("root", "../../../../catalog.json", _JSON),
            pystac.Link("parent", "../../../../catalog.json", _JSON),
            *self._earlier(href, "../", _JSON),
            *(license_links(self.block.sources) if kind != "models" else ()),
            *self.links[kind],
        ]
        if kind in MIRRORED:
            (self.stac / kind).mkdir(parents=True, exist_ok=True)
            placed = [(href, item) for href, item in self.items[kind] if item.bbox]
            write_mirror(self.stac / kind / MIRROR, placed, collection, CRS.from_user_input(self.block.crs))
            collection.assets["mirror"] = mirror_asset(self.stac / kind, MIRROR)
        self._save(href, collection)

    def _earlier(self, href: str, up: str, media_type: str) -> list[Link]:
        """The same thing in the snapshot before, where that is still there and has it."""
        import pystac

        if href not in self.before:
            return []
        return [pystac.Link("predecessor-version", f"{up}../../{self.predecessor}/{STAC}/{href}", media_type)]

    def _save(self, href: str, value: STACObject) -> None:
        path = self.stac / href
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(to_json(value), encoding="utf-8", newline="")


def to_json(value: STACObject) -> str:
    """The object as it stands, links unchanged; pystac's own way of writing depends on which JSON library is installed."""
    return json_text(value.to_dict(include_self_link=False, transform_hrefs=False))


def json_text(fields: Mapping[str, Any]) -> str:
    """A STAC object's fields as they are written to its file."""
    return escape_invisible_json(json.dumps(fields, indent=1, ensure_ascii=False, allow_nan=False)) + "\n"


def item_stem(identifier: str) -> str:
    """As features.file_stem, but never that of the Collection beside the Item."""
    stem = file_stem(identifier)
    return f"{stem}_" if f"{stem}.json" == COLLECTION else stem


def _hull(feet: Sequence[Foot]) -> Place:
    """What the facades' foot lines lie in; a polygon as GeoJSON has it, anticlockwise."""
    if not feet:
        return Place(None, None)
    lines = [foot.lonlat for foot in feet], [foot.in_frame for foot in feet]
    hulls = (shapely.MultiLineString(part).convex_hull for part in lines)
    lonlat, in_frame = (shapely.geometry.polygon.orient(h) if h.geom_type == "Polygon" else h for h in hulls)
    return Place(lonlat, in_frame)


def _states(streets: Sequence[StreetFacts]) -> dict[str, int]:
    found = Counter(street.state for street in streets)
    return {state: found[state] for state in STATES}
