"""Building models of city model formats: closed bodies with recessed openings, balconies, ledges and attachments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from facade_core.core.arrays import Float64Array, IntArray
from facade_core.core.types import Element
from facade_core.export.bodies.balconies import WallFrameFace, balcony_faces
from facade_core.export.bodies.building_body import BuildingBody, build_body
from facade_core.export.bodies.element_relief import ElementRelief, place_elements
from facade_core.export.bodies.ledges import ledge_faces, place_ledges
from facade_core.export.bodies.model_face import ModelFace, SemanticSurface
from facade_core.export.bodies.patches import (
    MeshPolygon,
    PolygonMesh,
    polygon_components,
    triangulate_mesh_polygon,
    weld_polygons,
)
from facade_core.export.bodies.recess import WallSpace, recess_opening
from facade_core.export.bodies.settings import BODIES
from facade_core.export.models.textured_mesh import PackedCharts, TexturedMesh
from facade_core.geometry.charts import CHART_KINDS, ChartKind

SURFACE_TYPES = {
    "wall": "WallSurface",
    "roof": "RoofSurface",
    "ground": "GroundSurface",
    "window": "Window",
    "door": "Door",
    "ceiling": "OuterCeilingSurface",
    "metal": "RoofSurface",
}
OPENING_TYPES = {"window": "Window", "door": "Door"}


class SemanticsBuilder:
    """Growing list of one object's semantic surfaces; plain ones are shared by type."""

    def __init__(self) -> None:
        self.surfaces: list[SemanticSurface] = []
        self._shared: dict[str, int] = {}

    def add(self, surface: SemanticSurface) -> int:
        """Add a surface with attributes of its own and return its index."""
        self.surfaces.append(surface)
        return len(self.surfaces) - 1

    def get_or_add(self, kind: str) -> int:
        """Return the index of the shared surface of a type."""
        return self._shared[kind] if kind in self._shared else self._shared.setdefault(kind, self.add({"type": kind}))


@dataclass(frozen=True)
class ModelPart:
    """Faces with the semantic surfaces that they index.

    Attributes
    ----------
    faces : faces of the part.
    surfaces : semantic surfaces.
    is_solid : True if the faces are a closed shell.
    """

    faces: list[ModelFace]
    surfaces: list[SemanticSurface]
    is_solid: bool


@dataclass(frozen=True)
class BuildingModelParts:
    """Parts of a building's model: body, attachments, balconies and ledges.

    Attributes
    ----------
    body : the body.
    attachments : eaves, gutters, dormers and the like.
    balconies : balconies with the id of their facade.
    ledges : ledges with the id of their facade.
    """

    body: ModelPart
    attachments: tuple[ModelPart, ...]
    balconies: tuple[tuple[str, ModelPart], ...]
    ledges: tuple[tuple[str, ModelPart], ...] = ()


