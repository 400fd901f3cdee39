"""Buildings as people corrected them, and which of them a correction is of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from catalogs.block.building_corrections import (
    apply_corrections_to_buildings,
    building_ids_by_correction,
    match_corrections_by_location,
    select_corrections_for_buildings,
)
from catalogs.block.corrections import Correction, Corrections
from catalogs.crs import LONLAT, coordinate_transform
from facade_core.core.types import Building, BuildingFinish, BuildingShell, Roof

CRS = "EPSG:32635"
EAST, NORTH = 385_000.0, 6_671_000.0
STOREY = 3.2


def house(id: str, x: float = 0.0, width: float = 10.0) -> Building:
    outline = shapely.box(EAST + x, NORTH, EAST + x + width, NORTH + 8.0)
    return Building(id, outline, 9.0, "height", roof=Roof("gabled", 3.0, pitch=35.0, confidence=0.5))


def said(id: str, **values: object) -> Corrections:
    return Corrections({id: {what: Correction(id, what, value) for what, value in values.items()}})


def correct_building(building: Building, **values: object) -> Building:
    ((found,), left) = apply_corrections_to_buildings([building], said(building.id, **values), STOREY)
    assert not left
    return found


def at(x: float, y: float) -> tuple[float, float]:
    longitude, latitude = coordinate_transform(CRS, LONLAT)(np.array([EAST + x]), np.array([NORTH + y]))
    return float(longitude[0]), float(latitude[0])


def test_heights_are_of_the_eaves_and_an_assumed_roof_stays() -> None:
    building = house("a")
    found = correct_building(building, height=7.004)
    assert (found.height, found.roof) == (7.0, building.roof)
    assumed = replace(building, height_source="default")
    assert correct_building(assumed, levels=2.0).height == pytest.approx(6.4)
    assert correct_building(building, levels=2.0) == replace(building, levels=2), "what is stated is no guess"
    assert correct_building(assumed, levels=2.0, height=8.0).height == 8.0
    on_top = replace(assumed, raised=6.4)
    assert correct_building(on_top, levels=1.0).height == pytest.approx(9.6)


def test_roofs() -> None:
    building = house("a")
    assert correct_building(building, roof_shape="hipped").roof == Roof("hipped", 3.0)
    assert correct_building(building, roof_height=2.0).roof == Roof("gabled", 2.0)
    assert correct_building(building, roof_shape="gabled").roof == replace(building.roof, confidence=1.0)  # type: ignore[type-var]
    assert correct_building(building, roof_shape="flat").roof == Roof("flat", 0.0)
    flat = replace(building, roof=Roof("flat", 0.0))
    raised = correct_building(flat, roof_shape="gabled").roof
    assert raised is not None
    assert raised.height == pytest.approx(4 * np.tan(np.radians(30)), abs=0.01)


def test_a_colour_goes_with_the_material_that_it_came_with() -> None:
    building = replace(house("a"), finish=BuildingFinish((150, 84, 66), (158, 66, 50), "brick", "roof_tiles"))
    assert correct_building(building, wall_material="plaster").finish == replace(
        building.finish, wall_material="plaster", wall_colour=None
    )
    assert correct_building(building, roof_material="slate").finish.roof_colour == (158, 66, 50), "stated by itself"
    assert correct_building(building, wall_colour="#102030").finish.wall_colour == (24, 32, 48), "paint is never black"


def test_what_cannot_be_is_left_and_told() -> None:
    empty = BuildingShell(np.zeros((0, 3)), *(np.zeros(0) for _ in range(4)))  # type: ignore[arg-type]
    model = replace(house("m"), shell=empty, height_source="model", roof=None)
    (found,), left = apply_corrections_to_buildings([model], said("m", height=5.0, wall_material="brick"), STOREY)
    assert (found.height, found.finish.wall_material) == (9.0, "brick")
    assert "(m)" in left[0]
    above = replace(house("a"), raised=8.0)
    (found,), left = apply_corrections_to_buildings([above], said("a", height=8.5), STOREY)
    assert (found.height, len(left)) == (9.0, 1)


def test_whose_a_correction_is() -> None:
    buildings = [house("a"), house("b", 10.0), house("c", 40.0)]
    of = {
        "gone": Correction("gone", "height", 5.0, at(15.0, 4.0)),
        "shed": Correction("shed", "height", 5.0, at(21.5, 4.0)),  # it stood beside b
        "a-0": Correction("a-0", "facade", False, at(5.0, 0.0)),
        "w-1": Correction("w-1", "facade", False, at(51.0, 4.0)),
        "b-2": Correction("b-2", "facade", False, at(45.0, 8.0)),  # b is elsewhere now
        "x-0": Correction("x-0", "facade", False, at(30.0, 90.0)),
        "c": Correction("c", "levels", 3.0),
    }
    corrections = Corrections({id: {one.kind: one} for id, one in of.items()})
    assert match_corrections_by_location(buildings, corrections, CRS) == {"gone": "b"}
    owners = {"gone": "b", "shed": "", "a-0": "a", "w-1": "c", "b-2": "c", "x-0": "", "c": "c"}
    assert building_ids_by_correction(corrections, buildings, CRS) == owners
    known = corrections.rename_targets({"gone": "b"})
    assert set(select_corrections_for_buildings(known, ["b"], buildings, CRS).by_target) == {"b"}
    assert select_corrections_for_buildings(known, ["b"], buildings, CRS).new_ids == {"gone": "b"}
    assert set(select_corrections_for_buildings(known, ["c"], buildings, CRS).by_target) == {"w-1", "b-2", "c"}
