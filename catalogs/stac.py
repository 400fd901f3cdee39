"""The catalogue of a published block as STAC 1.1: a Collection, an Item per facade and one for the block's model."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shapely

from catalogs.features import file_stem, natural_order
from catalogs.frames import LONLAT
from catalogs.items import COLUMNS, feet_in
from catalogs.stac_assets import block_assets, picture_assets, pictures_by_unit, store_asset

if TYPE_CHECKING:
    from pyproj import CRS
    from pystac import Collection, Item, Link, STACObject
    from shapely import LineString, MultiLineString
    from shapely.geometry.base import BaseGeometry

# Where a published block has its Collection.
STAC, COLLECTION = "stac", "collection.json"
PROJECTION = "https://stac-extensions.github.io/projection/v2.0.0/schema.json"
FILE = "https://stac-extensions.github.io/file/v2.1.0/schema.json"
PROCESSING = "https://stac-extensions.github.io/processing/v1.1.0/schema.json"
CITY3D = "https://cityjson.github.io/stac-city3d/v0.2.0/schema.json"
ZARR = "https://stac-extensions.github.io/zarr/v1.0.0/schema.json"

# STAC's name for what models make of measurements.
_LEVEL = "L4"
_SHARES = ("photo", "inpainted", "synthesised", "translated")
# What a field of STAC's own says, or the geometry.
_ELSEWHERE = {"id", "geometry", "xmin", "ymin", "xmax", "ymax", "updated", "code_version"}
_OWN = tuple(column.name for column in COLUMNS if column.name not in _ELSEWHERE)
_RANGES = ("height_m", "width_m", "floors", "windows", "window_to_wall", "occluded", "photo")
# The store's asset is described on the Item alone: for a Collection the extension's schema asks it of every asset.
_ZARR = {"zarr:node_type": "group", "zarr:zarr_format": 3, "zarr:consolidated": False}


def write_stac(
    folder: Path | str,
    *,
    rows: Sequence[Mapping[str, Any]],
    block: str,
    crs: Any,
    code_version: str,
    buildings: int,
    updated: datetime | None = None,
) -> None:
    """Write folder/stac/ for the block in `folder`, which is or becomes OUT/published/<snapshot> and holds all else already.

    rows: as for write_items, geometry in `crs` (any user input of pyproj), metres; a row without a place has no Item.
    buildings: how many the model holds. updated: when the model was made; None: the newest row's time.
    The bytes follow from the arguments and the files alone. Links are relative; the root is OUT/catalog.json, see
    catalogs.stac_catalog.
    """
    from pyproj import CRS

    folder, crs = Path(folder), CRS.from_user_input(crs)
    rows = sorted(rows, key=lambda row: natural_order(row["id"]))
    facades = [row for row in rows if row["kind"] == "facade"]
    ends = [row["geometry"] for row in facades]
    feet = [
        _Foot(row, lonlat, own)
        for row, lonlat, own in zip(facades, feet_in(ends, crs, LONLAT), feet_in(ends, crs, crs), strict=True)
        if lonlat is not None
    ]
    times = [row["updated"] for row in rows] + ([updated] if updated else [])
    projection, pictures = _projection(crs), pictures_by_unit(folder, [row["id"] for row in facades])
    shared = block_assets(folder, "../")
    stac = folder / STAC

    links = []
    for foot in feet:
        item = _facade(foot, projection)
        item.assets = picture_assets(folder, pictures.get(item.id, ()), "../../../")
        links.append(_save(stac, f"items/{file_stem(foot.row['building'] or 'none')}/{file_stem(item.id)}.json", item))
    if times:
        made = updated or max(times)
        item = _model(block, feet, projection, code_version, buildings, made)
        item.assets = (
            shared | picture_assets(folder, pictures.get(None, ()), "../") | {"store": store_asset("../", _ZARR)}
        )
        links.insert(0, _save(stac, "model.json", item))

    collection = _collection(block, rows, feet, projection, code_version, times)
    collection.assets = shared | {"store": store_asset("../")}
    collection.add_links(links)
    _save(stac, COLLECTION, collection)


@dataclass(frozen=True, slots=True)
class _Foot:
    """A facade's row and its foot line in degrees and in the block's frame."""

    row: Mapping[str, Any]
    lonlat: LineString
    own: LineString


def _facade(foot: _Foot, projection: Mapping[str, Any]) -> Item:
    row = foot.row
    own = {f"streetloom:{key}": plain for key in _OWN if (plain := _plain(row[key])) is not None}
    item = _item(row["id"], row["block"], row["updated"], row["code_version"], foot.lonlat, foot.own, projection)
    item.properties |= {"title": " ".join(filter(None, (row["street"], row["id"])))} | own
    if lineage := _lineage(row):
        item.properties["processing:lineage"] = lineage
    return item


def _model(
    block: str, feet: Sequence[_Foot], projection: Mapping[str, Any], code_version: str, buildings: int, made: datetime
) -> Item:
    lonlat, own = (shapely.MultiLineString([getattr(foot, frame) for foot in feet]) for frame in ("lonlat", "own"))
    item = _item(f"{block}-model", block, made, code_version, _hull(lonlat), _hull(own), projection)
    item.stac_extensions += [CITY3D, ZARR]
    item.properties |= {
        "title": f"{block}: textured model",
        "streetloom:block": block,
        "streetloom:kind": "block",
        "city3d:version": "2.0",  # of glTF
        "city3d:city_objects": buildings,
        "city3d:co_types": ["Building"],
        "city3d:textures": True,
    }
    return item


def _hull(lines: MultiLineString) -> BaseGeometry:
    """What the lines lie in; a polygon as GeoJSON has it, anticlockwise."""
    hull = lines.convex_hull
    return shapely.geometry.polygon.orient(hull) if hull.geom_type == "Polygon" else hull


def _item(
    identifier: str,
    block: str,
    made: datetime,
    code_version: str,
    lonlat: BaseGeometry,
    own: BaseGeometry,
    projection: Mapping[str, Any],
) -> Item:
    """What all Items have; geometry to 7 decimals of a degree (about 1 cm) and to millimetres."""
    import pystac

    lonlat, own = (shapely.transform(g, lambda xy, d=d: xy.round(d)) for g, d in ((lonlat, 7), (own, 3)))
    placed = not lonlat.is_empty
    item = pystac.Item(
        identifier,
        shapely.geometry.mapping(lonlat) if placed else None,
        list(lonlat.bounds) if placed else None,
        made,
        {"processing:level": _LEVEL, "processing:software": {"streetloom": code_version}},
        stac_extensions=[FILE, PROCESSING, PROJECTION],
        collection=block,
    )
    item.properties |= projection
    if placed:
        item.properties |= {"proj:geometry": shapely.geometry.mapping(own), "proj:bbox": list(own.bounds)}
    return item


def _collection(
    block: str,
    rows: Sequence[Mapping[str, Any]],
    feet: Sequence[_Foot],
    projection: Mapping[str, Any],
    code_version: str,
    times: Sequence[datetime],
) -> Collection:
    import pystac

    facades = [row for row in rows if row["kind"] == "facade"]
    failed, aside = sum(row["status"] == "failed" for row in facades), len(rows) - len(facades)
    # a block without facades lies somewhere on Earth
    box = shapely.total_bounds([foot.lonlat for foot in feet]).round(7).tolist() if feet else [-180, -90, 180, 90]
    interval: list[datetime | None] = [min(times), max(times)] if times else [None, None]
    collection = pystac.Collection(
        block,
        f"Textured facades of the block {block}: {len(facades) - failed} done, {failed} failed, {aside} units set aside.",
        pystac.Extent(pystac.SpatialExtent([box]), pystac.TemporalExtent([interval])),
        title=block,
        stac_extensions=[FILE, PROCESSING, PROJECTION],
        keywords=["facade", "texture", "3d city model"],
        providers=[
            pystac.Provider(
                "Streetloom",
                roles=[pystac.ProviderRole.PROCESSOR],
                extra_fields={"processing:level": _LEVEL, "processing:software": {"streetloom": code_version}},
            )
        ],
        summaries=pystac.Summaries(_summaries(facades) | {key: [value] for key, value in projection.items()}),
    )
    collection.clear_links()
    return collection


def _summaries(facades: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    summaries: dict[str, Any] = {}
    for key in _RANGES:
        if known := [plain for row in facades if (plain := _plain(row[key])) is not None]:
            summaries[f"streetloom:{key}"] = {"minimum": min(known), "maximum": max(known)}
    if facades:
        summaries["streetloom:status"] = sorted({row["status"] for row in facades})
    return summaries


def _lineage(row: Mapping[str, Any]) -> str:
    """Where the texels come from, such as "72 % photo, 28 % inpainted; from dam-3.jpg"."""
    shares = [(share, name) for name in _SHARES if (share := _plain(row[name]))]
    parts = [
        ", ".join(f"{share:.0%} {name}" for share, name in shares),
        f"from {row['source']}" if row["source"] else "",
    ]
    return "; ".join(filter(None, parts))


def _projection(crs: CRS) -> dict[str, Any]:
    authority = crs.to_authority(min_confidence=100)
    return {"proj:code": ":".join(authority)} if authority else {"proj:code": None, "proj:wkt2": crs.to_wkt()}


def _plain(value: Any) -> Any:
    """A value as JSON has it; None where it is unknown or has no place there."""
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    return value


def _save(stac: Path, href: str, value: Item | Collection) -> Link:
    """Write an Item or the Collection at `href` within the folder `stac`, with its links upwards; the link to it."""
    import pystac

    up, json_type = "../" * href.count("/"), "application/json"
    upwards = [pystac.Link("root", f"{up}../../../catalog.json", json_type)]
    if isinstance(value, pystac.Item):
        upwards += [pystac.Link(rel, up + COLLECTION, json_type) for rel in ("parent", "collection")]
    else:
        upwards += [pystac.Link("parent", "../../../catalog.json", json_type)]
    value.links = [*upwards, *value.links]
    path = stac / href
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(to_json(value), encoding="utf-8", newline="")
    return pystac.Link("item", f"./{href}", "application/geo+json", value.id)


def to_json(value: STACObject) -> str:
    """The object as it stands, links unchanged; pystac's own way of writing depends on which JSON library is installed."""
    fields = value.to_dict(include_self_link=False, transform_hrefs=False)
    return json.dumps(fields, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
