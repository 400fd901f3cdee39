"""Gutters along the eaves that a street sees, and the pipes that lead down from them."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b

import numpy as np

from facade_core.geometry.buildings.eaves import Overhang, mitre
from facade_core.geometry.buildings.roof_details import Faces, Trim
from facade_core.geometry.buildings.roof_edges import Edge
from facade_core.geometry.charts import ChartKind

# A building has gutters in this share of all cases; shorter eaves have none, and eaves are as level as the third figure says.
SHARE, SHORTEST_M, LEVEL_M = 0.92, 1.5, 0.02
# A gutter's section, metres out of the roof's edge and above it: its rim, its belly, and its back, which lies in the cove; the
# trough inside, from the rim to under the roof. It tapers off over so much where no other goes on.
RIM, BELLY, BACK, INSIDE, TAPER_M = (0.11, 0.0), (0.085, -0.085), (-0.09, -0.1), (-0.03, -0.045), 0.05
# A pipe's section, metres aside of its middle and out of the wall; its middle lies so far from where the eaves end, and the
# bend over it so far below the cove. Along eaves that go on the next pipe comes after so many metres.
SECTION = ((-0.05, 0.012), (-0.032, 0.095), (0.032, 0.095), (0.05, 0.012))
ASIDE_M, BEND_M, APART_M = 0.16, 0.12, 14.0
# How far out of the roof's edge, and below it, a pipe leaves its gutter; a wall lower than this has none.
OUTLET_M, SUNK_M, LOW_M = 0.03, 0.07, 2.0


def gutters(id: str, over: Overhang, foot: Callable[[np.ndarray], float]) -> Trim | None:
    """The gutters of a building with their pipes; None where it has none.

    foot: where walls begin at a place (2,), metres. A piece of gutter has at most 10 triangles, a pipe 12.
    """
    seed = blake2b(id.encode(errors="surrogatepass"), digest_size=8, person=b"gutters").digest()
    rng = np.random.default_rng(int.from_bytes(seed))
    if rng.random() > SHARE:
        return None
    eaves = [_is_eave(edge) for edge in over.edges]
    faces = Faces()
    for i, edge in enumerate(over.edges):
        if eaves[i]:
            _trough(faces, over, i, [j if j >= 0 and eaves[j] else -1 for j in (edge.before, edge.after)])
    for number, at_end in _outlets(over.edges, eaves, bool(rng.random() < 0.5)):
        _pipe(faces, over, number, at_end, foot)
    return faces.trim() if any(eaves) else None


def _is_eave(edge: Edge) -> bool:
    run = edge.end - edge.start
    return bool(edge.fall > 0 and abs(run[2]) < LEVEL_M and np.hypot(*run[:2]) > SHORTEST_M)


def _trough(faces: Faces, over: Overhang, number: int, beside: list[int]) -> None:
    """The gutter along an eave; beside: the eaves before and after it whose gutters it meets, -1 where it ends."""
    edge, ends = over.edges[number], over.ends[number]
    sides = [_section(over, number, other, after) for after, other in enumerate(beside)]
    if (sides[1][0] - sides[0][0])[:2] @ edge.ahead < 4 * TAPER_M:
        return
    (rim0, belly0, back0, in0), (rim1, belly1, back1, in1) = sides
    outside = [[belly0, belly1, rim1, rim0], [back0, back1, belly1, belly0]]
    down = np.array([0.0, 0.0, INSIDE[1]])
    if beside[0] < 0:
        tip = ends[0] + down
        outside += [[tip, belly0, rim0], [tip, back0, belly0]]
    if beside[1] < 0:
        tip = ends[1] + down
        outside += [[belly1, tip, rim1], [back1, tip, belly1]]
    along = np.append(edge.ahead, 0.0)
    faces.bend(ChartKind.METAL, outside, along)
    faces.bend(ChartKind.METAL, [[rim0, rim1, in1, in0]], along)


def _section(over: Overhang, number: int, other: int, after: int) -> list[np.ndarray]:
    """The corners (3,) of a gutter's section at one end of an eave."""
    edge, end = over.edges[number], over.ends[number][after]
    corner = edge.end if after else edge.start
    found = []
    for out, up in (RIM, BELLY, BACK, INSIDE):
        step = None
        if other >= 0:
            step = mitre(edge._replace(wide=edge.wide + out), _widened(over.edges[other], out))
        place = end[:2] + out * edge.out + (TAPER_M * edge.ahead * (-1 if after else 1) if other < 0 else 0.0)
        if step is not None:
            place = corner[:2] + step
        found.append(np.append(place, end[2] + up))
    return found


def _widened(edge: Edge, out: float) -> Edge:
    return edge._replace(wide=edge.wide + out)


def _outlets(edges: list[Edge], eaves: list[bool], last: bool) -> list[tuple[int, bool]]:
    """Where pipes are: the number of an eave, and whether at its end. At one end of short runs of gutters, the last or the
    first; of long ones at both, and between them at corners."""
    found = []
    for run in _runs(edges, eaves):
        length = [float(np.hypot(*(edges[i].end - edges[i].start)[:2])) for i in run]
        if sum(length) < APART_M:
            found.append((run[-1], True) if last else (run[0], False))
            continue
        gone = APART_M
        for i, own in zip(run, length, strict=True):
            if gone >= APART_M:
                found.append((i, False))
                gone = 0.0
            gone += own
        if edges[run[-1]].after != run[0]:
            found.append((run[-1], True))
    return found


def _runs(edges: list[Edge], eaves: list[bool]) -> list[list[int]]:
    """Eaves whose gutters go on into each other, in order."""
    taken: set[int] = set()
    runs = []
    # those that nothing goes before come first; what is left then are rings
    for ring in (False, True):
        for i, edge in enumerate(edges):
            if not eaves[i] or i in taken or (not ring and edge.before >= 0 and eaves[edge.before]):
                continue
            run = [i]
            while (ahead := edges[run[-1]].after) >= 0 and eaves[ahead] and ahead != i:
                run.append(ahead)
            taken.update(run)
            runs.append(run)
    return runs


def _pipe(faces: Faces, over: Overhang, number: int, at_end: bool, foot: Callable[[np.ndarray], float]) -> None:
    """A pipe from the gutter of an eave, at its end or its start, down the wall."""
    edge, ends = over.edges[number], over.ends[number]
    ahead, out = np.append(edge.ahead, 0.0), np.append(edge.out, 0.0)
    wall = edge.end - ASIDE_M * ahead if at_end else edge.start + ASIDE_M * ahead
    below, top = foot(wall[:2]), wall[2] - over.below - BEND_M
    if top - below < LOW_M:
        return
    head = ends[0][2] - SUNK_M
    rings = [
        [
            wall + aside * ahead + (off + reach) * out + (height - wall[2]) * np.array([0.0, 0.0, 1.0])
            for aside, off in SECTION
        ]
        for height, reach in ((below, 0.0), (top, 0.0), (head, edge.wide + OUTLET_M - SECTION[1][1] / 2))
    ]
    for low, high in zip(rings[:-1], rings[1:], strict=True):
        sides = [[low[k], low[k + 1], high[k + 1], high[k]] for k in range(len(SECTION) - 1)]
        faces.bend(ChartKind.METAL, sides, low[1] - high[1])
