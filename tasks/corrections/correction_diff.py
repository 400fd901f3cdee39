"""Differences between edited values and the current state of a block."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import cached_property
from typing import cast

import numpy as np
from shapely import MultiPolygon

from catalogs.block.building_corrections import MIN_WALL_HEIGHT_M
from catalogs.block.correction_values import ElementBox, is_number
from catalogs.block.corrections import (
    BUILDING_CORRECTION_KINDS,
    FACADE_CORRECTION_KINDS,
    Correction,
    Corrections,
    validate_correction,
)
from catalogs.crs import LONLAT, coordinate_transform
from catalogs.readers.annotations import Annotation, CityJsonHeights
from facade_core.core.errors import InputError
from facade_core.core.types import Element
from facade_core.facade.correction import find_unmatched_elements
from tasks.corrections.drawable_values import valid_correction_values
from tasks.publish.published_run import PublishedBlock

# Smaller differences come from rounding in exports and journal.
MIN_SHIFT_TEXELS = 0.6
HEIGHT_TOLERANCE_M = 0.006
# Corrections that contradict a 3D model's own geometry.
MODEL_SHAPE_KINDS = ("height", "roof_shape", "roof_height")


class CorrectionDiff:
    """Comparison of edited values with the current ones, which are corrected or published.

    Attributes
    ----------
    notes : remarks about the edited values, one line each.
    """

    def __init__(self, results: PublishedBlock, before: Corrections) -> None:
        self.results = results
        self._renamed_ids = cast(dict[str, str], results.group.attrs.get("known_by_place", {}))
        self._old_ids: dict[str, list[str]] = {}
        for old, new in self._renamed_ids.items():
            self._old_ids.setdefault(new, []).append(old)
        self._stored, self.before = before, before.rename_targets(self._renamed_ids)
        self.facades = {id: index for index, id in enumerate(results.plan.facades.id)}
        self.buildings = {id: index for index, id in results.names.items()}
        self.exemplars = [record["unit"] for record in results.journals["exemplars"] if record]
        self.notes: list[str] = []

    def compute(self, named: str, said: Sequence[Annotation], by: Correction) -> list[Correction]:
        """Return the edited values that differ from the current ones as corrections.

        Parameters
        ----------
        named : name of the source in error messages.
        said : edited values.
        by : correction with the author, time and reason to copy.

        Raises
        ------
        InputError : a value is not possible.
        """
        said = self._replace_measured_heights(named, said)
        _check_unique(named, said)
        found = [
            one
            for id, what, value in said
            if (one := self._correction_if_changed(named, id, what, value, by)) is not None
        ]
        new = [of for one in found for of in (self._withdraw(one) if one.value is None else [one])]
        self._check_roof_heights(named, new)
        return new

    def _check_roof_heights(self, named: str, new: Sequence[Correction]) -> None:
        """Raise InputError for a height of a roof that is flat, or flat once its shape is withdrawn."""
        shapes = {one.id: one.value for one in new if one.kind == "roof_shape"}
        heights = {one.id: one.value for one in new if one.kind == "roof_height"}
        for id, height in heights.items():
            if height is None:
                continue
            if shapes.get(id, "") is None:
                raise InputError(
                    f"{named}: {id}: what its roof is without the corrected shape is known after the next run; give the height "
                    "then, or a roof_shape with it"
                )
            if (shapes.get(id) or self._current_value(id, "roof_shape")) in (None, "flat"):
                raise InputError(f"{named}: {id}: its roof is flat and has no height; give a roof_shape too")
        for id, shape in shapes.items():
            if (
                shape is None
                and id not in heights
                and (height := self.before.value_correction(id, "roof_height")) is not None
            ):
                self.notes.append(
                    f"{id}: the roof_height {height:g} that was given with its shape stays, where the roof is not flat; "
                    "take it back too"
                )

    def _replace_measured_heights(self, named: str, said: Sequence[Annotation]) -> list[Annotation]:
        """Replace edited measured heights with the heights of eaves that follow from them."""
        meant = {}
        for id, _, one in said:
            if (
                isinstance(one, CityJsonHeights)
                and (eaves := self._eaves_from_measured_height(named, id, one)) is not None
            ):
                meant[id] = eaves
        others = [
            one
            for one in said
            if not isinstance(one[2], CityJsonHeights) and not (one[1] == "height" and one[0] in meant)
        ]
        return [*others, *((id, "height", eaves) for id, eaves in meant.items())]

    def _eaves_from_measured_height(self, named: str, id: str, said: CityJsonHeights) -> object:
        """Derive the eaves from an edited measured height; the roof keeps its own height.

        None if the height was not edited, or if the eaves were edited too.
        """
        if id not in self.buildings:
            return None if said.eaves is not None else said.height  # rejected later, like any height of an unknown id
        if not is_number(said.height):
            raise InputError(f"{named}: {id}: a measuredHeight of {str(said.height)[:40]!r} is no number; write metres")
        if not is_number(said.exported):
            if not _is_near(said.height, self._measured_heights.get(id)):
                self.notes.append(
                    f"{id}: its measured height is not taken, as the file does not say what was exported; give its eaves"
                )
            return None
        moved = said.height - said.exported
        if _is_near(moved, 0.0):
            return None
        published = float(cast(float, self._published_value("height", id)))
        eaves = said.eaves if is_number(said.eaves) else published
        if not (_is_near(eaves, published) or _is_near(eaves + moved, self._current_value(id, "height"))):
            return None
        return round(eaves + moved, 3)

    def _correction_if_changed(
        self, named: str, id: str, what: str, value: object, by: Correction
    ) -> Correction | None:
        """Return an edited value as a correction; None if it equals the current value."""
        known = self.facades if what in FACADE_CORRECTION_KINDS else self.buildings
        if (
            what in BUILDING_CORRECTION_KINDS
            and id in known
            and value is not None
            and self._is_same(id, what, value, self._current_value(id, what))
        ):
            return None  # an unchanged exported value is never rejected
        if what == "roof_height" and is_number(value) and value == 0 and id in known:  # exports write 0 for a flat roof
            if self._current_value(id, "roof_shape") not in (None, "flat"):
                self.notes.append(f"{id}: a roof height of 0 is not taken; say by its shape that it is flat")
            return None
        try:
            one = validate_correction(replace(by, id=id, kind=what, value=value))
        except InputError as error:
            raise InputError(f"{named}: {error}") from error
        if id not in known:
            kind = "facade" if what in FACADE_CORRECTION_KINDS else "building"
            near = get_close_matches(id, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known are e.g. {', '.join(list(known)[:3])}"
            raise InputError(f"{named}: the block {self.results.block} has no {kind} {id}; {hint}")
        if one.value is None:
            if self.before.value_correction(id, what) is None:
                return None
        elif self._is_same(id, what, one.value, self._current_value(id, what)):
            return None
        elif reason := self._rejection_reason(one):
            raise InputError(f"{named}: {id}: {reason}")
        self._note_conflict(one)
        return self._locate_facade(one) if what in FACADE_CORRECTION_KINDS else self._locate_building(one)

    def _withdraw(self, one: Correction) -> list[Correction]:
        """Return the withdrawal of a correction for every id of its target."""
        ids = [one.id, *self._old_ids.get(one.id, ())]
        return [replace(one, id=id) for id in ids if self._stored.value_correction(id, one.kind) is not None]

    def _rejection_reason(self, one: Correction) -> str | None:
        """Explain why a value is not possible; None if it is."""
        if one.kind == "exemplar" and one.value not in self.exemplars:
            return f"there is no exemplar {one.value}; there is {', '.join(self.exemplars[:5])}"
        if one.value not in (known := valid_correction_values().get(one.kind, [one.value])):
            near = get_close_matches(one.value, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there is {', '.join(known)}"
            return f"nothing is drawn of {one.kind} {one.value}; {hint}"
        if one.kind == "levels" and not one.value.is_integer():
            return f"storeys are whole, not {one.value:g}; give {math.floor(one.value)} or {math.ceil(one.value)}"
        if one.kind in MODEL_SHAPE_KINDS and self._published_value("height_source", one.id) == "model":
            return f"it is a model, whose {one.kind} is as given; correct the model"
        begins = (
            float(cast(float | None, self._published_value("raised", one.id)) or 0.0) if one.kind == "height" else 0.0
        )
        if one.kind == "height" and one.value < begins + MIN_WALL_HEIGHT_M:
            return f"it begins {begins:g} m over the ground and cannot end at {one.value:g} m"
        return None

    def _current_value(self, id: str, what: str) -> object:
        """Return the corrected value of a target, or else the published one."""
        corrected = self.before.value_correction(id, what)
        if corrected is not None:
            return corrected
        match what:
            case "elements":
                return self._published_elements(id)
            case "facade":
                return True
            case "hide" | "keep":
                return ()
            case "exemplar":
                return None
            case "levels":
                return int(cast(int, self._published_value("levels", id))) or None
            case _:
                value = self._published_value(what, id)
                return None if value is None or value == "" or value != value else value

    def _published_value(self, name: str, building: str) -> object:
        """Return a published value of a building; None if the store is too old to have it."""
        table = self.results.buildings
        return table[name][self.buildings[building]] if name in table else None

    @cached_property
    def _measured_heights(self) -> dict[str, float]:
        """Height of each building in CityJSON exports."""
        from tasks.export.city_objects import compute_building_heights

        return compute_building_heights(self.results)

    def _is_same(self, id: str, what: str, value: object, stands: object) -> bool:
        if stands is None:
            return False
        if what == "elements":
            said, there = (self._to_texels(id, cast(Sequence[ElementBox], layout)) for layout in (value, stands))
            return len(said) == len(there) and not (
                find_unmatched_elements(said, there, max_shift=MIN_SHIFT_TEXELS)
                or find_unmatched_elements(there, said, max_shift=MIN_SHIFT_TEXELS)
            )
        if what in ("height", "roof_height"):
            return _is_near(value, stands)
        return bool(value == stands)

    def _to_texels(self, facade: str, shares: Sequence[ElementBox]) -> list[Element]:
        """Convert elements from shares of a wall to its texels."""
        height, width = self._raster_size(facade)
        return [Element(label, x0 * width, y0 * height, x1 * width, y1 * height) for label, x0, y0, x1, y1 in shares]

    def _published_elements(self, facade: str) -> list[ElementBox]:
        height, width = self._raster_size(facade)
        found = self.results.elements(self.facades[facade])
        shares = []
        for e in found:
            box = (e.x0 / width, e.y0 / height, e.x1 / width, e.y1 / height)
            x0, y0, x1, y1 = (min(max(v, 0.0), 1.0) for v in box)
            shares.append((e.label, x0, y0, x1, y1))
        return shares

    def _raster_size(self, facade: str) -> tuple[int, int]:
        placement, chart = self.results.plan.scene.placement, int(self.results.plan.facades.chart[self.facades[facade]])
        return placement.shape(chart)

    def _note_conflict(self, one: Correction) -> None:
        stands = self.before.by_target.get(one.id, {}).get(one.kind)
        if stands is not None and stands.who != one.who:
            self.notes.append(
                f"{one.kind} of {one.id}: {stands.who or 'somebody'} corrected it on {stands.when[:10]}, {one.who} does now, "
                "which counts; both are kept"
            )

    def _locate_facade(self, one: Correction) -> Correction:
        plan, index = self.results.plan, self.facades[one.id]
        charts, chart = plan.scene.charts, int(plan.facades.chart[index])
        middle = charts.origin[chart, :2] + charts.axis_u[chart, :2] * charts.size[chart, 0] / 2
        longitude, latitude = coordinate_transform(self.results.crs, LONLAT)(middle[:1], middle[1:])
        return replace(
            one,
            place=(round(float(longitude[0]), 7), round(float(latitude[0]), 7)),
            width=round(float(plan.facades.width[index]), 2),
        )

    def _locate_building(self, one: Correction) -> Correction:
        """Return a correction of a building with a point in its outline."""
        outline = self._outlines.get(self.buildings[one.id])
        if outline is None:
            return one
        point = outline.representative_point()
        longitude, latitude = coordinate_transform(self.results.crs, LONLAT)(np.array([point.x]), np.array([point.y]))
        return replace(one, place=(round(float(longitude[0]), 7), round(float(latitude[0]), 7)))

    @cached_property
    def _outlines(self) -> Mapping[int, MultiPolygon]:
        from facade_core.export.bodies.footprints import building_footprints

        return building_footprints(self.results.textured_mesh)


def _is_near(metres: object, others: object) -> bool:
    return (
        is_number(metres)
        and is_number(others)
        and math.isclose(metres, others, rel_tol=0.0, abs_tol=HEIGHT_TOLERANCE_M)
    )


def _check_unique(named: str, said: Sequence[Annotation]) -> None:
    """Raise InputError for a target with two different values."""
    found: dict[tuple[str, str], object] = {}
    for id, what, value in said:
        before = found.setdefault((id, what), value)
        if before is not value and before != value:
            raise InputError(f"{named}: {what} of {id} is said twice, each time something else; leave one")
