"""Declaration of the kinds of street objects: tags of a map, shape and size of each.

Reading, placement, models, catalogue and the reference page follow from `OBJECT_KINDS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array


class Facing(StrEnum):
    """What the front of an object faces where the map states no direction."""

    ANYWHERE = "a direction by its id"
    WAY = "the nearest way"
    LINE = "along its line"


@dataclass(frozen=True)
class ObjectKind:
    """Kind of street object.

    Attributes
    ----------
    name : name in the catalogue, and of its model.
    tags : OpenStreetMap tags (key, value); one of them is enough.
    also : tag (key, value) that it must have too; None without.
    size : usual length along its front, depth and height of its model, metres.
    facing : what its front faces.
    spread : largest share by which an unstated size differs from the usual one.
    spacing_m : distance along a mapped line; 0 where a line or an outline states one object in its middle.
    is_joined : pieces along a line are stretched to meet each other.
    foot_m : radius that keeps clear of walls and carriageways.
    is_overhanging : only the foot takes room on the ground, as of trees and lamps.
    is_overhead : hangs above carriageways and tracks, clear of walls.
    variants : number of models.
    """

    name: str
    tags: tuple[tuple[str, str], ...]
    size: tuple[float, float, float]
    facing: Facing = Facing.WAY
    also: tuple[str, str] | None = None
    spread: float = 0.0
    spacing_m: float = 0.0
    is_joined: bool = False
    foot_m: float = 0.3
    variants: int = 1
    is_overhanging: bool = False
    is_overhead: bool = False

    def is_stated_by(self, tags: Mapping[str, str]) -> bool:
        """Return whether tags state an object of this kind."""
        is_tagged = any(tags.get(key) == value for key, value in self.tags)
        return is_tagged and (self.also is None or tags.get(self.also[0]) == self.also[1])


_TREES = (("natural", "tree"), ("natural", "tree_row"))

# Kinds of objects; of several that tags state, the first counts.
OBJECT_KINDS = (
    ObjectKind("conifer", _TREES, (4.0, 4.0, 11.0), Facing.ANYWHERE, ("leaf_type", "needleleaved"), 0.2, 8.0,
               variants=2, is_overhanging=True),
    ObjectKind("tree", _TREES, (6.5, 6.5, 9.0), Facing.ANYWHERE, None, 0.25, 8.0, variants=4, is_overhanging=True),
    ObjectKind("street_lamp", (("highway", "street_lamp"),), (0.5, 1.6, 6.0), is_overhanging=True),
    ObjectKind("bench", (("amenity", "bench"),), (1.8, 0.65, 0.85), foot_m=0.5),
    ObjectKind("bollard", (("barrier", "bollard"),), (0.22, 0.22, 0.95), spacing_m=1.5, foot_m=0.1),
    ObjectKind("waste_basket", (("amenity", "waste_basket"),), (0.45, 0.45, 1.0)),
    ObjectKind("bicycle_stand", (("amenity", "bicycle_parking"),), (3.0, 0.8, 0.85), foot_m=0.8),
    ObjectKind("shelter", (("amenity", "shelter"),), (3.6, 1.7, 2.5), foot_m=1.0),
    ObjectKind("parked_car", (("amenity", "parking_space"),), (1.8, 4.4, 1.5), foot_m=0.9, variants=3),
    ObjectKind("fence", (("barrier", "fence"),), (2.0, 0.08, 1.3), Facing.LINE, None, 0.0, 2.0, True, 0.04),
    ObjectKind("catenary_mast", (("power", "catenary_mast"),), (0.3, 2.6, 7.0), is_overhanging=True),
    ObjectKind("tram_wire", (("railway", "tram"), ("railway", "light_rail")), (5.0, 0.03, 5.5), Facing.LINE,
               ("electrified", "contact_line"), 0.0, 5.0, True, is_overhead=True),
    ObjectKind("hedge", (("barrier", "hedge"),), (2.0, 0.8, 1.2), Facing.LINE, None, 0.0, 2.0, True, 0.2, 2),
)  # fmt: skip
OBJECT_KIND_NAMES = tuple(kind.name for kind in OBJECT_KINDS)
_BY_NAME = {kind.name: kind for kind in OBJECT_KINDS}


def object_kind(name: str) -> ObjectKind:
    """Return the kind of a name."""
    return _BY_NAME[name]


def stated_object_kind(tags: Mapping[str, str]) -> ObjectKind | None:
    """Return the kind that OpenStreetMap tags state; None for other features."""
    return next((kind for kind in OBJECT_KINDS if kind.is_stated_by(tags)), None)


def object_tag_values() -> dict[str, list[str]]:
    """Return the values of each tag that states an object, by key."""
    found: dict[str, list[str]] = {}
    for key, value in dict.fromkeys(tag for kind in OBJECT_KINDS for tag in kind.tags):
        found.setdefault(key, []).append(value)
    return found


def heading_axes(heading: Float64Array) -> Float64Array:
    """Return right, ahead and up (n, 3, 3) of fronts by their headings (n,), degrees clockwise from north."""
    turn = np.radians(heading)
    sine, cosine, zero = np.sin(turn), np.cos(turn), np.zeros(len(turn))
    return np.stack([cosine, -sine, zero, sine, cosine, zero, zero, zero, zero + 1], axis=1).reshape(-1, 3, 3)


@dataclass(frozen=True, eq=False)
class PlacedObjects:
    """Objects that stand on the ground of a block, a row each.

    Attributes
    ----------
    id : id in the map, with a number for each object of a line.
    kind : (n,) indices of OBJECT_KINDS.
    variant : (n,) variant of the model.
    position : (n, 3) middle of the foot, world metres.
    heading : (n,) direction of the front, degrees clockwise from grid north.
    size : (n, 3) length along the front, depth and height, metres.
    is_stated : (n,) the map states the object; else its street only has such objects in all likelihood.
    """

    id: tuple[str, ...]
    kind: Int32Array
    variant: Int32Array
    position: Float64Array
    heading: Float64Array
    size: Float64Array
    is_stated: BoolArray

    def __len__(self) -> int:
        return len(self.id)

    def counts(self) -> dict[str, int]:
        """Return the number of stated objects of each kind that occurs."""
        return _count_kinds(self.kind[self.is_stated])

    def plausible_counts(self) -> dict[str, int]:
        """Return the number of objects of each kind that occurs and that no map states."""
        return _count_kinds(self.kind[~self.is_stated])

    def rows_by_model(self) -> Iterator[tuple[ObjectKind, int, Int32Array]]:
        """Yield the kind, the variant and the rows of the objects of each model."""
        for index, kind in enumerate(OBJECT_KINDS):
            for variant in range(kind.variants):
                rows = np.flatnonzero((self.kind == index) & (self.variant == variant)).astype(np.int32)
                if len(rows):
                    yield kind, variant, rows


def _count_kinds(kind: Int32Array) -> dict[str, int]:
    number = np.bincount(kind, minlength=len(OBJECT_KINDS)).tolist()
    return {name: count for name, count in zip(OBJECT_KIND_NAMES, number, strict=True) if count}


NO_OBJECTS = PlacedObjects(
    (),
    np.zeros(0, np.int32),
    np.zeros(0, np.int32),
    np.zeros((0, 3)),
    np.zeros(0),
    np.zeros((0, 3)),
    np.zeros(0, bool),
)
