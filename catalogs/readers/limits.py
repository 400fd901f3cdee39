"""Limits on the size of files, buildings and texts: input beyond them is a mistake or an attack."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar, overload

import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from catalogs.features import (
    BuildingModel,
    BuildingModels,
    Centreline,
    CentrelinesAndGround,
    Fault,
    Footprint,
    Footprints,
    Remark,
)
from catalogs.printable_text import normal_form
from catalogs.reader_errors import to_single_line
from catalogs.readers.settings import LIMITS
from facade_core.core.errors import InputError

SourceT = TypeVar("SourceT", Footprints, BuildingModels, CentrelinesAndGround)
ItemT = TypeVar("ItemT", Footprint, BuildingModel, Centreline)


@overload
def reject_implausible_items(source: Footprints, path: Path) -> Footprints: ...
@overload
def reject_implausible_items(source: BuildingModels, path: Path) -> BuildingModels: ...
@overload
def reject_implausible_items(source: CentrelinesAndGround, path: Path) -> CentrelinesAndGround: ...
def reject_implausible_items(source: SourceT, path: Path) -> SourceT:
    """Turn items of a source that no block can contain into faults.

    These are ids of unusable length or characters, outlines of too many corners and impossible ground heights. Unprintable
    characters of names are replaced; names and ids are in NFC.

    Raises
    ------
    InputError
        For more than LIMITS.max_features items.
    """
    kind = "street" if isinstance(source, CentrelinesAndGround) else "building"
    if len(source.items) > LIMITS.max_features:
        raise InputError(
            f"{path} holds {len(source.items)} {kind}s, more than {LIMITS.max_features}; cut out the area that is meant"
        )
    source = _simplify_outlines(source)
    reasons = [_limit_violation(item) for item in source.items]
    faults = [replace(f, id=_short_id(f.id), reason=to_single_line(f.reason)) for f in source.faults]
    faults += [
        Fault(_short_id(item.id), kind, f"{path.name}: {reason}", _bounding_box(item))
        for item, reason in zip(source.items, reasons, strict=True)
        if reason
    ]
    items = tuple(_normalize_texts(item) for item, reason in zip(source.items, reasons, strict=True) if not reason)
    return replace(source, items=items, faults=tuple(faults), remarks=_clean_remarks(source.remarks))


def _simplify_outlines(source: SourceT) -> SourceT:
    """Simplify outlines of up to LIMITS.max_corners to LIMITS.max_outline_corners, with a remark."""
    if not isinstance(source, Footprints):
        return source
    items, remarks = list(source.items), list(source.remarks)
    for index, item in enumerate(items):
        corners = shapely.get_num_coordinates(item.outline)
        if item.shell is None and LIMITS.max_outline_corners < corners <= LIMITS.max_corners:
            west, south, east, north = item.outline.bounds
            for share in LIMITS.simplify_shares:
                outline = _simplify_outline(item.outline, share * math.hypot(east - west, north - south))
                if shapely.get_num_coordinates(outline) <= LIMITS.max_outline_corners:
                    items[index] = replace(item, outline=outline)
                    reason = f"outlines of more than {LIMITS.max_outline_corners} corners simplified"
                    remarks.append(Remark(item.id, reason, outline))
                    break
    return replace(source, items=tuple(items), remarks=tuple(remarks))


def _simplify_outline(outline: Polygon | MultiPolygon, tolerance: float) -> Polygon | MultiPolygon:
    """Simplify an outline, and close gaps up to twice the tolerance where too many corners remain."""
    simplified: Polygon | MultiPolygon = outline.simplify(tolerance)
    if shapely.get_num_coordinates(simplified) <= LIMITS.max_outline_corners:
        return simplified
    closed = outline.buffer(tolerance, join_style="mitre").buffer(-tolerance, join_style="mitre")
    closed = closed.simplify(tolerance)
    return closed if closed.geom_type == outline.geom_type and closed.area > 0 else outline


def _normalize_texts(item: ItemT) -> ItemT:
    """Return an item with ids in normal form, and a printable name of at most LIMITS.max_name_length letters."""
    name = None if item.name is None else to_single_line(normal_form(item.name)[: LIMITS.max_name_length]) or None
    item = replace(item, id=normal_form(item.id), name=name)
    if isinstance(item, Footprint) and item.whole_id is not None:
        return replace(item, whole_id=normal_form(item.whole_id))
    return item


def _limit_violation(item: Footprint | BuildingModel | Centreline) -> str | None:
    """Return the violated limit and the remedy; None for an acceptable item."""
    if len(item.id) > LIMITS.max_id_length:
        return f"its id has {len(item.id)} letters, more than {LIMITS.max_id_length}; give it a shorter one"
    if to_single_line(item.id) != item.id:
        return "its id holds what is no letter, such as a line break or half a character; give it another"
    if isinstance(item, Centreline):
        points = shapely.get_num_coordinates(item.line)
        most = LIMITS.max_centreline_points
        return f"it has {points} points, more than {most}; simplify it" if points > most else None
    return _building_violation(item)


def _building_violation(item: Footprint | BuildingModel) -> str | None:
    if isinstance(item, Footprint):
        corners = shapely.get_num_coordinates(item.outline)
        if corners > LIMITS.max_outline_corners:
            return f"its outline has {corners} corners, more than {LIMITS.max_outline_corners}; simplify it"
        if item.height is not None and item.height > LIMITS.max_building_height_m:
            return f"it is {item.height:.6g} m high; check its heights, or remove it"
    if item.base is not None and not LIMITS.min_ground_height_m <= item.base <= LIMITS.max_ground_height_m:
        return f"its ground is at a height of {item.base:.6g} m; mend that, or remove it"
    return None


def _bounding_box(item: Footprint | BuildingModel | Centreline) -> BaseGeometry:
    if isinstance(item, BuildingModel):
        plan = item.shell.vertices[:, :2]
        return shapely.box(*plan.min(axis=0), *plan.max(axis=0))
    shape = item.line if isinstance(item, Centreline) else item.outline
    return shapely.box(*shape.bounds)


def _short_id(id: str) -> str:
    """Return an id shortened for a report."""
    text = to_single_line(id[: LIMITS.max_id_length])
    return text if len(text) <= LIMITS.max_name_length else f"{text[:40]}..."


def _clean_remarks(remarks: Iterable[Remark]) -> tuple[Remark, ...]:
    return tuple(replace(remark, id=_short_id(remark.id), reason=to_single_line(remark.reason)) for remark in remarks)
