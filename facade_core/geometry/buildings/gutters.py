"""Gutters along eaves in sight of a street, and their downpipes."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import dot_product
from facade_core.geometry.buildings.eaves import Overhang, mitre_offset
from facade_core.geometry.buildings.roof_details import RoofDetail, RoofDetailBuilder
from facade_core.geometry.buildings.roof_edges import RoofEdge
from facade_core.geometry.buildings.settings import GUTTERS
from facade_core.geometry.charts import ChartKind


def build_gutters(id: str, overhang: Overhang, foot: Callable[[Float64Array], float]) -> RoofDetail | None:
    """Build the gutters and pipes of a building; a piece of gutter has at most 10 triangles, a pipe 12.

    Parameters
    ----------
    id : seed of the random draws.
    overhang : the extended roof.
    foot : height in metres at which walls begin at a place (2,).

    Returns
    -------
    None without gutters.
    """
    seed = blake2b(id.encode(errors="surrogatepass"), digest_size=8, person=b"gutters").digest()
    rng = np.random.default_rng(int.from_bytes(seed))
    if rng.random() > GUTTERS.gutter_share:
        return None
    eaves = [_is_eave(edge) for edge in overhang.edges]
    faces = RoofDetailBuilder()
    for i, edge in enumerate(overhang.edges):
        if eaves[i]:
            _add_trough(faces, overhang, i, [j if j >= 0 and eaves[j] else -1 for j in (edge.previous, edge.following)])
    for number, at_end in _pipe_positions(overhang.edges, eaves, bool(rng.random() < 0.5)):
        _add_pipe(faces, overhang, number, at_end, foot)
    return faces.build() if any(eaves) else None


def _is_eave(edge: RoofEdge) -> bool:
    run = edge.end - edge.start
    return bool(edge.slope > 0 and abs(run[2]) < GUTTERS.max_eaves_slope_m and np.hypot(*run[:2]) > GUTTERS.min_eaves_m)


def _add_trough(faces: RoofDetailBuilder, overhang: Overhang, number: int, adjacent: list[int]) -> None:
    """Add the gutter along an eave; `adjacent` are the eaves before and after it whose gutters it meets, -1 at a free end."""
    edge, ends = overhang.edges[number], overhang.ends[number]
    sides = [_section_corners(overhang, number, other, after) for after, other in enumerate(adjacent)]
    if dot_product((sides[1][0] - sides[0][0])[:2], edge.direction) < 4 * GUTTERS.taper_m:
        return
    (rim0, belly0, back0, in0), (rim1, belly1, back1, in1) = sides
    outer_faces = [[belly0, belly1, rim1, rim0], [back0, back1, belly1, belly0]]
    down = np.array([0.0, 0.0, GUTTERS.trough_m[1]])
    if adjacent[0] < 0:
        tip = ends[0] + down
        outer_faces += [[tip, belly0, rim0], [tip, back0, belly0]]
    if adjacent[1] < 0:
        tip = ends[1] + down
        outer_faces += [[belly1, tip, rim1], [back1, tip, belly1]]
    along = np.append(edge.direction, 0.0)
    faces.add_bent_strip(ChartKind.METAL, outer_faces, along)
    faces.add_bent_strip(ChartKind.METAL, [[rim0, rim1, in1, in0]], along)


def _section_corners(overhang: Overhang, number: int, other: int, after: int) -> list[Float64Array]:
    """Return the corners (3,) of a gutter's section at one end of an eave."""
    edge, end = overhang.edges[number], overhang.ends[number][after]
    corner = edge.end if after else edge.start
    found = []
    for out, up in (GUTTERS.rim_m, GUTTERS.belly_m, GUTTERS.back_m, GUTTERS.trough_m):
        step = None
        if other >= 0:
            step = mitre_offset(*(one._replace(width=one.width + out) for one in (edge, overhang.edges[other])))
        place = (
            end[:2]
            + out * edge.outward
            + (GUTTERS.taper_m * edge.direction * (-1 if after else 1) if other < 0 else 0.0)
        )
        if step is not None:
            place = corner[:2] + step
        found.append(np.append(place, end[2] + up))
    return found


def _pipe_positions(edges: list[RoofEdge], eaves: list[bool], last: bool) -> list[tuple[int, bool]]:
    """Return the eaves with a pipe, and whether it is at the end: one per short run, both ends and corners of long runs."""
    found = []
    for run in _gutter_runs(edges, eaves):
        length = [float(np.hypot(*(edges[i].end - edges[i].start)[:2])) for i in run]
        if sum(length) < GUTTERS.max_pipe_spacing_m:
            found.append((run[-1], True) if last else (run[0], False))
            continue
        distance = GUTTERS.max_pipe_spacing_m
        for i, own in zip(run, length, strict=True):
            if distance >= GUTTERS.max_pipe_spacing_m:
                found.append((i, False))
                distance = 0.0
            distance += own
        if edges[run[-1]].following != run[0]:
            found.append((run[-1], True))
    return found


def _gutter_runs(edges: list[RoofEdge], eaves: list[bool]) -> list[list[int]]:
    """Return runs of eaves with continuous gutters, in order."""
    taken: set[int] = set()
    runs = []
    # first the runs with a free start; the rest are rings
    for ring in (False, True):
        for i, edge in enumerate(edges):
            if not eaves[i] or i in taken or (not ring and edge.previous >= 0 and eaves[edge.previous]):
                continue
            run = [i]
            while (ahead := edges[run[-1]].following) >= 0 and eaves[ahead] and ahead != i:
                run.append(ahead)
            taken.update(run)
            runs.append(run)
    return runs


def _add_pipe(
    faces: RoofDetailBuilder, overhang: Overhang, number: int, at_end: bool, foot: Callable[[Float64Array], float]
) -> None:
    """Add a pipe from the gutter of an eave, at its end or its start, down the wall."""
    edge, ends = overhang.edges[number], overhang.ends[number]
    ahead, out = np.append(edge.direction, 0.0), np.append(edge.outward, 0.0)
    wall = (
        edge.end - GUTTERS.pipe_end_distance_m * ahead if at_end else edge.start + GUTTERS.pipe_end_distance_m * ahead
    )
    below, top = foot(wall[:2]), wall[2] - overhang.below - GUTTERS.pipe_bend_m
    if top - below < GUTTERS.min_pipe_m:
        return
    head = ends[0][2] - GUTTERS.outlet_drop_m
    rings = [
        [
            wall + aside * ahead + (off + reach) * out + (height - wall[2]) * np.array([0.0, 0.0, 1.0])
            for aside, off in GUTTERS.pipe_section_m
        ]
        for height, reach in (
            (below, 0.0),
            (top, 0.0),
            (head, edge.width + GUTTERS.outlet_overhang_m - GUTTERS.pipe_section_m[1][1] / 2),
        )
    ]
    for low, high in zip(rings[:-1], rings[1:], strict=True):
        sides = [[low[k], low[k + 1], high[k + 1], high[k]] for k in range(len(GUTTERS.pipe_section_m) - 1)]
        faces.add_bent_strip(ChartKind.METAL, sides, low[1] - high[1])
