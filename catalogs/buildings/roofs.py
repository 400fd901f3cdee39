"""Assumed roofs of buildings that state none, each with a confidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b

import numpy as np
import shapely

from catalogs.buildings.settings import ROOFS
from catalogs.features import Footprint
from facade_core.core.types import Building, Roof

# Values of the OpenStreetMap tag `building` by their most frequent roof.
FLAT_ROOF_USES = frozenset(
    [
        "industrial",
        "warehouse",
        "retail",
        "supermarket",
        "commercial",
        "parking",
        "hospital",
        "train_station",
        "transportation",
        "glasshouse",
        "greenhouse",
        "stadium",
        "sports_hall",
        "sports_centre",
        "grandstand",
        "hangar",
        "bunker",
        "storage_tank",
        "silo",
        "kiosk",
        "atrium",
        "container",
    ]
)
SHED_USES = frozenset(("shed", "garage", "garages", "carport", "hut", "service", "utility", "entrance"))
CHURCH_USES = frozenset(("church", "cathedral", "chapel", "basilica", "monastery"))


def add_assumed_roofs(buildings: Sequence[Building], footprints: Sequence[Footprint | None]) -> tuple[Building, ...]:
    """Add a roof to buildings without one, except models and unknown heights (0).

    A stated height reaches to the ridge, so the assumed roof is subtracted. Stated heights of the eaves, assumed heights and
    those from floor counts reach to the eaves, so the roof is added on top. The roof depends on the building and on whether
    it has neighbours; the hash of the id decides between likely roofs.

    Parameters
    ----------
    buildings : n buildings.
    footprints : (n,) footprint that each building comes from, or None.
    """
    tree = shapely.STRtree([building.footprint for building in buildings])
    roofed = []
    for index, (building, source) in enumerate(zip(buildings, footprints, strict=True)):
        if source is not None and building.roof is None and building.height > 0:
            near = tree.query(building.footprint, predicate="dwithin", distance=ROOFS.attached_distance_m)
            building = add_assumed_roof(building, source, attached=any(other != index for other in near))
        roofed.append(building)
    return tuple(roofed)


def add_assumed_roof(building: Building, footprint: Footprint, *, attached: bool) -> Building:
    """Add the likeliest roof to a building of known height.

    Parameters
    ----------
    building : building without a roof.
    footprint : footprint that the building comes from.
    attached : True where a neighbour touches the building.
    """
    roof = likeliest_roof(building, footprint, attached=attached)
    if building.height_source != "height" or footprint.roof_height is not None or footprint.is_eaves_height:
        return replace(building, roof=roof)
    walls = building.height - roof.height
    if walls < ROOFS.min_wall_m:
        return replace(building, roof=Roof("flat", 0.0, confidence=roof.confidence))
    return replace(building, height=round(walls, 2), roof=roof)


def likeliest_roof(building: Building, footprint: Footprint, *, attached: bool) -> Roof:
    """Return the likeliest roof of a building; a stated roof height is kept.

    The confidence is a judgement of how often the rule is right.

    Parameters
    ----------
    building : building of known height.
    footprint : footprint that the building comes from.
    attached : True where a neighbour touches the building.
    """
    outline, height = building.footprint, building.height
    depth = float(shapely.maximum_inscribed_circle(outline, tolerance=0.1).length)
    one, two = hash_uniform_pair(building.id)
    kind = footprint.use or ""

    def sloped(shape: str, pitches: tuple[float, float], most: float, confidence: float) -> Roof:
        pitch = round(pitches[0] + one * (pitches[1] - pitches[0]), 1)
        rise = (
            min(most, depth * math.tan(math.radians(pitch))) if footprint.roof_height is None else footprint.roof_height
        )
        if footprint.roof_height is not None:
            pitch = round(min(max(pitch, math.degrees(math.atan2(rise, depth))), 70.0), 1)
        return Roof(shape, round(rise, 2), pitch=pitch, confidence=confidence)

    def flat(confidence: float) -> Roof:
        return Roof("flat", 0.0, confidence=confidence)

    if footprint.roof_height is not None and footprint.roof_height > 0:
        return sloped(
            "gabled", ROOFS.row_pitch_range_deg if attached else ROOFS.house_pitch_range_deg, ROOFS.max_row_roof_m, 0.6
        )
    if footprint.roof_height == 0 or kind in FLAT_ROOF_USES:
        return flat(0.8)
    if kind in CHURCH_USES:
        return sloped("gabled", (ROOFS.church_pitch_deg, ROOFS.church_pitch_deg), ROOFS.max_church_roof_m, 0.6)
    if kind in SHED_USES or outline.area < ROOFS.max_shed_area_m2 or depth < ROOFS.max_shed_half_depth_m:
        rise = min(2 * depth * math.tan(math.radians(ROOFS.shed_pitch_deg)), ROOFS.max_shed_roof_m)
        return Roof("skillion", round(rise, 2), confidence=0.4) if one < 0.5 else flat(0.4)
    if (
        (footprint.year_built or 0) >= ROOFS.flat_roof_since_year
        or depth > ROOFS.max_pitched_half_depth_m
        or height > ROOFS.max_pitched_height_m
    ):
        return flat(0.6)
    if height < 2 * ROOFS.min_wall_m and outline.area > ROOFS.min_hall_area_m2:
        return flat(0.5)
    if not attached and outline.area < ROOFS.max_house_area_m2 and height < ROOFS.max_house_height_m:
        return sloped("gabled", ROOFS.house_pitch_range_deg, ROOFS.max_row_roof_m, 0.5)
    confidence = 0.5 if attached else 0.4
    if two < ROOFS.mansard_share and depth >= ROOFS.min_mansard_half_depth_m:
        return Roof("mansard", ROOFS.mansard_roof_m, pitch=ROOFS.mansard_pitch_deg, confidence=confidence)
    return sloped(
        "hipped" if two < ROOFS.mansard_share + ROOFS.hipped_share else "gabled",
        ROOFS.row_pitch_range_deg,
        ROOFS.max_row_roof_m,
        confidence,
    )


def hash_uniform_pair(building_id: str) -> tuple[float, float]:
    """Return two uniform numbers in [0, 1) by the hash of an id."""
    digest = np.frombuffer(blake2b(building_id.encode(errors="surrogatepass"), digest_size=8).digest(), np.uint32)
    return float(digest[0]) / 2**32, float(digest[1]) / 2**32