def build_building_model_parts(
    packed: PackedCharts,
    triangles: IntArray,
    facades: Mapping[int, str],
    layouts: Mapping[int, Sequence[Element]],
    origin: Float64Array,
    *,
    has_assumed_roof: bool = False,
) -> BuildingModelParts:
    """Build the parts of one building's model.

    Windows and doors are recessed into the wall; balconies and ledges are bodies before it. Faces that close the body without a
    surface of the mesh, such as the ground, have no texture.

    Parameters
    ----------
    packed : charts with their texture pages.
    triangles : (t,) triangles of the building.
    facades : id of the facade on a chart.
    layouts : elements of a chart in metres, y down.
    origin : (3,) origin of the grid of corners, world metres.
    has_assumed_roof : True if the roof shape is assumed; its panes are drawn, not known openings, and count as roof.
    """
    source = packed.source
    surfaces = SemanticsBuilder()
    semantics = _add_chart_semantics(surfaces, source, triangles, facades, has_assumed_roof)
    ground, closing = surfaces.get_or_add("GroundSurface"), surfaces.get_or_add("WallSurface")
    body = build_body(source, triangles, semantics, ground, origin)
    faces: list[ModelFace] = []
    balconies: list[tuple[str, ModelPart]] = []
    ledges: list[tuple[str, ModelPart]] = []
    behind = [_shell_triangles(body.shell)] if layouts else []
    for patch in body.shell.patches:
        chart, elements = patch.chart, layouts.get(patch.chart, ())
        rings = patch.ring_points(body.shell.points)
        if not elements or source.charts.kind[chart] != ChartKind.WALL:
            faces.append(make_face(packed, rings, patch.semantic if patch.semantic >= 0 else closing, chart))
            continue
        wall = _chart_polygon(packed, rings, chart)
        placed = place_elements(wall, elements)
        faces += _cut_openings(packed, body.shell, patch, placed, surfaces, behind)
        balconies += [
            (facades[chart], _attach_to_wall(packed, chart, balcony_faces(e.outline, e.depth.outward_m)))
            for e in placed
            if e.label == "balcony" and e.depth.outward_m
        ]
        along = place_ledges(wall, elements) if wall.is_valid else []
        ledges += [(facades[chart], _attach_to_wall(packed, chart, ledge_faces(box))) for box in along]
    attachments = _make_attachments(packed, body, surfaces.surfaces)
    return BuildingModelParts(
        ModelPart(faces, surfaces.surfaces, body.is_closed), attachments, tuple(balconies), tuple(ledges)
    )


def _add_chart_semantics(
    surfaces: SemanticsBuilder,
    source: TexturedMesh,
    triangles: IntArray,
    facades: Mapping[int, str],
    has_assumed_roof: bool,
) -> dict[int, int]:
    """Add the semantic surfaces of a building's charts and return their indices by chart."""
    semantics = {}
    for chart in np.unique(source.mesh.chart[triangles]).tolist():
        kind = int(source.charts.kind[chart])
        name = SURFACE_TYPES[CHART_KINDS[ChartKind.ROOF if has_assumed_roof and kind == ChartKind.WINDOW else kind]]
        semantics[chart] = (
            surfaces.add({"type": name, "facade": facades[chart]}) if chart in facades else surfaces.get_or_add(name)
        )
    return semantics


def make_face(
    packed: PackedCharts,
    rings: Sequence[Float64Array],
    semantic: int,
    chart: int,
    chart_rings: Sequence[Float64Array] | None = None,
) -> ModelFace:
    """Make a face with the texture of a chart.

    Parameters
    ----------
    packed : charts with their texture pages.
    rings : (k, 3) corners of each ring, world metres.
    semantic : index of its semantic surface.
    chart : textured chart, -1 for none.
    chart_rings : (k, 2) places in the chart's frame that the rings show; by default their own.
    """
    if chart < 0:
        return ModelFace(tuple(rings), semantic)
    places = []
    for k, ring in enumerate(rings):
        of = np.full(len(ring), chart)
        uv = packed.texture_coordinates(
            of, packed.source.charts.coordinates(of, ring) if chart_rings is None else chart_rings[k]
        )
        places.append(np.column_stack([uv[:, 0], 1 - uv[:, 1]]))
    page = int(packed.layout.page[np.searchsorted(packed.charts, chart)])
    return ModelFace(tuple(rings), semantic, tuple(places), page)


def _cut_openings(
    packed: PackedCharts,
    shell: PolygonMesh,
    patch: MeshPolygon,
    elements: Sequence[ElementRelief],
    surfaces: SemanticsBuilder,
    behind: list[Float64Array],
) -> list[ModelFace]:
    """Cut the openings of a wall; returns the wall with holes, the openings and their reveals."""
    charts, chart = packed.source.charts, patch.chart
    rings = patch.ring_points(shell.points)
    faces: list[ModelFace] = []
    holes: list[Float64Array] = []
    recessed: list[Float64Array] = []
    space = WallSpace(charts, chart, np.concatenate(rings), behind)
    for element in elements:
        if element.label not in OPENING_TYPES:
            continue
        found = recess_opening(element.outline, -element.depth.outward_m, space)
        holes.append(found.ring[::-1])
        recessed += [found.triangles()] if found.depth else []
        semantic = surfaces.add({"type": OPENING_TYPES[element.label], "parent": patch.semantic})
        faces.append(make_face(packed, [found.pane_ring], semantic, chart))
        faces += [make_face(packed, [ring], patch.semantic, chart, [flat]) for ring, flat in found.reveals()]
    behind += recessed  # openings of one wall are apart already
    return [make_face(packed, [*rings, *holes], patch.semantic, chart), *faces]


