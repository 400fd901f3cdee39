"""Likeliest facade style of the shipped library for a building, by its tags, and by its size where they say nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import shapely

from catalogs.buildings.roofs import SHED_USES
from catalogs.buildings.settings import FACADE_STYLE_RULES as RULES
from catalogs.buildings.settings import ROOFS
from catalogs.features import Footprint
from facade_core.core.types import Building

# Values of the OpenStreetMap tags `building` and `building:material`.
DETACHED_USES = frozenset((
    "detached", "bungalow", "villa", "farm", "cabin", "semidetached_house", "semi", "allotment_house", "houseboat",
    "static_caravan", "ger",
))  # fmt: skip
WORKSHOP_USES = frozenset((
    "industrial", "warehouse", "hangar", "factory", "manufacture", "works", "depot", "storage_tank", "parking", "barn",
    "cowshed", "stable", "sty", "farm_auxiliary", "greenhouse", "glasshouse", "supermarket", "sports_hall", "garages",
))  # fmt: skip
OFFICE_USES = frozenset(("office", "offices", "commercial"))
FLAT_USES = frozenset(("apartments", "residential", "dormitory"))
PUBLIC_USES = frozenset((
    "church", "cathedral", "chapel", "public", "civic", "government", "palace", "museum", "hotel", "university",
    "college", "school", "theatre", "castle",
))  # fmt: skip
METALS = frozenset(("metal", "steel", "metal_plates", "aluminium", "tin"))
CONCRETES = frozenset(("concrete", "reinforced_concrete", "concrete_block", "cement_block", "panel"))
GLASSES = frozenset(("glass", "mirror"))


def add_facade_styles(
    buildings: Sequence[Building], footprints: Mapping[str, Footprint], floor_height: float
) -> tuple[Building, ...]:
    """Return the buildings with the facade style of each.

    Parameters
    ----------
    buildings : n buildings with heights and roofs.
    footprints : footprints that buildings come from, by id.
    floor_height : metres, where a building states no floors.
    """
    tree = shapely.STRtree([building.footprint for building in buildings])
    styled = []
    for building in buildings:
        sources = [footprints[id] for id in (building.id, building.whole_id) if id in footprints]
        near = tree.query(building.footprint, predicate="dwithin", distance=ROOFS.attached_distance_m)
        style = likeliest_facade_style(
            building,
            use=next((one.use for one in sources if one.use), None),
            year=next((one.year_built for one in sources if one.year_built), None),
            attached=any(
                other.whole_id != building.whole_id and other.footprint.area >= ROOFS.max_shed_area_m2
                for other in (buildings[row] for row in near.tolist())
            ),
            floor_height=floor_height,
        )
        styled.append(replace(building, facade_style=style))
    return tuple(styled)


def likeliest_facade_style(
    building: Building, *, use: str | None, year: int | None, attached: bool, floor_height: float
) -> str:
    """Return the likeliest facade style of a building, one of `facade_core.core.facade_styles.FACADE_STYLES`.

    Parameters
    ----------
    building : building with its height and roof.
    use : value of the OpenStreetMap tag `building`; None without one that says more than yes.
    year : year of construction; None where it is unknown.
    attached : True where a neighbour larger than a shed touches the building.
    floor_height : metres, where the building states no floors.
    """
    own_floors = building.levels or max(1, round((building.height - building.raised) / floor_height))
    floors = own_floors + round(building.raised / floor_height)
    stated = _style_by_material(building.finish.wall_material or "", floors, attached=attached)
    if stated is None and use is not None:
        stated = _style_by_use(use, year, floors, attached=attached)
    if stated is None and use in PUBLIC_USES:
        stated = "villa" if floors < RULES.min_street_floors else "perimeter-block"
    return stated or _style_by_size(building, use, year, floors, attached=attached)


def _style_by_material(material: str, floors: int, *, attached: bool) -> str | None:
    """Return the style of a wall's material; None where it leaves a choice."""
    is_low = floors <= RULES.max_house_floors
    if material in GLASSES:
        return "office-glass"
    if material in METALS:
        return "warehouse" if is_low else "office-glass"
    if material == "wood" and is_low:
        return "villa"
    if material == "brick" and attached and floors <= RULES.max_terrace_floors:
        return "brick-terrace"
    return "concrete-slab" if material in CONCRETES and not is_low else None


def _style_by_use(use: str, year: int | None, floors: int, *, attached: bool) -> str | None:
    """Return the style of a use; None where it leaves a choice."""
    is_low = floors <= RULES.max_house_floors
    is_new = (year or 0) >= RULES.first_modern_year or (year is None and not attached)
    if use in WORKSHOP_USES | SHED_USES and floors <= RULES.max_terrace_floors:
        return "warehouse"
    if use in DETACHED_USES and is_low:
        return "villa"
    if use in ("terrace", "house") and floors <= RULES.max_terrace_floors:
        return "brick-terrace" if attached or use == "terrace" else "villa"
    if use in OFFICE_USES and not (is_low and year is None):
        return "office-glass" if is_new else "perimeter-block"
    if use in FLAT_USES and not is_low:
        return "concrete-slab" if is_new else "perimeter-block"
    return None


def _style_by_size(building: Building, use: str | None, year: int | None, floors: int, *, attached: bool) -> str:
    """Return the style by size, neighbours, age and roof."""
    area = building.footprint.area
    is_flat = building.roof is None or building.roof.shape == "flat"
    is_low = floors <= RULES.max_house_floors
    if attached:
        if floors == 1 and area > RULES.max_terrace_area_m2:
            return "warehouse"
        is_house = floors <= RULES.max_terrace_floors and (
            area <= RULES.max_terrace_area_m2 or floors < RULES.min_street_floors
        )
        return "brick-terrace" if is_house else "perimeter-block"
    if is_low and area <= RULES.max_villa_area_m2:
        return "villa"
    if is_low and use in FLAT_USES:
        return "brick-terrace"  # mapped as one outline
    if is_low and area >= RULES.min_hall_area_m2 and is_flat:
        return "warehouse"
    if floors >= RULES.min_slab_floors and is_flat and (year or RULES.first_modern_year) >= RULES.first_modern_year:
        return "concrete-slab"
    return "villa" if floors < RULES.min_street_floors else "perimeter-block"
