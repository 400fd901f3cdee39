"""Buildings of a block as faces: a closed body with a facade's windows and doors set back in it, and what stands out of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from facade_core.core.types import Element
from facade_core.export.bodies.balconies import BalconyFace, balconies_on, balcony, behind_railings
from facade_core.export.bodies.building_body import Body, body_of
from facade_core.export.bodies.ledges import ledge, ledges_on
from facade_core.export.bodies.openings import openings_in
from facade_core.export.bodies.patches import Patch, Patches, components, joined, triangulated
from facade_core.export.bodies.recess import cut
from facade_core.export.city_models.cityjson import Face
from facade_core.export.models.textured_mesh import Drawn
from facade_core.geometry.charts import KINDS, ChartKind

SEMANTICS = {
    "wall": "WallSurface",
    "roof": "RoofSurface",
    "ground": "GroundSurface",
    "window": "Window",
    "door": "Door",
    "ceiling": "OuterCeilingSurface",
    "metal": "RoofSurface",
}
OPENINGS = {"window": "Window", "door": "Door"}
# What stands out of a building is one thing where its pieces come this near each other.
BESIDE_M = 0.05


class Surfaces:
    """Semantic surfaces of one object, those that are told apart by nothing each once."""

    def __init__(self) -> None:
        self.all: list[dict[str, Any]] = []
        self._shared: dict[str, int] = {}

    def own(self, kind: str, **more: Any) -> int:
        self.all.append({"type": kind, **more})
        return len(self.all) - 1

    def shared(self, kind: str) -> int:
        return self._shared[kind] if kind in self._shared else self._shared.setdefault(kind, self.own(kind))


@dataclass(frozen=True)
class Part:
    """Faces with the semantic surfaces that they count; solid: whether they are the shell of a body."""

    faces: list[Face]
    surfaces: list[dict[str, Any]]
    solid: bool


@dataclass(frozen=True)
class Modelled:
    """A building: its body; what stands out of it (eaves, gutters, dormers ...); its balconies and ledges, each with the
    facade."""

    body: Part
    beside: tuple[Part, ...]
    balconies: tuple[tuple[str, Part], ...]
    ledges: tuple[tuple[str, Part], ...] = ()


def modelled(
    drawn: Drawn,
    triangles: np.ndarray,
    facades: Mapping[int, str],
    layouts: Mapping[int, Sequence[Element]],
    origin: np.ndarray,
    *,
    assumed: bool = False,
) -> Modelled:
    """One building, on the grid around `origin` (3,).

    triangles: the building's, of the mesh that is drawn. facades: chart -> id of the facade there; layouts: chart -> its
    elements in metres, y down, of which windows and doors are set back in the wall, balconies and ledges stand before it.
    What closes the body where the mesh has no surface, the ground below among it, has no texture. assumed: the roof is, so
    that the panes in it are drawn and no openings that anybody knows of: they count as roof.
    """
    source, mesh = drawn.source, drawn.source.mesh
    surfaces = Surfaces()
    semantics: dict[int, int] = {}
    for chart in np.unique(mesh.chart[triangles]).tolist():
        own_kind = int(source.charts.kind[chart])
        kind = SEMANTICS[KINDS[ChartKind.ROOF if assumed and own_kind == ChartKind.WINDOW else own_kind]]
        semantics[chart] = surfaces.own(kind, facade=facades[chart]) if chart in facades else surfaces.shared(kind)
    ground, closing = surfaces.shared("GroundSurface"), surfaces.shared("WallSurface")
    body = body_of(source, triangles, semantics, ground, origin)
    faces: list[Face] = []
    balconies: list[tuple[str, Part]] = []
    ledges: list[tuple[str, Part]] = []
    behind = [_triangles(body.shell)] if layouts else []
    for patch in body.shell.patches:
        chart, elements = patch.chart, layouts.get(patch.chart, ())
        if elements and source.charts.kind[chart] == ChartKind.WALL:
            wall = _in_frame(drawn, [body.shell.points[list(ring)] for ring in patch.rings], chart)
            before = balconies_on(wall, elements) if wall.is_valid else []
            faces += _opened(drawn, body.shell, patch, behind_railings(elements, before), surfaces, behind)
            if wall.is_valid:
                balconies += [(facades[chart], _before(drawn, chart, balcony(box))) for box in before]
                ledges += [(facades[chart], _before(drawn, chart, ledge(box))) for box in ledges_on(wall, elements)]
        else:
            rings = tuple(body.shell.points[list(ring)] for ring in patch.rings)
            faces.append(face_of(drawn, rings, patch.semantic if patch.semantic >= 0 else closing, chart))
    beside = tuple(_stands_out(drawn, pieces, surfaces.all) for pieces in _together(body))
    return Modelled(Part(faces, surfaces.all, body.closed), beside, tuple(balconies), tuple(ledges))


def face_of(
    drawn: Drawn,
    rings: Sequence[np.ndarray],
    semantic: int,
    chart: int,
    flat: Sequence[np.ndarray] | None = None,
) -> Face:
    """A polygon with the look of a chart (-1: none): at its own corners, or at places in the chart's frame, `flat`."""
    if chart < 0:
        return Face(tuple(rings), semantic)
    places = []
    for k, ring in enumerate(rings):
        of = np.full(len(ring), chart)
        uv = drawn.texture_coordinates(of, drawn.source.charts.coordinates(of, ring) if flat is None else flat[k])
        places.append(np.column_stack([uv[:, 0], 1 - uv[:, 1]]))
    page = int(drawn.layout.page[np.searchsorted(drawn.charts, chart)])
    return Face(tuple(rings), semantic, tuple(places), page)


