"""Footprints, models and centrelines of a source, before they become the buildings and streets of a block."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array, IntArray
from facade_core.core.types import PLAIN, Building, BuildingFinish, BuildingShell, Roof

WithShellT = TypeVar("WithShellT", "BuildingModel", Building)
# File systems allow 255 bytes; prefixes and suffixes need some.
MAX_STEM_LENGTH = 120


@dataclass(frozen=True, slots=True)
class Footprint:
    """Building outline in the frame of its source; None where the source states nothing.

    Attributes
    ----------
    id : unique in the source.
    outline : polygon in plan.
    height : metres from the ground to the eaves.
    is_eaves_height : the source states the height of the eaves, so that an assumed roof comes on top of it.
    levels : number of floors, as in the tag `building:levels`.
    name : name of the building.
    base : height of the ground, metres.
    roof : roof of a stated shape; "flat" is a shape.
    roof_height : metres, stated without a shape.
    use : value of the OpenStreetMap tag `building`.
    year_built : year of construction.
    finish : colours and materials.
    is_part : part of a building that another feature outlines.
    min_height : metres from the ground to the lower end, as in the tag `min_height`.
    min_level : the same as a number of floors, used without min_height.
    shell : faces of a solid, in the frame of the source; None for an outline.
    whole_id : id of the building of which this is a part, as the source states it.
    has_parts : True where the source states that the building has parts.
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
    finish: BuildingFinish = PLAIN
    is_part: bool = False
    min_height: float | None = None
    min_level: float | None = None
    shell: BuildingShell | None = None
    whole_id: str | None = None
    has_parts: bool = False
    is_eaves_height: bool = False

    @property
    def starts_above_ground(self) -> bool:
        """Return True where the lower end is above the ground."""
        return bool(self.min_height or self.min_level)


@dataclass(frozen=True, slots=True)
class BuildingModel:
    """3D model of a building; None where the source states nothing.

    Attributes
    ----------
    id : unique in the source.
    shell : in the frame of the source: x east or longitude, y north or latitude, z metres up.
    height : metres from the ground to the top.
    levels : number of floors.
    name : name of the building.
    base : height of the ground, metres.
    finish : colours and materials of surfaces without a texture.
    """

    id: str
    shell: BuildingShell
    height: float | None = None
    levels: float | None = None
    name: str | None = None
    base: float | None = None
    finish: BuildingFinish = PLAIN


@dataclass(frozen=True, slots=True)
class Remark:
    """Note of a reader on one feature.

    Attributes
    ----------
    id : id of the feature.
    reason : plural that groups the remarks, such as "roofs without walls set aside".
    geometry : geometry in the frame of the source, or None.
    """

    id: str
    reason: str
    geometry: BaseGeometry | None


@dataclass(frozen=True, slots=True)
class Fault:
    """Broken unit of the input: the run goes on without it, reports the reason and exits with 1.

    Attributes
    ----------
    id : id of the unit, or the name of its file.
    kind : "building", "street", "panorama", "photo" or "exemplar".
    reason : defect and remedy, one line.
    place : geometry in the frame of the source, or None.
    """

    id: str
    kind: str
    reason: str
    place: BaseGeometry | None = None


@dataclass(frozen=True, slots=True)
class Centreline:
    """Piece of a street centreline in the frame of its source; pieces of one name are merged later.

    Attributes
    ----------
    id : unique in the source.
    line : centreline.
    name : name of the street.
    passage : OpenStreetMap tags of a passage through buildings; None for other streets.
    """

    id: str
    line: LineString
    name: str | None
    passage: Mapping[str, str] | None = None


@dataclass(frozen=True, slots=True)
class GroundFeature:
    """Ground feature of a map in the frame of its source: point, line or outline, with tags."""

    id: str
    geometry: BaseGeometry
    tags: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Footprints:
    """Footprints of one source; crs is None where the source states none."""

    crs: str | None
    items: tuple[Footprint, ...]
    remarks: tuple[Remark, ...] = ()
    faults: tuple[Fault, ...] = ()

    def bounding_boxes(self) -> Float64Array:
        """Return the (n, 4) bounding boxes (xmin, ymin, xmax, ymax) of the outlines."""
        return _bounding_boxes(footprint.outline for footprint in self.items)

    def item_outline(self, index: int) -> BaseGeometry:
        """Return the outline of an item."""
        return self.items[index].outline

    def translate(self, offset: Sequence[float]) -> Footprints:
        """Return a copy with outlines and ground heights translated by (x, y, z)."""
        x, y, z = offset

        def move(outline: BaseGeometry) -> BaseGeometry:
            return shapely.transform(outline, lambda xy: xy + np.array([x, y]))

        items = tuple(
            replace(
                f,
                outline=move(f.outline),
                base=None if f.base is None else f.base + z,
                shell=None if f.shell is None else _move_shell(f.shell, offset),
            )
            for f in self.items
        )
        return replace(self, items=items)


