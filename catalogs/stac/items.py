"""STAC Items of facades, streets, blocks, runs and models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import shapely

from catalogs.crs import LONLAT
from catalogs.published.items import COLUMNS
from catalogs.stac.facts import BlockFacts, ModelFacts, RunFacts, StreetFacts

if TYPE_CHECKING:
    from pyproj import CRS
    from pystac import Item
    from shapely import LineString
    from shapely.geometry.base import BaseGeometry

PROJECTION = "https://stac-extensions.github.io/projection/v2.0.0/schema.json"
FILE = "https://stac-extensions.github.io/file/v2.1.0/schema.json"
PROCESSING = "https://stac-extensions.github.io/processing/v1.1.0/schema.json"
VERSION = "https://stac-extensions.github.io/version/v1.2.0/schema.json"
CITY3D = "https://cityjson.github.io/stac-city3d/v0.2.0/schema.json"
ZARR = "https://stac-extensions.github.io/zarr/v1.0.0/schema.json"

# STAC's name for what models make of measurements.
LEVEL = "L4"
# What a field of STAC's own says, or the geometry.
_ELSEWHERE = {"id", "geometry", "xmin", "ymin", "xmax", "ymax", "updated", "code_version"}
OWN = tuple(column.name for column in COLUMNS if column.name not in _ELSEWHERE)
_SHARES = ("photo", "inpainted", "synthesised", "translated")


@dataclass(frozen=True, slots=True)
class Place:
    """A geometry in degrees and in the block's frame; None where it lies nowhere."""

    lonlat: BaseGeometry | None
    in_frame: BaseGeometry | None


NOWHERE = Place(None, None)


@dataclass(frozen=True, slots=True)
class Foot:
    """A facade's row and its foot line in degrees and in the block's frame."""

    row: Mapping[str, Any]
    lonlat: LineString
    in_frame: LineString


def facade_item(foot: Foot, facts: BlockFacts) -> Item:
    row = foot.row
    item = _item(row["id"], "facades", facts, Place(foot.lonlat, foot.in_frame), row["updated"], row["code_version"])
    item.properties["title"] = " ".join(filter(None, (row["street"], row["id"])))
    _say(item, {key: row[key] for key in OWN})
    if lineage := _lineage(row):
        item.properties["processing:lineage"] = lineage
    return item


def street_item(street: StreetFacts, place: Place, facts: BlockFacts) -> Item:
    item = _item(street.id, "streets", facts, place, street.updated or facts.updated)
    item.properties["title"] = street.name or street.id
    _say(
        item,
        {
            "block": facts.name,
            "kind": "street",
            "name": street.name,
            "status": street.state,
            "reason": street.reason,
            "length_m": round(street.line.length, 2),
            "viewpoints": street.viewpoints,
            "viewpoints_done": street.viewpoints_done,
            "wave": street.wave,
            "texels": street.texels,
            "coverage": street.coverage,
            "seconds": street.seconds,
            "key": street.key,
            "config_digest": facts.config_digest,
        },
    )
    return item


def block_item(facts: BlockFacts, place: Place) -> Item:
    item = _item(facts.name, "blocks", facts, place, facts.updated)
    item.stac_extensions += [CITY3D, ZARR]
    item.properties |= {
        "title": f"{facts.name}: textured model",
        "city3d:version": "2.0",  # of glTF
        "city3d:city_objects": facts.counts["buildings"],
        "city3d:co_types": ["Building"],
        "city3d:textures": True,
    }
    sources = [
        {"key": source.key, "name": source.name} | ({"licence": source.licence} if source.licence else {})
        for source in facts.sources
    ]
    _say(
        item,
        {
            "block": facts.name,
            "kind": "block",
            **facts.counts,
            "settings": dict(facts.settings),
            "sources": sources or None,
            "notes": list(facts.notes) or None,
            "config_digest": facts.config_digest,
        },
    )
    return item


