"""Assumed roofs of buildings that state none, each with a confidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    site = _RoofSite(
        building.footprint.area,
        float(shapely.maximum_inscribed_circle(building.footprint, tolerance=0.1).length),
        building.height,
        attached,
        hash_uniform_pair(building.id),
        footprint.roof_height,
    )
    if footprint.roof_height is not None and footprint.roof_height > 0:
        return site.slope("gabled", ROOFS.row_pitch_range_deg if attached else ROOFS.house_pitch_range_deg, 0.6)
    return site.roof_by_use(footprint.use or "", footprint.year_built or 0) or site.roof_of_row()


@dataclass(frozen=True, slots=True)
class _RoofSite:
    """What the likeliest roof of a building depends on.

    Attributes
    ----------
    area : m2.
    half_depth : radius of the largest inscribed circle, metres.
    height : metres.
    is_attached : a neighbour touches the building.
    chance : two numbers from 0 to 1.
    stated_rise : stated height of the roof, metres; None without.
    """

    area: float
    half_depth: float
    height: float
    is_attached: bool
    chance: tuple[float, float]
    stated_rise: float | None

    def slope(
        self, shape: str, pitches: tuple[float, float], confidence: float, most: float = ROOFS.max_row_roof_m
    ) -> Roof:
        """Return a sloped roof of a pitch in a range, at most so high where its height is not stated."""
        pitch = round(pitches[0] + self.chance[0] * (pitches[1] - pitches[0]), 1)
        if self.stated_rise is None:
            rise = min(most, self.half_depth * math.tan(math.radians(pitch)))
        else:
            rise = self.stated_rise
            pitch = round(min(max(pitch, math.degrees(math.atan2(rise, self.half_depth))), 70.0), 1)
        return Roof(shape, round(rise, 2), pitch=pitch, confidence=confidence)

    def roof_by_use(self, use: str, year: int) -> Roof | None:
        """Return the roof of a use or a size that leave no choice; None for houses of a street."""
        church = (ROOFS.church_pitch_deg, ROOFS.church_pitch_deg)
        if self.stated_rise == 0 or use in FLAT_ROOF_USES:
            return Roof("flat", 0.0, confidence=0.8)
        if use in CHURCH_USES:
            return self.slope("gabled", church, 0.6, ROOFS.max_church_roof_m)
        if use in SHED_USES or self._is_shed:
            rise = min(2 * self.half_depth * math.tan(math.radians(ROOFS.shed_pitch_deg)), ROOFS.max_shed_roof_m)
            skillion = Roof("skillion", round(rise, 2), confidence=0.4)
            return skillion if self.chance[0] < 0.5 else Roof("flat", 0.0, confidence=0.4)
        if year >= ROOFS.flat_roof_since_year or self._is_large:
            return Roof("flat", 0.0, confidence=0.6)
        return Roof("flat", 0.0, confidence=0.5) if self._is_hall else None

    @property
    def _is_shed(self) -> bool:
        return self.area < ROOFS.max_shed_area_m2 or self.half_depth < ROOFS.max_shed_half_depth_m

    @property
    def _is_hall(self) -> bool:
        return self.height < 2 * ROOFS.min_wall_m and self.area > ROOFS.min_hall_area_m2

    @property
    def _is_large(self) -> bool:
        return self.half_depth > ROOFS.max_pitched_half_depth_m or self.height > ROOFS.max_pitched_height_m

    def roof_of_row(self) -> Roof:
        """Return the roof of a house, or of a building in a row along a street."""
        if not self.is_attached and self.area < ROOFS.max_house_area_m2 and self.height < ROOFS.max_house_height_m:
            return self.slope("gabled", ROOFS.house_pitch_range_deg, 0.5)
        confidence, chance = 0.5 if self.is_attached else 0.4, self.chance[1]
        if chance < ROOFS.mansard_share and self.half_depth >= ROOFS.min_mansard_half_depth_m:
            return Roof("mansard", ROOFS.mansard_roof_m, pitch=ROOFS.mansard_pitch_deg, confidence=confidence)
        shape = "hipped" if chance < ROOFS.mansard_share + ROOFS.hipped_share else "gabled"
        return self.slope(shape, ROOFS.row_pitch_range_deg, confidence)


def hash_uniform_pair(building_id: str) -> tuple[float, float]:
    """Return two uniform numbers in [0, 1) by the hash of an id."""
    digest = np.frombuffer(blake2b(building_id.encode(errors="surrogatepass"), digest_size=8).digest(), np.uint32)
    return float(digest[0]) / 2**32, float(digest[1]) / 2**32
