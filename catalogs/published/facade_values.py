"""Values of a facade's columns: what they are computed from, and the functions that compute them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.provenance import Provenance

if TYPE_CHECKING:
    from facade_core.atlas.table_schema import TableValues
    from facade_core.plan.facades import Facades


class FaultMeasure(NamedTuple):
    """Measure of a finished texture in the probability that it is bad.

    Attributes
    ----------
    field : field of the journal record.
    weight : weight in the log odds.
    usual : mean of good walls.
    """

    field: str
    weight: float
    usual: float


# Logistic regression of walls that were judged bad by eye: `python -m benchmarks.texture_faults` fits it.
FAULT_OFFSET = -2.05
FAULT_MEASURES: Mapping[str, FaultMeasure] = {
    "foreign-parts": FaultMeasure("foreign_share", 31.5, 0.01),
    "garbled-inpainting": FaultMeasure("doubtful_inpainting_m", 5.87, 0.11),
}
# Textures that are bad with a larger probability need review.
MAX_GOOD_FAULT_PROBABILITY = 0.4
# Ratio of the proportions of a photo and its wall beyond which the facade needs review: windows look squeezed.
MAX_STRETCH = 1.5
# Flag of a facade whose building has an assumed height.
ASSUMED_HEIGHT = "height-assumed"


class PanoramaPose(NamedTuple):
    """Accuracy of a panorama's refined pose.

    Attributes
    ----------
    residual_deg : median angle between lines on walls and their axes; None without lines.
    apart_m : median distance to what other panoramas show of the same walls; None without shared walls.
    raised_m : refined minus stated height, metres.
    """

    residual_deg: float | None
    apart_m: float | None
    raised_m: float


@dataclass(frozen=True, slots=True)
class FacadeSource:
    """All that the columns of one facade are filled from.

    Attributes
    ----------
    block : name of the block.
    facades : facades of the plan.
    index : index of the facade.
    role : name of the facade's role.
    buildings : the plan's table of buildings.
    street, street_id : name of the facade's street, its id without one; and that id.
    line : (2, 2) ends of the foot line in the block's frame, metres.
    azimuth_deg : direction that the facade faces, clockwise from grid north, degrees.
    record : journal record of the facade, with at least `status`.
    is_building_corrected : whether somebody corrected the building.
    updated : when the facade was finished.
    poses : accuracy of the refined poses by panorama.
    code_version : version of the code that made the block.
    config_digest : digest of inputs and settings.
    """

    block: str
    facades: Facades
    index: int
    role: str
    buildings: TableValues
    street: str
    street_id: str
    line: Float64Array
    azimuth_deg: float
    record: Mapping[str, Any]
    is_building_corrected: bool
    updated: datetime | None
    poses: Mapping[str, PanoramaPose]
    code_version: str
    config_digest: str

    def plan_value(self, name: str) -> Any:
        """Return a value of the plan's table of facades."""
        return getattr(self.facades, name)[self.index]

    def building_value(self, name: str) -> Any:
        """Return a value of the facade's building; None if the table lacks the column."""
        column = self.buildings.get(name)
        return None if column is None else column[int(self.plan_value("building"))]


Fill = Callable[[FacadeSource], object]


def record_field(name: str) -> Fill:
    """Return a function that reads a field of the journal record; None where it is missing."""
    return lambda source: source.record.get(name)


def plan_length(name: str) -> Fill:
    """Return a function that reads a length of the plan's facades, in millimetres' precision."""
    return lambda source: round(float(source.plan_value(name)), 3)


def roof_number(name: str) -> Fill:
    """Return a function that reads a number of the building's roof; None for a roof from a 3D model."""
    return lambda source: round(float(source.building_value(name)), 3) if source.building_value("roof_shape") else None


def provenance_share(provenance: Provenance) -> Fill:
    """Return a function that reads the share of texels of a provenance."""
    return lambda source: source.record["provenance"][provenance] if source.record.get("provenance") else None


def lattice_line_count(direction: str) -> Fill:
    """Return a function that counts the lattice lines of a direction; None without a lattice."""
    return lambda source: len(source.record["lattice"][direction]) if source.record.get("lattice") else None