@dataclass(frozen=True, slots=True)
class BuildingModels:
    """Building models of one source.

    Attributes
    ----------
    crs : None where the source states none.
    items : models in the order of the source.
    textures : pictures that the texture indices of the shells refer to.
    remarks : notes of the reader.
    faults : broken models.
    """

    crs: str | None
    items: tuple[BuildingModel, ...]
    textures: tuple[Path, ...] = ()
    remarks: tuple[Remark, ...] = ()
    faults: tuple[Fault, ...] = ()

    def bounding_boxes(self) -> Float64Array:
        """Return the (n, 4) bounding boxes (xmin, ymin, xmax, ymax) of the models."""
        return _bounding_boxes(shapely.multipoints(model.shell.vertices[:, :2]) for model in self.items)

    def item_outline(self, index: int) -> BaseGeometry:
        """Return the bounding box of an item as a polygon."""
        return shapely.box(*shapely.bounds(shapely.multipoints(self.items[index].shell.vertices[:, :2])))

    def translate(self, offset: Sequence[float]) -> BuildingModels:
        """Return a copy with shells and ground heights translated by (x, y, z)."""

        def move(model: BuildingModel) -> BuildingModel:
            shell = _move_shell(model.shell, offset)
            return replace(model, shell=shell, base=None if model.base is None else model.base + offset[2])

        return replace(self, items=tuple(map(move, self.items)))

    def scale_heights(self, metres_per_unit: float) -> BuildingModels:
        """Return a copy whose heights are in metres.

        metres_per_unit: metres per unit of the heights as they are.
        """

        def scale(model: BuildingModel) -> BuildingModel:
            return replace(
                model,
                shell=replace(model.shell, vertices=model.shell.vertices * (1.0, 1.0, metres_per_unit)),
                height=None if model.height is None else model.height * metres_per_unit,
                base=None if model.base is None else model.base * metres_per_unit,
            )

        return replace(self, items=tuple(map(scale, self.items)))


@dataclass(frozen=True, slots=True)
class CentrelinesAndGround:
    """Street centrelines and ground features of one source; either may be empty.

    Attributes
    ----------
    crs : None where the source states none.
    items : centrelines.
    faults : broken centrelines.
    remarks : notes of the reader.
    ground : ground features; they include the streets.
    """

    crs: str | None
    items: tuple[Centreline, ...]
    faults: tuple[Fault, ...] = ()
    remarks: tuple[Remark, ...] = ()
    ground: tuple[GroundFeature, ...] = ()

    def bounding_boxes(self) -> Float64Array:
        """Return the (n, 4) bounding boxes (xmin, ymin, xmax, ymax) of the lines."""
        return _bounding_boxes(piece.line for piece in self.items)


def _move_shell(shell: BuildingShell, offset: Sequence[float]) -> BuildingShell:
    return replace(shell, vertices=shell.vertices + np.asarray(offset, np.float64))


def _bounding_boxes(geometries: Iterable[BaseGeometry]) -> Float64Array:
    boxes: Float64Array = shapely.bounds(np.array(list(geometries), dtype=object)).reshape(-1, 4)
    return boxes


def select_textures(
    items: Sequence[WithShellT], textures: tuple[Path, ...]
) -> tuple[list[WithShellT], tuple[Path, ...]]:
    """Return the items with texture indices renumbered to the used textures, and these."""
    indices: list[IntArray] = [one.shell.texture for one in items if one.shell is not None]
    used = np.unique(np.concatenate([np.empty(0, np.int32), *indices]))
    used = used[used >= 0]
    number = np.full(len(textures) + 1, -1, np.int32)  # index -1 maps to -1
    number[used] = np.arange(len(used))
    return [
        one if one.shell is None else replace(one, shell=replace(one.shell, texture=number[one.shell.texture]))
        for one in items
    ], tuple(textures[index] for index in used.tolist())


def safe_file_stem(identifier: str) -> str:
    """Return an id as a file name without suffix, of at most MAX_STEM_LENGTH characters.

    An id that is a valid name on every file system stays; others get a short digest as suffix.
    """
    if len(identifier) <= MAX_STEM_LENGTH and re.fullmatch(r"[\w{}()+=@-][\w {}()+=@.-]*", identifier, re.ASCII):
        return identifier
    plain = re.sub(r"[^\w{}()+=@-]", "_", identifier[:80], flags=re.ASCII)
    digest = hashlib.blake2b(identifier.encode(errors="surrogatepass"), digest_size=4).hexdigest()
    return f"{plain}-{digest}"


def natural_sort_key(identifier: str) -> tuple[tuple[str, int, str], ...]:
    """Return a sort key that puts w9 before w10, for any number of digits."""
    found = re.findall(r"(\D*)(\d*)", identifier)
    stripped = [(text, number.lstrip("0") or number[:1]) for text, number in found]
    return tuple((text, len(number), number) for text, number in stripped)


def make_unique_id(identifier: str, id_counts: Counter[str], remarks: list[Remark], path: Path) -> str:
    """Return an id that is unique in its file; a repeated one gets a number and a remark.

    Parameters
    ----------
    identifier : id as stated.
    id_counts : number of occurrences of each id so far; updated.
    remarks : receives the remark.
    path : file that the remark names.
    """
    id_counts[identifier] += 1
    if id_counts[identifier] == 1:
        return identifier
    unique = f"{identifier}-{id_counts[identifier]}"
    remarks.append(Remark(unique, f"buildings of {path.name} numbered since another has their id", None))
    return unique


def feature_ids_by_reason(remarks: Iterable[Remark]) -> dict[str, list[str]]:
    """Return reason -> ids of the features whose remarks state it."""
    found: dict[str, list[str]] = {}
    for remark in remarks:
        found.setdefault(remark.reason, []).append(remark.id)
    return found


def format_reason_notes(reasons: Mapping[str, Iterable[str]], *, max_ids: int = 8) -> tuple[str, ...]:
    """Return one note per reason: the number of features and the first `max_ids` ids."""
    notes = []
    for reason, found in reasons.items():
        ids = sorted(found, key=natural_sort_key)
        if ids:
            more = f" and {len(ids) - max_ids} more" if len(ids) > max_ids else ""
            notes.append(f"{reason}: {len(ids)} ({', '.join(ids[:max_ids])}{more})")
    return tuple(notes)