def _attach_to_wall(packed: PackedCharts, chart: int, body: Sequence[WallFrameFace]) -> ModelPart:
    """Place a closed body before a wall, from metres right, down and outward in the chart's frame."""
    charts, surfaces = packed.source.charts, SemanticsBuilder()
    faces = []
    for rings, looks, kind in body:
        points = [
            charts.points(chart, ring[:, 0], ring[:, 1]) + ring[:, 2:] * charts.normals()[chart] for ring in rings
        ]
        faces.append(make_face(packed, points, surfaces.get_or_add(kind), chart, looks))
    return ModelPart(faces, surfaces.surfaces, False)


def _chart_polygon(packed: PackedCharts, rings: Sequence[Float64Array], chart: int) -> Polygon:
    flat = [packed.source.charts.coordinates(np.full(len(ring), chart), ring) for ring in rings]
    return Polygon(flat[0], flat[1:])


def _shell_triangles(shell: PolygonMesh) -> Float64Array:
    """Triangulate a shell to (t, 3, 3)."""
    found = [triangulate_mesh_polygon(patch, shell.points) for patch in shell.patches]
    return shell.points[np.concatenate(found)] if found else np.zeros((0, 3, 3))


def _group_attachments(body: BuildingBody) -> list[list[PolygonMesh]]:
    """Group the attachments whose boxes almost touch."""
    if not body.attachments:
        return []
    corners = [
        piece.points[sorted({c for p in piece.patches for r in p.rings for c in r})] for piece in body.attachments
    ]
    low, high = (np.array([edge(own, axis=0) for own in corners]) for edge in (np.min, np.max))
    near = (
        (low[:, None] <= high[None] + BODIES.max_group_gap_m) & (high[:, None] >= low[None] - BODIES.max_group_gap_m)
    ).all(axis=-1)
    _, of = connected_components(near, directed=False)
    return [[body.attachments[i] for i in np.flatnonzero(of == k)] for k in range(of.max() + 1)]


def _make_attachments(
    packed: PackedCharts, body: BuildingBody, surfaces: Sequence[SemanticSurface]
) -> tuple[ModelPart, ...]:
    return tuple(_make_attachment(packed, pieces, surfaces) for pieces in _group_attachments(body))


def _make_attachment(
    packed: PackedCharts, pieces: Sequence[PolygonMesh], surfaces: Sequence[SemanticSurface]
) -> ModelPart:
    own = SemanticsBuilder()
    faces = []
    for piece in pieces:
        for patch in piece.patches:
            rings = patch.ring_points(piece.points)
            faces.append(make_face(packed, rings, own.get_or_add(surfaces[patch.semantic]["type"]), patch.chart))
    return ModelPart(faces, own.surfaces, False)


def ground_faces(packed: PackedCharts, triangles: IntArray, origin: Float64Array) -> list[list[ModelFace]]:
    """Build the terrain as textured triangles in connected pieces, split at T-junctions.

    Parameters
    ----------
    packed : charts with their texture pages.
    triangles : (t,) triangles of the ground.
    origin : (3,) origin of the grid of corners, world metres.
    """
    mesh = packed.source.mesh
    corners = [[ring] for ring in mesh.vertices[mesh.triangles[triangles]]]
    whole = weld_polygons(corners, mesh.chart[triangles].tolist(), [0] * len(triangles), origin)
    patches = [
        MeshPolygon((tuple(ring),), patch.chart, 0)
        for patch in whole.patches
        for ring in triangulate_mesh_polygon(patch, whole.points).tolist()
    ]
    return [
        [make_face(packed, [whole.points[list(patches[i].rings[0])]], 0, patches[i].chart) for i in piece]
        for piece in polygon_components(patches)
    ]