def _opened(
    drawn: Drawn,
    shell: Patches,
    patch: Patch,
    elements: Sequence[Element],
    surfaces: Surfaces,
    behind: list[np.ndarray],
) -> list[Face]:
    """A wall's polygon without its openings, these, and their reveals."""
    charts, chart = drawn.source.charts, patch.chart
    rings = [shell.points[list(ring)] for ring in patch.rings]
    wall = _in_frame(drawn, rings, chart)
    faces: list[Face] = []
    holes: list[np.ndarray] = []
    for element, opening in openings_in(wall, elements) if wall.is_valid else []:
        found = cut(opening, charts, chart, np.concatenate(rings), behind)
        holes.append(found.ring[::-1])
        semantic = surfaces.own(OPENINGS[element.label], parent=patch.semantic)
        faces.append(face_of(drawn, [found.pane], semantic, chart))
        faces += [face_of(drawn, [ring], patch.semantic, chart, [flat]) for ring, flat in found.reveals()]
    return [face_of(drawn, [*rings, *holes], patch.semantic, chart), *faces]


def _before(drawn: Drawn, chart: int, body: Sequence[BalconyFace]) -> Part:
    """A closed body before a wall, corners as metres right and down in the chart's frame and out of it."""
    charts, surfaces = drawn.source.charts, Surfaces()
    faces = []
    for rings, looks, kind in body:
        points = [charts.points(chart, ring[:, 0], ring[:, 1]) + ring[:, 2:] * charts.normal()[chart] for ring in rings]
        faces.append(face_of(drawn, points, surfaces.shared(kind), chart, looks))
    return Part(faces, surfaces.all, False)


def _in_frame(drawn: Drawn, rings: Sequence[np.ndarray], chart: int) -> Polygon:
    flat = [drawn.source.charts.coordinates(np.full(len(ring), chart), ring) for ring in rings]
    return Polygon(flat[0], flat[1:])


def _triangles(shell: Patches) -> np.ndarray:
    """A shell as triangles (t, 3, 3)."""
    found = [triangulated(patch, shell.points) for patch in shell.patches]
    return shell.points[np.concatenate(found)] if found else np.zeros((0, 3, 3))


def _together(body: Body) -> list[list[Patches]]:
    """The pieces beside a body in groups whose boxes come within BESIDE_M of each other."""
    if not body.beside:
        return []
    corners = [piece.points[sorted({c for p in piece.patches for r in p.rings for c in r})] for piece in body.beside]
    low, high = (np.array([edge(own, axis=0) for own in corners]) for edge in (np.min, np.max))
    near = ((low[:, None] <= high[None] + BESIDE_M) & (high[:, None] >= low[None] - BESIDE_M)).all(axis=-1)
    _, of = connected_components(near, directed=False)
    return [[body.beside[i] for i in np.flatnonzero(of == k)] for k in range(of.max() + 1)]


def _stands_out(drawn: Drawn, pieces: Sequence[Patches], surfaces: list[dict[str, Any]]) -> Part:
    own = Surfaces()
    faces = []
    for piece in pieces:
        for patch in piece.patches:
            rings = [piece.points[list(ring)] for ring in patch.rings]
            faces.append(face_of(drawn, rings, own.shared(surfaces[patch.semantic]["type"]), patch.chart))
    return Part(faces, own.all, False)


def ground_faces(drawn: Drawn, triangles: np.ndarray, origin: np.ndarray) -> list[list[Face]]:
    """The terrain as textured triangles over the grid around `origin` (3,), in pieces that hang together over edges: triangles
    of the mesh, cut where a corner of a neighbour lies on an edge, without those that fall together."""
    mesh = drawn.source.mesh
    corners = [[ring] for ring in mesh.vertices[mesh.triangles[triangles]]]
    whole = joined(corners, mesh.chart[triangles].tolist(), [0] * len(triangles), origin)
    patches = [
        Patch((tuple(ring),), patch.chart, 0)
        for patch in whole.patches
        for ring in triangulated(patch, whole.points).tolist()
    ]
    return [
        [face_of(drawn, [whole.points[list(patches[i].rings[0])]], 0, patches[i].chart) for i in piece]
        for piece in components(patches)
    ]