def run_item(run: RunFacts, facts: BlockFacts, place: Place) -> Item:
    item = _item(f"{facts.name}-{facts.snapshot}", "runs", facts, place, run.ended)
    total = {state: sum(stage.get(state, 0) for stage in run.units.values()) for state in ("done", "failed", "stale")}
    item.properties |= {
        "title": f"{facts.name}: run",
        "start_datetime": _time(run.started),
        "end_datetime": _time(run.ended),
    }
    _say(
        item,
        {
            "block": facts.name,
            "kind": "run",
            **{f"units_{state}": count for state, count in total.items()},
            "units": {stage: dict(counts) for stage, counts in run.units.items()},
            "seconds": round(run.seconds, 2),
            "snapshot": facts.snapshot,
            "config_digest": facts.config_digest,
        },
    )
    return item


def model_item(model: ModelFacts, facts: BlockFacts) -> Item:
    item = _item(model.id, "models", facts, NOWHERE, facts.updated)
    item.properties |= {"title": model.title, "license": "other"}
    _say(
        item,
        {
            "kind": "model",
            "file": model.file,
            "size": model.size,
            "checksum": f"1220{model.sha256}",  # a multihash, as the file extension has it for assets
            "trained_on": [{"name": name, "licence": licence} for name, licence in model.trained_on.items()] or None,
        },
    )
    return item


def collection_id(block: str, kind: str) -> str:
    """Of the Collection of facades, streets, blocks, runs or models of a block."""
    return f"{block}-{kind}"


def projection_of(crs: CRS) -> dict[str, Any]:
    """The projection extension's fields for a frame."""
    authority = crs.to_authority(min_confidence=100)
    return {"proj:code": ":".join(authority)} if authority else {"proj:code": None, "proj:wkt2": crs.to_wkt()}


def place_of(geometry: BaseGeometry | None, crs: CRS) -> Place:
    """A geometry of the block's frame, without heights; nowhere where a corner is or becomes no finite number."""
    import numpy as np
    from pyproj import Transformer

    if geometry is None or geometry.is_empty:
        return NOWHERE
    own = shapely.force_2d(geometry)
    move = Transformer.from_crs(crs, LONLAT, always_xy=True).transform
    lonlat = shapely.transform(own, move, interleaved=False)
    finite = np.isfinite(shapely.get_coordinates([own, lonlat])).all()
    return Place(lonlat, own) if finite else NOWHERE


def plain(value: Any) -> Any:
    """A value as JSON has it; None where it is unknown or has no place there."""
    if isinstance(value, bool):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    return value


def _say(item: Item, fields: Mapping[str, Any]) -> None:
    """Add fields of the project's own; what is unknown is left out."""
    item.properties |= {
        f"streetloom:{key}": said for key, value in fields.items() if (said := plain(value)) is not None
    }


def _item(
    identifier: str, kind: str, facts: BlockFacts, place: Place, updated: datetime, code_version: str | None = None
) -> Item:
    """What all Items have; geometry to 7 decimals of a degree (about 1 cm) and to millimetres."""
    import pystac
    from pyproj import CRS

    item = pystac.Item(
        identifier,
        None,
        None,
        updated,
        {
            "version": facts.snapshot,
            "deprecated": False,
            "processing:level": LEVEL,
            "processing:software": {"streetloom": code_version or facts.code_version},
        },
        stac_extensions=[FILE, PROCESSING, PROJECTION, VERSION],
        collection=collection_id(facts.name, kind),
    )
    item.properties |= projection_of(CRS.from_user_input(facts.crs))
    if place.lonlat is not None and place.in_frame is not None:
        lonlat, own = (
            shapely.transform(g, lambda xy, d=d: xy.round(d)) for g, d in ((place.lonlat, 7), (place.in_frame, 3))
        )
        item.geometry, item.bbox = shapely.geometry.mapping(lonlat), list(lonlat.bounds)
        item.properties |= {"proj:geometry": shapely.geometry.mapping(own), "proj:bbox": list(own.bounds)}
    return item


def _lineage(row: Mapping[str, Any]) -> str:
    """Where the texels come from, such as "72 % photo, 28 % inpainted; from dam-3.jpg"."""
    shares = [(share, name) for name in _SHARES if (share := plain(row[name]))]
    parts = [
        ", ".join(f"{share:.0%} {name}" for share, name in shares),
        f"from {row['source']}" if row["source"] else "",
    ]
    return "; ".join(filter(None, parts))


def _time(value: datetime) -> str:
    from pystac.utils import datetime_to_str

    return datetime_to_str(value)
