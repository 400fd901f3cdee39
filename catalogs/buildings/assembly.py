"""Buildings of a block from footprints and models: clipped, projected, repaired, deduplicated, each with a height."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress, count
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from catalogs.buildings.facade_styles import add_facade_styles
from catalogs.buildings.heights import assume_heights
from catalogs.buildings.models import project_models, split_off_solids
from catalogs.buildings.part_files import attach_parts
from catalogs.buildings.parts import PartCandidate, host_outline_indices, split_buildings_into_parts, whole_levels
from catalogs.buildings.repeated_outlines import find_repeated_outlines
from catalogs.buildings.roofs import add_assumed_roofs
from catalogs.buildings.settings import SITES
from catalogs.crs import coordinate_transform
from catalogs.features import BuildingModels, Fault, Footprint, Footprints, format_reason_notes, natural_sort_key
from catalogs.reader_errors import fault_reason
from facade_core.core.arrays import ObjectArray
from facade_core.core.errors import InputError
from facade_core.core.types import Building

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely.geometry.base import BaseGeometry


REPEATED_REASON = "buildings with the outline of another in their file, the highest kept"


@dataclass(frozen=True)
class BlockBuildings:
    """Buildings of a block.

    Attributes
    ----------
    items : buildings, ordered by id.
    textures : pictures that the texture indices of the shells refer to.
    omissions : set-aside and changed buildings, one line each.
    faults : broken buildings.
    known_heights : stated heights that inform the assumed ones.
    """

    items: tuple[Building, ...]
    textures: tuple[Path, ...]
    omissions: tuple[str, ...]
    faults: tuple[Fault, ...]
    known_heights: int

    @property
    def notes(self) -> tuple[str, ...]:
        """Return omissions, and the heights that are assumed of the buildings as they are now."""
        return self.omissions + _note_assumed_heights(self.items, self.known_heights)


@dataclass(frozen=True)
class _Candidate:
    """Building before heights are assumed.

    Attributes
    ----------
    building : complete for a model, without a height for a footprint.
    footprint : footprint of the source; None for a model.
    whole_outline : outline that contains a building part; None otherwise.
    """

    building: Building
    footprint: Footprint | None
    whole_outline: Polygon | None = None

    @property
    def is_whole(self) -> bool:
        """Return True where the building is no part and starts on the ground."""
        return self.whole_outline is None and (self.footprint is None or not self.footprint.starts_above_ground)


@dataclass
class _Assembly:
    """Buildings of the sources so far, in the frame and the area of a block.

    Attributes
    ----------
    crs : metric frame.
    area : polygon that contains the representative points of the buildings; None for no limit.
    reasons : ids of set-aside and changed buildings by reason.
    found : buildings in the area.
    around : buildings near it of known height.
    outlines_by_id : outlines of the buildings in the area by the id that their source gives them.
    """

    crs: CRS
    area: Polygon | None
    reasons: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    faults: list[Fault] = field(default_factory=list)
    textures: list[Path] = field(default_factory=list)
    found: list[_Candidate] = field(default_factory=list)
    around: list[_Candidate] = field(default_factory=list)
    outlines_by_id: dict[str, list[BaseGeometry]] = field(default_factory=lambda: defaultdict(list))

    def add_source(self, source: Footprints | BuildingModels) -> None:
        """Add the remarks, the faults and the buildings of a source in the area."""
        places = self._project([remark.geometry for remark in source.remarks], source)
        for remark, place in zip(source.remarks, places, strict=True):
            if self._may_intersect(place):
                self.reasons[remark.reason].append(remark.id)
        places = self._project([fault.place for fault in source.faults], source)
        self.faults += [fault for fault, place in zip(source.faults, places, strict=True) if self._may_intersect(place)]
        if isinstance(source, BuildingModels):
            candidates = self._model_candidates(source)
            self.textures += source.textures
        else:
            candidates = self._footprint_candidates(source)
        self.found += self._drop_duplicates(candidates)

    def _footprint_candidates(self, source: Footprints) -> list[_Candidate]:
        """Return the buildings of footprints in the area; `around` receives nearby ones of known height."""
        pieces = self._drop_repeated_outlines(self._split_outlines(source))
        candidates: list[_Candidate] = []
        host_indices = host_outline_indices(
            [outline for _, _, outline in pieces], [footprint.is_part for footprint, _, _ in pieces]
        )
        for (footprint, id, outline), host in zip(pieces, host_indices, strict=True):
            whole = pieces[host][2] if host >= 0 else None
            levels = whole_levels(footprint.levels)
            building = Building(id, outline, 0.0, "", levels, footprint.name, footprint.base, footprint.roof)
            candidate = _Candidate(replace(building, finish=footprint.finish), footprint, whole)
            if self._is_inside(whole or outline):
                candidates.append(candidate)
            elif _states_floor_height(candidate) and shapely.dwithin(self.area, outline, SITES.context_distance_m):
                self.around.append(candidate)
        return candidates

    def _split_outlines(self, source: Footprints) -> list[tuple[Footprint, str, Polygon]]:
        """Return each polygon of the footprints in the frame, with its id; broken outlines in the area become faults."""
        pieces: list[tuple[Footprint, str, Polygon]] = []
        outlines = self._project([footprint.outline for footprint in source.items], source)
        for footprint, stated in zip(source.items, outlines, strict=True):
            try:
                parts = self._split_outline(footprint, stated)
            except Exception as error:  # an error of GEOS affects this outline only
                if self._may_intersect(stated):
                    self.faults.append(Fault(footprint.id, "building", fault_reason(error)))
                continue
            pieces += [
                (footprint, footprint.id if len(parts) == 1 else f"{footprint.id}-{index}", part)
                for index, part in enumerate(parts)
            ]
        return pieces

    def _split_outline(self, footprint: Footprint, stated: BaseGeometry) -> list[Polygon]:
        """Return the polygons of an outline that are large enough; InputError with its defect."""
        smallest = SITES.min_part_m2 if footprint.is_part else SITES.min_footprint_m2
        outline = _without_stray_holes(stated)

        def note(reason: str) -> None:
            if self._may_intersect(outline):
                self.reasons[reason].append(footprint.id)

        if outline is not stated:
            note("holes outside their outlines ignored")
        if defect := _find_defect(outline):
            raise InputError(defect)
        large, small = _split_polygons(outline, smallest)
        if not large:
            what = "parts of buildings" if footprint.is_part else "footprints"
            note(f"{what} under {smallest:g} m2 set aside" if small else f"{what} that enclose no area set aside")
        elif shapely.is_valid_reason(outline).startswith("Self-intersection"):
            note("outlines that cross themselves in a sliver repaired")
        return large

    def _drop_repeated_outlines(
        self, pieces: list[tuple[Footprint, str, Polygon]]
    ) -> list[tuple[Footprint, str, Polygon]]:
        """Return the pieces without those that repeat the outline and lower end of another; the highest is kept."""
        kinds = [
            (one.is_part, one.min_height, one.min_level, None if one.base is None else round(one.base))
            for one, _, _ in pieces
        ]
        heights = [one.height or SITES.assumed_floor_m * (one.levels or 0.0) for one, _, _ in pieces]
        repeated = find_repeated_outlines([outline for _, _, outline in pieces], kinds, heights)
        self.reasons[REPEATED_REASON] += [
            id for _, id, outline in compress(pieces, repeated) if self._may_intersect(outline)
        ]
        return list(compress(pieces, ~repeated))

    def _model_candidates(self, source: BuildingModels) -> list[_Candidate]:
        candidates: list[_Candidate] = []
        kinds = []
        for model, shell, outline in project_models(source, self.crs, len(self.textures)):
            if isinstance(outline, str):
                self.faults.append(Fault(model.id, "building", outline))
            elif not self._is_inside(outline):
                continue
            elif outline.area < SITES.min_footprint_m2:
                self.reasons[f"models that cover under {SITES.min_footprint_m2:g} m2 set aside"].append(model.id)
            else:
                low, high = float(shell.vertices[:, 2].min()), float(shell.vertices[:, 2].max())
                base = model.base if model.base is not None and low - 2.0 <= model.base < high else low
                levels, height = whole_levels(model.levels), round(high - base, 2)
                building = Building(model.id, outline, height, "model", levels, model.name, base, shell=shell)
                candidates.append(_Candidate(replace(building, finish=model.finish), None))
                kinds.append((round(base), round(height)))
        outlines = [one.building.footprint for one in candidates]
        repeated = find_repeated_outlines(outlines, kinds, [0.0] * len(outlines))
        self.reasons[REPEATED_REASON] += [one.building.id for one in compress(candidates, repeated)]
        return list(compress(candidates, ~repeated))

    def _drop_duplicates(self, candidates: list[_Candidate]) -> list[_Candidate]:
        """Return the candidates that no earlier feature duplicates, each with a unique id."""
        used = {candidate.building.id for candidate in self.found}
        taken = used | {candidate.building.id for candidate in candidates}
        tree = shapely.STRtree([candidate.building.footprint for candidate in self.found])
        kept = []
        for candidate in candidates:
            id, outline = candidate.building.id, candidate.building.footprint
            others = [self.found[i].building.footprint for i in tree.query(outline, predicate="intersects")]
            if _is_duplicate(outline, others, self.outlines_by_id[id]):
                self.reasons["buildings stated twice, the first kept"].append(id)
                continue
            self.outlines_by_id[id].append(outline)
            if id in used:
                number = next(number for number in count(2) if f"{id}-{number}" not in taken)
                taken.add(f"{id}-{number}")
                candidate = replace(candidate, building=replace(candidate.building, id=f"{id}-{number}"))
                self.reasons["buildings numbered since one elsewhere has their id"].append(candidate.building.id)
            used.add(candidate.building.id)
            kept.append(candidate)
        return kept

    def _is_inside(self, outline: Polygon) -> bool:
        return self.area is None or bool(self.area.contains(outline.representative_point()))

    def _project(self, outlines: Sequence[BaseGeometry | None], source: Footprints | BuildingModels) -> ObjectArray:
        assert source.crs is not None, "the block gives a frame to every source"
        flat = np.empty(len(outlines), dtype=object)
        flat[:] = outlines
        transform = coordinate_transform(source.crs, self.crs)
        projected: ObjectArray = shapely.transform(shapely.force_2d(flat), transform, interleaved=False)
        return projected

    def _may_intersect(self, outline: BaseGeometry | None) -> bool:
        """Return True where an outline, however broken, may intersect the area; an outline without a location counts."""
        if self.area is None or outline is None or outline.is_empty or not np.isfinite(outline.bounds).all():
            return True
        return bool(shapely.box(*outline.bounds).intersects(self.area))


def assemble_buildings(
    sources: Sequence[Footprints | BuildingModels], crs: CRS, *, area: Polygon | None, floor_height: float
) -> BlockBuildings:
    """Build the buildings of a block in its metric frame, ordered by id.

    A MultiPolygon becomes one building per part, id-0, id-1, ... from west to east. A building that an earlier source has
    too (SITES.duplicate_share of its outline, or the same id and more than SITES.max_neighbour_overlap) is dropped with a note.
    A different building with a used id is numbered: id-2, id-3, ..., with a note.

    Parameters
    ----------
    sources : footprints and models with a CRS, in order of precedence.
    crs : metric frame of the block.
    area : polygon in the frame that contains the representative points of the buildings; None for no limit.
    floor_height : metres; the height of a footprint is the stated one, else levels x floor_height, else assumed.
    """
    assembly = _Assembly(crs, area)
    for source in _separate_solids(attach_parts(sources, crs)):
        assembly.add_source(source)

    found = sorted(assembly.found, key=lambda candidate: natural_sort_key(candidate.building.id))
    whole = [candidate for candidate in found if candidate.is_whole]
    parts = [candidate for candidate in found if not candidate.is_whole]
    buildings, known = _assume_heights(whole, [*assembly.around, *filter(_states_floor_height, parts)], floor_height)
    if parts:
        buildings = _add_parts(buildings, found, parts, floor_height, assembly.reasons)
    stated = {one.building.id: one.footprint for one in found if one.footprint}
    buildings = add_facade_styles(buildings, stated, floor_height)
    omissions = format_reason_notes(assembly.reasons)
    return BlockBuildings(buildings, tuple(assembly.textures), omissions, tuple(assembly.faults), known)


def _separate_solids(sources: Sequence[Footprints | BuildingModels]) -> Iterator[Footprints | BuildingModels]:
    """Yield the sources, with the solids of footprints as models."""
    for source in sources:
        if isinstance(source, Footprints):
            outlines, solids = split_off_solids(source)
            yield outlines
            if solids.items:
                yield solids
        else:
            yield source


def _add_parts(
    buildings: Sequence[Building],
    found: Sequence[_Candidate],
    parts: Sequence[_Candidate],
    floor_height: float,
    reasons: dict[str, list[str]],
) -> tuple[Building, ...]:
    """Return the buildings with their parts and with buildings that start above the ground, ordered by id."""
    wholes = {id(one.building.footprint): one for one in found}
    stated = []
    for part in parts:
        assert part.footprint is not None
        if part.whole_outline is None:
            stated.append(PartCandidate(part.building, part.footprint, None))
            continue
        whole = wholes.get(id(part.whole_outline))
        if whole is not None and (more := whole.footprint):  # else dropped as a duplicate
            kind, built = part.footprint.use or more.use, part.footprint.year_built or more.year_built
            merged = replace(part.footprint, use=kind, year_built=built)
            stated.append(PartCandidate(part.building, merged, whole.building.id))
    found_parts = split_buildings_into_parts(buildings, stated, floor_height, SITES.min_footprint_m2, reasons)
    return tuple(sorted(found_parts, key=lambda building: natural_sort_key(building.id)))


def _is_duplicate(outline: BaseGeometry, earlier: Iterable[BaseGeometry], same_id: Iterable[BaseGeometry]) -> bool:
    """Return True for an outline that an earlier one covers, or one of the same id overlaps."""
    shared = max((outline.intersection(other).area for other in earlier), default=0.0)
    return bool(shared > SITES.duplicate_share * outline.area) or any(
        outline.intersection(other).area > SITES.max_neighbour_overlap * min(outline.area, other.area)
        for other in same_id
    )


def _assume_heights(
    candidates: list[_Candidate], around: list[_Candidate], floor_height: float
) -> tuple[tuple[Building, ...], int]:
    """Return the buildings with heights and roofs, and the number of stated heights that inform the assumed ones."""
    # floor counts of known heights end at the eaves, below assumed roofs
    known_roofs = [
        add_assumed_roofs(_apply_stated_heights(some, floor_height), [one.footprint for one in some])
        for some in (candidates, around)
    ]
    stated = [candidate.footprint for candidate in candidates]
    every = assume_heights(
        [*known_roofs[0], *known_roofs[1]], [*stated, *(one.footprint for one in around)], floor_height
    )
    known = sum(building.height_source in ("height", "levels") for building in every)
    return add_assumed_roofs(every[: len(candidates)], stated), known


def _note_assumed_heights(buildings: Sequence[Building], known: int) -> tuple[str, ...]:
    unknown = [building.height for building in buildings if building.height_source == "default"]
    if not unknown:
        return ()
    span = f"{min(unknown):g} m" if min(unknown) == max(unknown) else f"{min(unknown):g} to {max(unknown):g} m"
    origin = f"by the {known} known and by size" if known else "since none is known"
    return (f"{len(unknown)} of {len(buildings)} buildings state no height: {span} assumed, {origin}",)


def _apply_stated_heights(candidates: list[_Candidate], floor_height: float) -> list[Building]:
    """Return the buildings with their stated heights, 0 without one."""
    buildings = []
    for candidate in candidates:
        building = candidate.building
        if candidate.footprint:
            height, origin = _stated_height(candidate.footprint, floor_height)
            building = replace(building, height=height or 0.0, height_source=origin)
        buildings.append(building)
    return buildings


def _states_floor_height(candidate: _Candidate) -> bool:
    """Return True for a building whose stated height informs the heights of others.

    Parts on the ground with a tag `building` count too.
    """
    stated = candidate.footprint
    return (
        stated is not None
        and (stated.height is not None or stated.levels is not None)
        and (candidate.is_whole or bool(stated.use and not stated.starts_above_ground))
    )


def _stated_height(footprint: Footprint, floor_height: float) -> tuple[float | None, str]:
    if footprint.height is not None:
        return round(footprint.height, 2), "height"
    if footprint.levels is not None:
        return round(footprint.levels * floor_height, 2), "levels"
    return None, "default"


def _without_stray_holes(outline: BaseGeometry) -> BaseGeometry:
    """Return an outline without holes outside its shell, which make it invalid."""
    if not shapely.is_valid_reason(outline).startswith("Hole lies outside shell"):
        return outline
    polygons = []
    for part in shapely.get_parts(outline):
        shell = _repair(Polygon(part.exterior))
        holes = [hole for hole in part.interiors if shell.covers(_repair(Polygon(hole)).representative_point())]
        polygons.append(Polygon(part.exterior, holes))
    return polygons[0] if len(polygons) == 1 else MultiPolygon(polygons)


def _find_defect(outline: BaseGeometry) -> str | None:
    """Return the defect and the remedy of an outline; None where it is valid or can be repaired."""
    if not np.isfinite(shapely.get_coordinates(outline)).all():
        return "a corner of its footprint is not a number; mend or remove it"
    reason = shapely.is_valid_reason(outline)
    # a ring that touches itself, or crosses itself in a sliver, encloses the intended area
    if (
        reason.startswith("Self-intersection")
        and abs(_repair(outline).area - outline.area) > SITES.max_sliver_share * outline.area
    ):
        return f"its footprint crosses itself ({reason.partition('[')[2].rstrip(']')}); mend or remove it"
    return None


def _repair(outline: BaseGeometry) -> BaseGeometry:
    return outline if outline.is_valid else shapely.make_valid(outline, method="structure", keep_collapsed=False)


def _split_polygons(outline: Polygon, min_area: float) -> tuple[list[Polygon], list[Polygon]]:
    """Return the large and the small valid polygons of an outline, from west to east, with courtyards."""
    polygons = [part for part in shapely.get_parts(_repair(outline)) if part.geom_type == "Polygon" and part.area > 0]
    polygons = sorted(shapely.normalize(polygons), key=lambda part: part.bounds)
    return [p for p in polygons if p.area >= min_area], [p for p in polygons if p.area < min_area]
