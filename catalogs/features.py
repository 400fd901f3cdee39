"""Footprints and centrelines as a source states them, before they become buildings and streets of a block."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from facade_core.core.types import PLAIN, Finish, Roof, Shell

if TYPE_CHECKING:
    from shapely import LineString, MultiPolygon, Polygon

# File systems allow 255 bytes, of which prefixes and suffixes take some.
MAX_STEM_LENGTH = 120


@dataclass(frozen=True, slots=True)
class Footprint:
    """A building outline in the source's frame.

    Args:
        id: unique in the source.
        outline: in plan.
        height: metres from the ground to the eaves; None where unstated.
        levels: storeys; None where unstated.
        name: what it is called, where stated.
        base: height of the ground, where stated.
        roof: what is above the eaves, where its shape is stated; "flat" is one.
        rise: height of the roof where that is stated, but no shape.
        kind: what it is used as, by OpenStreetMap's values of `building`, where stated.
        built: the year, where stated.
        finish: colours and materials, where stated.
        part: whether it is a part of a building whose outline another feature is.
        raised: metres, or else raised_levels: storeys, from the ground to where it begins, where stated.
    """

    id: str
    outline: Polygon | MultiPolygon
    height: float | None
    levels: float | None
    name: str | None
    base: float | None = None
    roof: Roof | None = None
    roof_height: float | None = None
    use: str | None = None
    year_built: int | None = None
    finish: Finish = PLAIN
    is_part: bool = False
    min_height: float | None = None
    min_level: float | None = None

    @property
    def starts_above_ground(self) -> bool:
        """Whether it begins above the ground."""
        return bool(self.min_height or self.min_level)


@dataclass(frozen=True, slots=True)
class BuildingModel:
    """A building modelled in 3D.

    Args:
        id: unique in the source.
        shell: in the source's frame: x east or longitude, y north or latitude, z metres up.
        height: metres from the ground to the top, where stated.
        levels: storeys, where stated.
        name: what it is called, where stated.
        base: height of the ground, where stated.
    """

    id: str
    shell: Shell
    height: float | None = None
    levels: float | None = None
    name: str | None = None
    base: float | None = None


@dataclass(frozen=True, slots=True)
class Remark:
    """What a reader did to one outline: reason is a plural, e.g. "roofs without walls set aside"."""

    id: str
    reason: str
    geometry: Any


@dataclass(frozen=True, slots=True)
class Fault:
    """A unit that is set aside since it is broken: a run goes on without it, exits with 1 and keeps the reason.

    Args:
        id: the unit's, or the name of its file.
        kind: "building", "street", "panorama", "photo" or "exemplar".
        reason: what is wrong and the remedy, one line.
        place: a geometry in the source's frame, where it has one.
    """

    id: str
    kind: str
    reason: str
    place: Any = None


@dataclass(frozen=True, slots=True)
class Centreline:
    """A piece of street centreline in the source's frame; pieces of one name are merged later."""

    id: str
    line: LineString
    name: str | None


@dataclass(frozen=True, slots=True)
class GroundFeature:
    """What a map states of the ground, in the source's frame: a point, a line or an outline, and its tags."""

    id: str
    geometry: Any
    tags: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Footprints:
    """All outlines of one source, the frame they are in (None where it states none), and what the reader says of some."""

    crs: str | None
    items: tuple[Footprint, ...]
    remarks: tuple[Remark, ...] = ()
    faults: tuple[Fault, ...] = ()

    def bounding_boxes(self) -> np.ndarray:
        """(xmin, ymin, xmax, ymax) of each outline, (n, 4)."""
        return _bounding_boxes(footprint.outline for footprint in self.items)

    def item_outline(self, index: int) -> Any:
        """The outline of an item."""
        return self.items[index].outline

    def translate(self, offset: Sequence[float]) -> Footprints:
        """All outlines and ground heights moved by (x, y, z)."""
        x, y, z = offset

        def move(outline: Any) -> Any:
            return shapely.transform(outline, lambda xy: xy + np.array([x, y]))

        items = tuple(
            replace(f, outline=move(f.outline), base=None if f.base is None else f.base + z) for f in self.items
        )
        return replace(self, items=items)


