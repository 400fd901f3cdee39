"""Grouping of triangles into building models, by names or by connected components."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from catalogs.features import BuildingModel, Fault, Remark
from catalogs.readers.material_colours import choose_finish
from catalogs.readers.settings import LIMITS, MODELS
from catalogs.readers.vectors.colours import Colour
from facade_core.core.arrays import Float64Array, FloatArray, Int64Array, IntArray
from facade_core.core.types import SEMANTICS, BuildingShell

# Semantic by a word in the name of a surface; the first match counts, so that a roof window is a window.
_SEMANTICS_BY_WORD = {"window": "window", "door": "door", "ceiling": "ceiling", "outerfloor": "roof", "roof": "roof"}
_SEMANTICS_BY_WORD |= {"wall": "wall", "facade": "wall", "ground": "ground"}
_SEMANTICS_BY_WORD |= {
    "fenster": "window",
    "raam": "window",
    "dach": "roof",
    "dak": "roof",
    "wand": "wall",
    "gevel": "wall",
}
SURFACE_WORDS = "|".join(_SEMANTICS_BY_WORD)
_SURFACE_NAME = re.compile(rf"(outer)?({SURFACE_WORDS})s?[\W_]*(surface)?s?[\W_\d]*", re.IGNORECASE)
_INTERIOR_CLASS = re.compile(r"(closure|interiorwall|floor|ceiling|intbuildinginstallation)(surface)?", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class MeshSurface:
    """Triangles of one semantic.

    Attributes
    ----------
    building : name of the building, None without.
    semantic : member of SEMANTICS.
    corners : (t, 3, 3) metres, z up.
    texture : index of the picture, -1 without.
    uv : (t, 3, 2) or None.
    colour : colour of its material where no picture shows it; None without one.
    """

    building: str | None
    semantic: str
    corners: Float64Array
    texture: int = -1
    uv: FloatArray | None = None
    colour: Colour | None = None


class MeshContent(NamedTuple):
    """Surfaces of a mesh file, with the pictures that their texture indices refer to, and the frame that it states."""

    surfaces: list[MeshSurface]
    textures: tuple[Path, ...] = ()
    remarks: Sequence[Remark] = ()
    faults: Sequence[Fault] = ()
    crs: str | None = None


def semantic_from_names(*names: str | None) -> str:
    """Return the member of SEMANTICS of the first name with a known word."""
    for name in names:
        for word, semantic in _SEMANTICS_BY_WORD.items():
            if word in (name or "").lower():
                return semantic
    return "unknown"


def is_surface_name(name: str) -> bool:
    """Return True for a name of a surface, such as "RoofSurface" or "walls.001"."""
    return _SURFACE_NAME.fullmatch(name) is not None


def is_interior_class(name: str) -> bool:
    """Return True for a CityGML surface class outside the outer shell.

    These are closures and interior surfaces.
    """
    return _INTERIOR_CLASS.fullmatch(name) is not None


@np.errstate(invalid="ignore")  # invalid vertices become faults
def group_into_models(
    surfaces: Sequence[MeshSurface], stem: str, remarks: list[Remark]
) -> tuple[tuple[BuildingModel, ...], tuple[Fault, ...]]:
    """Return the models of a file and the faults.

    Several names give one model each, unless they name single surfaces. Otherwise each connected component is a model, numbered
    from west to east; components above one another are merged. A model with a vertex that is not finite is a fault.

    Parameters
    ----------
    surfaces : surfaces of the file.
    stem : name of buildings without a name.
    remarks : receives remarks on models.
    """
    surfaces = [_mask_far_vertices(surface) for surface in surfaces if len(surface.corners)]
    models, faults = [], []
    for name, parts in _group_surfaces(surfaces, stem):
        shell = _build_shell(parts)
        if shell is None:
            reason = f"model {name} has no triangle with an area; give it faces, or take its name out of the file"
            faults.append(Fault(name, "building", reason))
        elif not np.isfinite(shell.vertices).all():
            reason = (
                f"model {name} has a vertex that is missing, no finite number or absurdly far away, or a face of over "
                f"{LIMITS.max_corners} corners; mend it and export the model again"
            )
            known = shell.vertices[np.isfinite(shell.vertices).all(axis=1)]
            place = shapely.box(*known[:, :2].min(axis=0), *known[:, :2].max(axis=0)) if len(known) else None
            faults.append(Fault(name, "building", reason, place))
        else:
            coloured = [(one.semantic, _triangle_normals(one.corners), one.colour) for one in parts if one.colour]
            models.append(BuildingModel(name, shell, finish=choose_finish(coloured, name, remarks)))
    return tuple(models), tuple(faults)


def _group_surfaces(surfaces: Sequence[MeshSurface], stem: str) -> Iterable[tuple[str, list[MeshSurface]]]:
    by_name: dict[str, list[MeshSurface]] = defaultdict(list)
    for surface in surfaces:
        by_name[surface.building or stem].append(surface)
    if len(by_name) == 1:
        return _split_components(surfaces, next(iter(by_name)))
    if _are_surface_names(surfaces):
        return _split_components(_merge_by_kind(surfaces), stem)
    return by_name.items()


def _triangle_normals(corners: Float64Array) -> Float64Array:
    normals: Float64Array = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    return normals


def _mask_far_vertices(surface: MeshSurface) -> MeshSurface:
    """Return a surface with NaN for coordinates beyond LIMITS.max_coordinate, and 0 for such texture coordinates."""
    corners = np.where(np.abs(surface.corners) < LIMITS.max_coordinate, surface.corners, np.nan)
    uv = None if surface.uv is None else np.where(np.abs(surface.uv) < LIMITS.max_coordinate, surface.uv, 0.0)
    return replace(surface, corners=corners, uv=uv)


def _are_surface_names(surfaces: Sequence[MeshSurface]) -> bool:
    """Return True where names count single surfaces.

    Most named parts are then flat, and they form far fewer components than there are names.
    """
    corners = np.concatenate([surface.corners for surface in surfaces])
    number: dict[str | None, int] = {}
    name = np.repeat(
        [number.setdefault(surface.building, len(number)) for surface in surfaces], [len(s.corners) for s in surfaces]
    )
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    order = np.lexsort((-length, name))
    largest = normal[order[np.unique(name[order], return_index=True)[1]]][name]
    level = np.linalg.norm(np.cross(normal, largest), axis=1) <= 0.02 * length * np.linalg.norm(largest, axis=1)
    flat = np.bincount(name, ~level, len(number)) == 0
    if len(flat) < 6 or 2 * flat.sum() <= len(flat):  # a box has six
        return False
    return 2 * (int(_connected_components(corners).max()) + 1) <= len(flat)


def _merge_by_kind(surfaces: Sequence[MeshSurface]) -> list[MeshSurface]:
    """Merge surfaces of one semantic, picture and colour."""
    kinds: dict[tuple[str, int, Colour | None], list[MeshSurface]] = defaultdict(list)
    for surface in surfaces:
        kinds[surface.semantic, surface.texture, surface.colour].append(surface)
    merged = []
    for (semantic, texture, colour), same in kinds.items():
        uv = None if texture < 0 else np.concatenate([s.uv for s in same if s.uv is not None])
        merged.append(MeshSurface(None, semantic, np.concatenate([s.corners for s in same]), texture, uv, colour))
    return merged


def _build_shell(surfaces: Sequence[MeshSurface]) -> BuildingShell | None:
    """Return a shell with shared vertices and without degenerate triangles; None where nothing is left."""
    corners = np.concatenate([surface.corners for surface in surfaces])
    sizes = [len(surface.corners) for surface in surfaces]
    vertices, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    triangles = index.reshape(-1, 3).astype(np.int32)
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    keep = ~(twice <= 2e-9)  # NaN stays and becomes a fault
    if not keep.any():
        return None
    uv = [np.zeros((len(s.corners), 3, 2)) if s.uv is None else s.uv for s in surfaces]
    return BuildingShell(
        vertices=vertices,
        triangles=triangles[keep],
        semantic=np.repeat([SEMANTICS.index(s.semantic) for s in surfaces], sizes)[keep].astype(np.uint8),
        texture=np.repeat([s.texture for s in surfaces], sizes)[keep].astype(np.int32),
        uv=np.concatenate(uv)[keep].astype(np.float32),
    )


def _split_components(surfaces: Sequence[MeshSurface], name: str) -> Iterator[tuple[str, list[MeshSurface]]]:
    """Yield (name, surfaces) of each building component: name-0, name-1, ... for several."""
    corners = np.concatenate([surface.corners for surface in surfaces])
    building = _merge_overlapping(corners, _connected_components(corners))
    finite = np.where(np.isfinite(corners), corners, np.inf)
    west = np.full((building.max() + 1, 2), np.inf)
    np.minimum.at(west, building, finite[..., :2].min(axis=1))
    order = np.lexsort((west[:, 1], west[:, 0]))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))

    found: list[list[MeshSurface]] = [[] for _ in order]
    ends = np.cumsum([len(surface.corners) for surface in surfaces])[:-1]
    for surface, places in zip(surfaces, np.split(rank[building], ends), strict=True):
        in_order = np.argsort(places, kind="stable")
        for chosen in np.split(in_order, np.flatnonzero(np.diff(places[in_order])) + 1):
            uv = None if surface.uv is None else surface.uv[chosen]
            part = replace(surface, building=name, corners=surface.corners[chosen], uv=uv)
            found[places[chosen[0]]].append(part)
    for index, parts in enumerate(found):
        yield name if len(found) == 1 else f"{name}-{index}", parts


def _connected_components(corners: Float64Array) -> Int64Array:
    """Return the component number (t,) of each triangle; triangles that share a vertex are connected."""
    points = corners.reshape(-1, 3)
    finite = np.asarray(np.isfinite(points).all(axis=1))
    grid = np.round(np.where(finite[:, None], points, 0.0) / MODELS.weld_m).astype(np.int64)
    vertex = np.zeros(len(points), np.int64)
    for axis in range(3):  # three sorts of numbers are faster than one sort of rows
        place = np.unique(grid[:, axis], return_inverse=True)[1]
        vertex = np.unique(vertex * (place.max() + 1) + place, return_inverse=True)[1]
    vertex[~finite] = vertex.max() + 1 + np.arange((~finite).sum())  # invalid vertices connect nothing
    triangles = vertex.reshape(-1, 3)
    start, end = triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel()
    count = int(vertex.max()) + 1
    graph = coo_array((np.ones(len(start), np.bool_), (start, end)), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    return np.unique(label[triangles[:, 0]], return_inverse=True)[1]


def _merge_overlapping(corners: Float64Array, component: IntArray) -> IntArray:
    """Return component numbers (t,) with each component merged into the component that it overlaps most."""
    count = int(component.max()) + 1
    if count == 1:
        return component
    plan = corners[..., :2]
    edges = plan[:, 1:] - plan[:, :1]
    area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    level = np.isfinite(plan).all(axis=(1, 2))
    flat = np.flatnonzero(level & (area > 1e-6))
    # a triangle counts at its centre, vertical ones by a small weight
    weight = np.where(level, area + 1e-6 * np.abs(edges).max(axis=(1, 2)) + 1e-12, 0.0)
    total = np.bincount(component, weight, count)

    tree = shapely.STRtree(shapely.polygons(plan[flat]))
    asked = np.flatnonzero(level)
    middles = shapely.points(plan[asked].mean(axis=1))
    point, hit = tree.query(middles, predicate="dwithin", distance=MODELS.max_plan_offset_m)
    point, other = asked[point], component[flat[hit]]
    pairs = np.unique(np.stack([point, other])[:, component[point] != other], axis=1)
    share = coo_array((weight[pairs[0]], (component[pairs[0]], pairs[1])), shape=(count, count)).tocsr()
    share.sum_duplicates()
    one, two = share.nonzero()
    part = share.data / np.maximum(total[one], 1e-12)
    # merge each component once, so that a party wall joins one building, not two
    best = np.lexsort((two, -total[two], -part, one))
    first = best[np.r_[True, np.diff(one[best]) != 0]] if len(best) else best
    link = first[part[first] >= MODELS.min_overlap_share]
    graph = coo_array((np.ones(len(link), np.bool_), (one[link], two[link])), shape=(count, count))
    labels: IntArray = connected_components(graph, directed=False)[1][component]
    return labels