def largest_pose_value(name: str) -> Fill:
    """Return a function that finds the largest magnitude among the facade's panoramas; None if none has the value."""

    def find_largest(source: FacadeSource) -> float | None:
        parts = (source.record.get("source") or "").split(", ")
        # the name of a panorama may contain a comma
        names = (", ".join(parts[i:j]) for i, j in combinations(range(len(parts) + 1), 2))
        values = (getattr(source.poses[panorama], name) for panorama in names if panorama in source.poses)
        return max((value for value in values if value is not None), key=abs, default=None)

    return find_largest


def count_shown_floors(source: FacadeSource) -> int:
    """Return the floors of a facade: of its picture, and of the map where that shows no windows.

    A back from an exemplar is composed with the floors of the map. Its one door is too small a share of a wide wall to
    mark the ground floor, which the count by rows of windows would then take for two.
    """
    record, levels = source.record, int(source.plan_value("floors"))
    is_composed_back = source.role != "street" and "floors_low" not in record and not record.get("corrected")
    return levels if is_composed_back else record.get("floors") or levels


def list_quality_flags(source: FacadeSource) -> str | None:
    """Return comma-separated reasons to review a facade, "good" without any; None for a facade without a layout."""
    if "elements" not in source.record:
        return None
    return ", ".join(flag for flag, is_raised in QUALITY_CHECKS.items() if is_raised(source)) or "good"


def fault_probability(record: Mapping[str, Any]) -> float:
    """Compute the probability that a finished texture is bad, by the fields of its record; 0 without pictures."""
    if "foreign_share" not in record:
        return 0.0
    odds = FAULT_OFFSET + sum(measure.weight * record[measure.field] for measure in FAULT_MEASURES.values())
    return float(1 / (1 + np.exp(-odds)))


def list_parents(source: FacadeSource) -> str:
    """Return what a facade is made from: its block, building, street and images."""
    images = [f"image/{name}" for name in (source.record.get("source") or "").split(", ") if name]
    building = source.building_value("id")
    return ", ".join([f"block/{source.block}", f"building/{building}", f"street/{source.street_id}", *images])


def _has_no_windows(source: FacadeSource) -> bool:
    return source.role == "street" and not any(element[0] == "window" for element in source.record["elements"])


def _texture_fault(flag: str) -> Callable[[FacadeSource], bool]:
    """Return a function that tells whether a texture is likely bad, and a flag's measure is what says so most."""

    def is_raised(source: FacadeSource) -> bool:
        record = source.record
        if fault_probability(record) <= MAX_GOOD_FAULT_PROBABILITY:
            return False
        return flag == max(FAULT_MEASURES, key=lambda name: _excess_odds(FAULT_MEASURES[name], record))

    return is_raised


def _excess_odds(measure: FaultMeasure, record: Mapping[str, Any]) -> float:
    return measure.weight * (float(record[measure.field]) - measure.usual)


def _do_floors_differ(source: FacadeSource) -> bool:
    floors = source.record.get("floors", 0)
    # bounds of the estimate from pictures
    low, high = source.record.get("floors_low", floors), source.record.get("floors_high", floors)
    return source.role == "street" and floors > 0 and not low <= int(source.plan_value("floors")) <= high


def _is_cut_doubtful(source: FacadeSource) -> bool:
    stretched = source.record.get("stretched", 1.0)
    return not source.record.get("cut_found", True) or not 1 / MAX_STRETCH <= stretched <= MAX_STRETCH


# Flags of `quality`, with what raises them.
QUALITY_CHECKS: Mapping[str, Callable[[FacadeSource], bool]] = {
    **{flag: _texture_fault(flag) for flag in FAULT_MEASURES},
    "no-windows": _has_no_windows,
    "floors-differ": _do_floors_differ,
    "implausible-layout": lambda source: source.role == "street" and bool(source.record.get("implausible")),
    "doubtful-cut": _is_cut_doubtful,
    "rejected-picture": lambda source: bool(source.record.get("reason")),
    ASSUMED_HEIGHT: lambda source: source.building_value("height_source") == "default",
}
