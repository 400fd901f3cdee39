"""Centrelines from the lines of any source, one per part and street."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from catalogs.features import Centreline, CentrelinesAndGround, Fault
from catalogs.reader_errors import fault_reason
from catalogs.readers.settings import LIMITS, VECTORS


def build_centrelines(
    crs: str | None, features: Iterable[tuple[str, BaseGeometry | None, str | None, Mapping[str, str]]]
) -> CentrelinesAndGround:
    """Build centrelines from (id, geometry, name, OpenStreetMap tags).

    Parts of one geometry become id-0, id-1, ...; the two directions of a street are merged. Features without a geometry, a
    length or finite coordinates are faults.
    """
    items: dict[bytes, Centreline] = {}
    faults = []
    for id, geometry, name, tags in features:
        parts = [part for part in shapely.get_parts(geometry) if not part.is_empty]
        if not parts:
            faults.append(Fault(id, "street", f"centreline {id} has no geometry; draw it, or remove it"))
        for index, part in enumerate(parts):
            part_id = id if len(parts) == 1 else f"{id}-{index}"
            try:
                reason = _find_defect(part)
                line = shapely.force_2d(part)
                key = shapely.normalize(
                    shapely.transform(line, lambda xy: np.round(xy / VECTORS.duplicate_tolerance))
                ).wkb
            except Exception as error:  # an error of GEOS affects this line only
                reason = fault_reason(error)
            if reason:
                faults.append(Fault(part_id, "street", f"centreline {part_id} {reason}", finite_points(part)))
            else:
                passage = tags if is_building_passage(tags) else None
                items.setdefault(key, Centreline(part_id, line, name, passage))
    return CentrelinesAndGround(crs, tuple(items.values()), tuple(faults))


def is_building_passage(tags: Mapping[str, str]) -> bool:
    """Return True for a way through a building."""
    return re.sub(r"[\s-]+", "_", tags.get("tunnel", "").strip().lower()) == "building_passage"


def _find_defect(part: BaseGeometry) -> str | None:
    if part.geom_type not in ("LineString", "LinearRing"):
        return f"is a {part.geom_type}, no line; draw it as a line, or remove it"
    if not (np.abs(shapely.get_coordinates(part)) < LIMITS.max_coordinate).all():
        return "has a coordinate that is no finite number, or absurdly far away; mend or remove it"
    if not part.length > 0:
        return "has no length; draw it longer, or remove it"
    return None


def finite_points(geometry: BaseGeometry) -> BaseGeometry | None:
    """Return the vertices of a geometry with finite coordinates; None without any."""
    points = shapely.get_coordinates(geometry)
    points = points[np.isfinite(points).all(axis=1)]
    return shapely.multipoints(points) if len(points) else None
