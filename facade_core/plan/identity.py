"""Digests of charts, scene objects and views, independent of changes elsewhere in the block.

Keys of units and places in the atlas are carried over between ingests by them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from hashlib import blake2b
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array, UInt64Array
from facade_core.core.types import PLAIN, BuildingFinish, MappedGround
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.shapes import GroundTiles
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint

T = TypeVar("T")
R = TypeVar("R")


class ParallelMap(Protocol):
    """Callable that applies a function to runs of items, in any process, and joins the results."""

    def __call__(self, function: Callable[[Sequence[T]], list[R]], items: Sequence[T]) -> list[R]: ...


def map_in_this_process(function: Callable[[Sequence[T]], list[R]], items: Sequence[T]) -> list[R]:
    """Apply a function to all items at once in the calling process."""
    return function(items)


# Ids in view digests of pixels without a chart within the range.
SKY = 0
BEYOND = 1


@dataclass(frozen=True)
class SceneObjects:
    """Objects of a block as columns: the buildings in their rows, then each ground chart.

    Attributes
    ----------
    digest : (k,) 64-bit digest of an object's whole surface.
    low, high : (k, 3) corners of its box in metres, inf and -inf without a surface.
    chart_object : (charts,) object of each chart.
    """

    digest: UInt64Array
    low: Float64Array
    high: Float64Array
    chart_object: Int64Array

    def digests_in_box(self, low: Float64Array, high: Float64Array) -> list[str]:
        """Return the sorted hexadecimal digests of the objects whose boxes meet the box from low to high (3,)."""
        near = self._with_surface[self._boxes.query(shapely.box(*low[:2], *high[:2]))]
        meet = (self.low[near] <= high).all(axis=1) & (self.high[near] >= low).all(axis=1)
        return [f"{digest:016x}" for digest in np.sort(self.digest[near[meet]]).tolist()]

    @cached_property
    def _with_surface(self) -> Int64Array:
        return np.flatnonzero(np.isfinite(self.low).all(axis=1))

    @cached_property
    def _boxes(self) -> shapely.STRtree:
        """Return a tree of the boxes of objects with a surface, seen from above."""
        low, high = self.low[self._with_surface], self.high[self._with_surface]
        return shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))


def serialise_finish(finish: BuildingFinish) -> str:
    """Serialise a finish for chart ids, version 1: another text would move charts in every store."""
    return (
        f"Finish(wall_colour={finish.wall_colour!r}, roof_colour={finish.roof_colour!r}, "
        f"wall_material={finish.wall_material!r}, roof_material={finish.roof_material!r})"
    )


def chart_ids(
    charts: Charts, share: Float64Array, names: Sequence[str], finishes: Sequence[BuildingFinish] = ()
) -> UInt64Array:
    """Compute a 64-bit id for each chart, (n,); charts that are equal get different ids by their order.

    Parameters
    ----------
    share : (n,) density of each chart over that of the atlas.
    names : building ids by row.
    finishes : stated colours and materials by row.
    """
    frames = np.column_stack([charts.kind, charts.origin, charts.axis_u, charts.axis_v, charts.size]) + 0.0  # no -0
    count: dict[bytes, int] = {}
    found = np.empty(len(charts), np.uint64)
    for chart, (row, building) in enumerate(zip(frames, charts.building.tolist(), strict=True)):
        name = names[building] if building >= 0 else ""
        if building >= 0 and finishes and finishes[building] != PLAIN:
            name += serialise_finish(finishes[building])
        if share[chart] != 1:
            name += repr(float(share[chart]))
        digest = blake2b(row.tobytes() + name.encode(), digest_size=8)
        twin = count[digest.digest()] = count.get(digest.digest(), -1) + 1
        if twin:
            digest.update(twin.to_bytes(4))
        found[chart] = int.from_bytes(digest.digest())
    return found


def build_scene_objects(charts: Charts, mesh: Mesh, names: Sequence[str]) -> SceneObjects:
    """Build the objects of a block; names are the building ids by row."""
    ground = np.flatnonzero(charts.building < 0)
    of_chart = charts.building.astype(np.int64)
    of_chart[ground] = len(names) + np.arange(len(ground))
    count = len(names) + len(ground)
    owner = of_chart[mesh.chart]
    order = np.argsort(owner, kind="stable")
    corners = mesh.vertices[mesh.triangles[order]] + 0.0
    surface, first_chart = charts.surface[mesh.chart[order]], mesh.chart[order]
    digest = np.zeros(count, np.uint64)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    ends = np.searchsorted(owner[order], np.arange(count + 1))
    for thing in np.flatnonzero(np.diff(ends)).tolist():
        part = slice(ends[thing], ends[thing + 1])
        low[thing], high[thing] = corners[part].min(axis=(0, 1)), corners[part].max(axis=(0, 1))
        found = blake2b(names[thing].encode() if thing < len(names) else b"", digest_size=8)
        found.update(corners[part].tobytes())
        for number in (surface[part], first_chart[part]):
            found.update((number - number.min()).astype(np.int64).tobytes())
        digest[thing] = int.from_bytes(found.digest())
    return SceneObjects(digest, low, high, of_chart)


@dataclass(frozen=True)
class ViewDigests:
    """What viewpoints show, and digests of it.

    Attributes
    ----------
    charts : ascending charts in the panorama of each viewpoint.
    digests : digest of everything that a viewpoint's panorama is made of.
    """

    charts: list[Int32Array]
    digests: tuple[str, ...]


def compute_view_digests(
    scene: Scene,
    objects: SceneObjects,
    ids: UInt64Array,
    viewpoints: Sequence[Viewpoint],
    ground: MappedGround,
    width: int,
    parallel_map: ParallelMap = map_in_this_process,
) -> ViewDigests:
    """Compute what the panorama of each viewpoint shows, and digests of everything it is made of.

    They cover the chart and depth of every pixel, the objects, common surfaces and daylight of the charts, and the ground
    drawn on them. Other changes of the block leave them equal.

    Parameters
    ----------
    objects : objects of the block.
    ids : (charts,) chart ids.
    viewpoints : the viewpoints.
    ground : mapped ground.
    width : panorama width in pixels.
    parallel_map : runs the ray casts.
    """
    traces = parallel_map(partial(_trace_viewpoints, scene, ids, width), viewpoints)
    seen = [trace.charts for trace in traces]
    lit = np.unique(np.concatenate([*seen, np.zeros(0, np.int32)]))
    light = np.zeros(len(scene.charts), np.uint64)
    light[lit] = parallel_map(partial(_daylight_digests, scene), lit.tolist())
    squares = GroundTiles(ground, scene.charts)

    def digest_view(charts: Int32Array, pixels: bytes) -> str:
        digest = blake2b(pixels, digest_size=16)
        ordered = charts[np.argsort(ids[charts])]
        surface = scene.charts.surface[ordered]
        _, first, of = np.unique(surface, return_index=True, return_inverse=True)
        for part in (ids[ordered], objects.digest[objects.chart_object[ordered]], first[of], light[ordered]):
            digest.update(np.ascontiguousarray(part).tobytes())
        for chart in ordered[scene.charts.kind[ordered] == ChartKind.GROUND].tolist():
            digest.update(squares.digest(chart))
        return digest.hexdigest()

    return ViewDigests(seen, tuple(digest_view(trace.charts, trace.pixels) for trace in traces))


class _Trace(NamedTuple):
    """Ascending charts of a viewpoint, and a digest of its pixels."""

    charts: Int32Array
    pixels: bytes


def _trace_viewpoints(scene: Scene, ids: UInt64Array, width: int, cameras: Sequence[Viewpoint]) -> list[_Trace]:
    found = []
    for camera in cameras:
        _, depth, chart = scene.cast_panorama(camera, width)
        shown = chart != MISS
        pixels = np.where(shown, ids[chart], np.where(np.isfinite(depth), BEYOND, SKY).astype(np.uint64))
        place = np.concatenate([camera.position, camera.forward]).tobytes()
        digest = blake2b(place, digest_size=16)
        digest.update(pixels.tobytes())
        digest.update(np.where(shown, depth, 0).astype(np.float32).tobytes())
        seen = np.zeros(len(scene.charts), bool)
        seen[chart[shown]] = True
        found.append(_Trace(np.flatnonzero(seen).astype(np.int32), digest.digest()))
    return found


def _daylight_digests(scene: Scene, charts: Sequence[int]) -> list[int]:
    """Return a 64-bit digest of the daylight on each of some charts."""
    daylight = scene.daylight
    daylight.compute(charts)
    found = []
    for chart in charts:
        start = int(daylight.start[chart])
        cells = daylight.light[start : start + int(daylight.rows[chart] * daylight.columns[chart])]
        found.append(int.from_bytes(blake2b(cells.tobytes(), digest_size=8).digest()))
    return found