@dataclass(frozen=True, slots=True)
class BuildingModels:
    """All modelled buildings of one source; textures are the pictures that their shells' texture indices count."""

    crs: str | None
    items: tuple[BuildingModel, ...]
    textures: tuple[Path, ...] = ()
    remarks: tuple[Remark, ...] = ()
    faults: tuple[Fault, ...] = ()

    def bounding_boxes(self) -> np.ndarray:
        """(xmin, ymin, xmax, ymax) of each model, (n, 4)."""
        return _bounding_boxes(shapely.multipoints(model.shell.vertices[:, :2]) for model in self.items)

    def place(self, index: int) -> Any:
        """The box around an item."""
        return shapely.box(*shapely.bounds(shapely.multipoints(self.items[index].shell.vertices[:, :2])))

    def moved(self, offset: Sequence[float]) -> BuildingModels:
        """All shells and ground heights moved by (x, y, z)."""

        def move(model: BuildingModel) -> BuildingModel:
            shell = replace(model.shell, vertices=model.shell.vertices + np.asarray(offset, np.float64))
            return replace(model, shell=shell, base=None if model.base is None else model.base + offset[2])

        return replace(self, items=tuple(map(move, self.items)))


@dataclass(frozen=True, slots=True)
class Centrelines:
    """All centrelines of one source, the frame they are in (None where it states none), those that are broken, what the
    reader says of some, and what the source states of the ground, the streets among it."""

    crs: str | None
    items: tuple[Centreline, ...]
    faults: tuple[Fault, ...] = ()
    remarks: tuple[Remark, ...] = ()
    ground: tuple[GroundFeature, ...] = ()

    def boxes(self) -> np.ndarray:
        """(xmin, ymin, xmax, ymax) of each line, (n, 4)."""
        return _bounding_boxes(piece.line for piece in self.items)


def _bounding_boxes(geometries: Iterable[Any]) -> np.ndarray:
    return shapely.bounds(np.array(list(geometries), dtype=object)).reshape(-1, 4)


def file_stem(identifier: str) -> str:
    """An id as a file's name without suffix, of LONGEST_STEM letters at most: itself where it is one on every system, else told
    apart by a short digest."""
    if len(identifier) <= MAX_STEM_LENGTH and re.fullmatch(r"[\w{}()+=@-][\w {}()+=@.-]*", identifier, re.ASCII):
        return identifier
    plain = re.sub(r"[^\w{}()+=@-]", "_", identifier[:80], flags=re.ASCII)
    digest = hashlib.blake2b(identifier.encode(errors="surrogatepass"), digest_size=4).hexdigest()
    return f"{plain}-{digest}"


def natural_sort_key(identifier: str) -> tuple[tuple[str, int, str], ...]:
    """Sort key that puts w9 before w10, however many digits there are."""
    found = re.findall(r"(\D*)(\d*)", identifier)
    stripped = [(text, number.lstrip("0") or number[:1]) for text, number in found]
    return tuple((text, len(number), number) for text, number in stripped)


def make_unique_id(identifier: str, id_counts: Counter[str], remarks: list[Remark], path: Path) -> str:
    """An id of a building of a file that has not been `seen` yet: a second one of a kind is numbered, with a remark."""
    id_counts[identifier] += 1
    if id_counts[identifier] == 1:
        return identifier
    unique = f"{identifier}-{id_counts[identifier]}"
    remarks.append(Remark(unique, f"buildings of {path.name} numbered since another has their id", None))
    return unique


def ids_by_reason(remarks: Iterable[Remark]) -> dict[str, list[str]]:
    """The ids that each reason is remarked on."""
    found: dict[str, list[str]] = {}
    for remark in remarks:
        found.setdefault(remark.reason, []).append(remark.id)
    return found


def notes_by_reason(reasons: Mapping[str, Iterable[str]], *, max_ids: int = 8) -> tuple[str, ...]:
    """One note per reason, with the number of features it concerns and the first ids."""
    notes = []
    for reason, found in reasons.items():
        ids = sorted(found, key=natural_sort_key)
        if ids:
            more = f" and {len(ids) - max_ids} more" if len(ids) > max_ids else ""
            notes.append(f"{reason}: {len(ids)} ({', '.join(ids[:max_ids])}{more})")
    return tuple(notes)
