"""Roofs where none are stated: assumed from what is known of a building and its neighbours, and said to be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b

import numpy as np
import shapely

from catalogs.features import Footprint
from facade_core.core.types import Building, Roof

# Uses of a building, as OpenStreetMap has them, by the roof that they mostly have.
FLAT = frozenset(
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
SHEDS = frozenset(("shed", "garage", "garages", "carport", "hut", "service", "utility", "entrance"))
CHURCHES = frozenset(("church", "cathedral", "chapel", "basilica", "monastery"))
# From this year on, over wings deeper than this (half their depth, metres), or over walls higher than this, roofs are flat.
FLAT_SINCE, DEEP, TALL = 1945, 15.0, 30.0
# Sheds cover less than this (m2) or are less deep; halls of one storey are flat from the second figure on.
SHED_M2, SHED_DEPTH, HALL_M2 = 30.0, 2.0, 200.0
# Houses that stand alone, up to this: gables of these pitches. Others have the pitches of a row along a street.
HOUSE_M2, HOUSE_HEIGHT = 400.0, 11.0
HOUSE_PITCH, ROW_PITCH = (32.0, 42.0), (24.0, 34.0)
STEEP_PITCH, CHURCH_PITCH, SHED_PITCH = 66.0, 45.0, 8.0
# How high a roof is at most, over a row, a church, a shed; what is deeper has a flat middle.
ROW_RISE, CHURCH_RISE, SHED_RISE, MANSARD_RISE = 5.0, 12.0, 1.0, 4.4
# Of a row's roofs these shares are mansards (where they are deep enough for one) and hipped; the others have gables.
MANSARDS, HIPPED, MANSARD_DEPTH = 0.2, 0.15, 6.7
# No roof is taken off walls that are then lower than this.
LEAST_WALL = 2.5
# Neighbours stand nearer than this.
BESIDE_M = 0.3


def with_roofs(buildings: Sequence[Building], stated: Sequence[Footprint | None]) -> tuple[Building, ...]:
    """The buildings with a roof each, but for those with a model, or of which no height is known yet (0); `stated` (n,) is what
    a source says of each.

    A stated height is one to the ridge: an assumed roof is taken off it. Heights from storeys, and assumed ones, are to the
    eaves: the roof comes on top. What is assumed is a function of the building and of whether it has neighbours; where several
    roofs are likely, its id decides.
    """
    tree = shapely.STRtree([building.footprint for building in buildings])
    roofed = []
    for index, (building, source) in enumerate(zip(buildings, stated, strict=True)):
        if source is not None and building.roof is None and building.height > 0:
            near = tree.query(building.footprint, predicate="dwithin", distance=BESIDE_M)
            building = under_roof(building, source, attached=any(other != index for other in near))
        roofed.append(building)
    return tuple(roofed)


def under_roof(building: Building, source: Footprint, *, attached: bool) -> Building:
    """A building of known height with the roof that is assumed."""
    roof = assumed(building, source, attached=attached)
    if building.height_source != "height" or source.roof_height is not None:
        return replace(building, roof=roof)
    walls = building.height - roof.height
    if walls < LEAST_WALL:
        return replace(building, roof=Roof("flat", 0.0, confidence=roof.confidence))
    return replace(building, height=round(walls, 2), roof=roof)


def assumed(building: Building, source: Footprint, *, attached: bool) -> Roof:
    """The likeliest roof of a building.

    confidence: how often such a rule is right, as a judgement. A height that is stated of a roof is kept.
    """
    outline, height = building.footprint, building.height
    depth = float(shapely.maximum_inscribed_circle(outline, tolerance=0.1).length)
    one, two = chances(building.id)
    kind = source.kind or ""

    def sloped(shape: str, pitches: tuple[float, float], most: float, confidence: float) -> Roof:
        pitch = round(pitches[0] + one * (pitches[1] - pitches[0]), 1)
        rise = min(most, depth * math.tan(math.radians(pitch))) if source.roof_height is None else source.roof_height
        if source.roof_height is not None:
            pitch = round(min(max(pitch, math.degrees(math.atan2(rise, depth))), 70.0), 1)
        return Roof(shape, round(rise, 2), pitch=pitch, confidence=confidence)

    def flat(confidence: float) -> Roof:
        return Roof("flat", 0.0, confidence=confidence)

    if source.roof_height is not None and source.roof_height > 0:
        return sloped("gabled", ROW_PITCH if attached else HOUSE_PITCH, ROW_RISE, 0.6)
    if source.roof_height == 0 or kind in FLAT:
        return flat(0.8)
    if kind in CHURCHES:
        return sloped("gabled", (CHURCH_PITCH, CHURCH_PITCH), CHURCH_RISE, 0.6)
    if kind in SHEDS or outline.area < SHED_M2 or depth < SHED_DEPTH:
        rise = min(2 * depth * math.tan(math.radians(SHED_PITCH)), SHED_RISE)
        return Roof("skillion", round(rise, 2), confidence=0.4) if one < 0.5 else flat(0.4)
    if (source.built or 0) >= FLAT_SINCE or depth > DEEP or height > TALL:
        return flat(0.6)
    if height < 2 * LEAST_WALL and outline.area > HALL_M2:
        return flat(0.5)
    if not attached and outline.area < HOUSE_M2 and height < HOUSE_HEIGHT:
        return sloped("gabled", HOUSE_PITCH, ROW_RISE, 0.5)
    confidence = 0.5 if attached else 0.4
    if two < MANSARDS and depth >= MANSARD_DEPTH:
        return Roof("mansard", MANSARD_RISE, pitch=STEEP_PITCH, confidence=confidence)
    return sloped("hipped" if two < MANSARDS + HIPPED else "gabled", ROW_PITCH, ROW_RISE, confidence)


def chances(id: str) -> tuple[float, float]:
    """Two numbers from 0 to 1 that an id always has."""
    digest = np.frombuffer(blake2b(id.encode(errors="surrogatepass"), digest_size=8).digest(), np.uint32)
    return float(digest[0]) / 2**32, float(digest[1]) / 2**32
