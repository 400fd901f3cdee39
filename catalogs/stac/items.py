"""STAC Items of facades, streets, blocks, runs and models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from numbers import Integral, Real
from typing import TYPE_CHECKING

import shapely

from catalogs.crs import LONLAT
from catalogs.published.columns import BBOX, COLUMNS, ItemRow
from catalogs.stac.facts import BlockFacts, ModelFacts, RunFacts, StreetFacts
from facade_core.core.provenance import PROVENANCE, Provenance

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

# STAC's processing level of model output from measurements.
PROCESSING_LEVEL = "L4"
# Columns that a STAC field or the geometry states.
_NON_PROPERTY_COLUMNS = {"id", "geometry", *BBOX, "updated", "code_version"}
ITEM_PROPERTIES = tuple(column.name for column in COLUMNS if column.name not in _NON_PROPERTY_COLUMNS)
_SHARE_COLUMNS = PROVENANCE[: Provenance.MATERIAL : -1]


_STREET_PROPERTIES = ("name", "reason", "viewpoints", "viewpoints_done", "seconds", "key")


@dataclass(frozen=True, slots=True)
class ItemGeometry:
    """Geometry in degrees and in the block's frame; None without a location."""

    lonlat: BaseGeometry | None
    in_frame: BaseGeometry | None


NOWHERE = ItemGeometry(None, None)


@dataclass(frozen=True, slots=True)
class FacadeFootLine:
    """Row of a facade, and its foot line in degrees and in the block's frame."""

    row: ItemRow
    lonlat: LineString
    in_frame: LineString


def facade_item(foot: FacadeFootLine, facts: BlockFacts) -> Item:
    """Build the Item of a facade."""
    row = foot.row
    item = _new_item(
        row["id"], "facades", facts, ItemGeometry(foot.lonlat, foot.in_frame), row["updated"], row["code_version"]
    )
    item.properties["title"] = " ".join(filter(None, (row["street"], row["id"])))
    _add_fields(item, {key: row[key] for key in ITEM_PROPERTIES})
    if lineage := _lineage_text(row):
        item.properties["processing:lineage"] = lineage
    return item


def street_item(street: StreetFacts, place: ItemGeometry, facts: BlockFacts) -> Item:
    """Build the Item of a street."""
    item = _new_item(street.id, "streets", facts, place, street.updated or facts.updated)
    item.properties["title"] = street.name or street.id
    _add_fields(
        item,
        {
            "block": facts.name,
            "kind": "street",
            "status": street.state,
            "length_m": round(street.line.length, 2),
            **{name: getattr(street, name) for name in _STREET_PROPERTIES},
            "config_digest": facts.config_digest,
        },
    )
    return item


def block_item(facts: BlockFacts, place: ItemGeometry) -> Item:
    """Build the Item of a block."""
    item = _new_item(facts.name, "blocks", facts, place, facts.updated)
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
    _add_fields(
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


def run_item(run: RunFacts, facts: BlockFacts, place: ItemGeometry) -> Item:
    """Build the Item of a run."""
    item = _new_item(f"{facts.name}-{facts.snapshot}", "runs", facts, place, run.ended)
    total = {state: sum(stage.get(state, 0) for stage in run.units.values()) for state in ("done", "failed", "stale")}
    item.properties |= {
        "title": f"{facts.name}: run",
        "start_datetime": _format_time(run.started),
        "end_datetime": _format_time(run.ended),
    }
    _add_fields(
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
    """Build the Item of a model."""
    item = _new_item(model.id, "models", facts, NOWHERE, facts.updated)
    item.properties |= {"title": model.title, "license": "other"}
    _add_fields(
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
    """Return the id of a block's Collection of one kind."""
    return f"{block}-{kind}"


def projection_fields(crs: CRS) -> dict[str, str | None]:
    """Return the projection extension's fields for a frame."""
    authority = crs.to_authority(min_confidence=100)
    return {"proj:code": ":".join(authority)} if authority else {"proj:code": None, "proj:wkt2": crs.to_wkt()}


def project_item_geometry(geometry: BaseGeometry | None, crs: CRS) -> ItemGeometry:
    """Return a geometry of the block's frame as a place, without heights.

    NOWHERE if a coordinate is not finite.
    """
    import numpy as np
    from pyproj import Transformer

    if geometry is None or geometry.is_empty:
        return NOWHERE
    own = shapely.force_2d(geometry)
    move = Transformer.from_crs(crs, LONLAT, always_xy=True).transform
    lonlat = shapely.transform(own, move, interleaved=False)
    finite = np.isfinite(shapely.get_coordinates([own, lonlat])).all()
    return ItemGeometry(lonlat, own) if finite else NOWHERE


def to_json_value(value: object) -> object:
    """Return a value as JSON stores it; None if it is unknown or not finite."""
    if isinstance(value, bool):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    return value


def _add_fields(item: Item, fields: Mapping[str, object]) -> None:
    """Add the project's own fields to an Item; unknown values are left out."""
    item.properties |= {
        f"streetloom:{key}": json_value
        for key, value in fields.items()
        if (json_value := to_json_value(value)) is not None
    }


def _new_item(
    identifier: str,
    kind: str,
    facts: BlockFacts,
    place: ItemGeometry,
    updated: datetime,
    code_version: str | None = None,
) -> Item:
    """Build the common part of an Item.

    Geometry is rounded to 7 decimals of a degree (about 1 cm) and to millimetres.
    """
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
            "processing:level": PROCESSING_LEVEL,
            "processing:software": {"streetloom": code_version or facts.code_version},
        },
        stac_extensions=[FILE, PROCESSING, PROJECTION, VERSION],
        collection=collection_id(facts.name, kind),
    )
    item.properties |= projection_fields(CRS.from_user_input(facts.crs))
    if place.lonlat is not None and place.in_frame is not None:
        lonlat, own = (
            shapely.transform(g, lambda xy, d=d: xy.round(d)) for g, d in ((place.lonlat, 7), (place.in_frame, 3))
        )
        item.geometry, item.bbox = shapely.geometry.mapping(lonlat), list(lonlat.bounds)
        item.properties |= {"proj:geometry": shapely.geometry.mapping(own), "proj:bbox": list(own.bounds)}
    return item


def _lineage_text(row: ItemRow) -> str:
    """Return where the texels come from, such as "72 % photo, 28 % inpainted; from dam-3.jpg"."""
    shares = [(share, name) for name in _SHARE_COLUMNS if (share := to_json_value(row[name]))]
    parts = [
        ", ".join(f"{share:.0%} {name}" for share, name in shares),
        f"from {row['source']}" if row["source"] else "",
    ]
    return "; ".join(filter(None, parts))


def _format_time(value: datetime) -> str:
    from pystac.utils import datetime_to_str

    return datetime_to_str(value)
