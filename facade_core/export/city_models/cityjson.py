"""CityJSON 2.0: faces with rings, semantics and textures as tables of a document."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution
from facade_core.export.bodies.model_face import ModelFace, SemanticSurface
from facade_core.export.bodies.settings import BODIES

# Metres per unit of a vertex.
METRES_PER_UNIT = BODIES.grid_m
THEME = "streetloom"
# Decimals of a texture coordinate: a hundredth of a texel of the largest page.
UV_DECIMALS = 6
# Published extension for the lineage of data.
METADATA_EXTENDED = {
    "url": "https://raw.githubusercontent.com/cityjson/metadata-extended/0.6/metadata-extended.ext.json",
    "version": "0.6",
}


@dataclass
class VertexPool:
    """Deduplicated vertices and texture vertices of a document.

    Attributes
    ----------
    origin : (3,) origin of the grid, world metres.
    vertices : index of each vertex, in units of the grid.
    texture_vertices : index of each texture vertex.
    pages : index of each texture page.
    """

    origin: Float64Array
    vertices: dict[tuple[int, ...], int] = field(default_factory=dict)
    texture_vertices: dict[tuple[float, ...], int] = field(default_factory=dict)
    pages: dict[int, int] = field(default_factory=dict)

    def add_ring(self, points: Float64Array, uv: Float64Array | None) -> tuple[list[int], list[int]]:
        """Add a ring and return its vertex and texture vertex indices; empty without area on the grid.

        Parameters
        ----------
        points : (k, 3) world metres.
        uv : (k, 2) texture coordinates; None without.
        """
        grid = np.rint((points - self.origin) / METRES_PER_UNIT).astype(np.int64)
        keep = _largest_loop(grid)
        grid = grid[keep]
        if len(grid) < 3:
            return [], []
        corners = [self.vertices.setdefault(tuple(p), len(self.vertices)) for p in grid.tolist()]
        if uv is None:
            return corners, []
        places = uv[keep].round(UV_DECIMALS).tolist()
        return corners, [self.texture_vertices.setdefault(tuple(p), len(self.texture_vertices)) for p in places]

    def add_page(self, page: int) -> int:
        """Return the index of a texture page."""
        return self.pages.setdefault(page, len(self.pages))

    def tables(self, images: Sequence[str]) -> JsonObject:
        """Return `vertices` and `appearance` of the document; `images` has the file of every page."""
        tables: JsonObject = {"vertices": [list(vertex) for vertex in self.vertices]}
        if self.pages:
            tables["appearance"] = {
                "default-theme-texture": THEME,
                "textures": [{"type": "JPG", "image": images[page]} for page in self.pages],
                "vertices-texture": [list(place) for place in self.texture_vertices],
            }
        return tables

    def extent(self) -> list[float]:
        """Return the least and greatest x, y, z of the vertices, world metres."""
        points = np.array(list(self.vertices)) * METRES_PER_UNIT + self.origin
        extent: list[float] = np.concatenate([points.min(axis=0), points.max(axis=0)]).round(3).tolist()
        return extent


def _largest_loop(grid: Int64Array) -> Int64Array:
    """Return the corners of a grid ring (k, 3) in its largest part that visits no corner twice; empty without area."""
    keep = np.flatnonzero((grid != np.roll(grid, 1, axis=0)).any(axis=1))
    _, place = np.unique(grid[keep], axis=0, return_inverse=True)
    place = place.reshape(-1)
    while len(different := np.unique(place)) < len(place):
        # two visits of a corner divide the ring into two parts
        twice = next(p for p in different.tolist() if (place == p).sum() > 1)
        first, second = np.flatnonzero(place == twice)[:2]
        inside = np.arange(first, second)
        outside = np.setdiff1d(np.arange(len(place)), inside)
        part = max(inside, outside, key=lambda part: _grid_area(grid[keep[part]]))
        keep, place = keep[part], place[part]
    return keep if _grid_area(grid[keep]) > 0 else keep[:0]


def _grid_area(grid: Int64Array) -> float:
    """Return the area of a ring (k, 3) in units of the grid."""
    if len(grid) < 3:
        return 0.0
    offset = (grid - grid[0]).astype(np.float64)
    return float(np.linalg.norm(np.cross(offset[1:-1], offset[2:]).sum(axis=0))) / 2


def build_geometry(
    faces: Sequence[ModelFace],
    surfaces: Sequence[SemanticSurface],
    pool: VertexPool,
    lod: str,
    kind: str = "MultiSurface",
) -> JsonObject:
    """Build a geometry of faces and add its vertices to the pool.

    Parameters
    ----------
    faces : faces of the geometry.
    surfaces : semantic surfaces that the faces index; unused ones are dropped.
    pool : vertices of the document; changed in place.
    lod : level of detail.
    kind : "MultiSurface", "Solid" of a closed shell, or "CompositeSurface" without semantics.
    """
    boundaries: list[list[list[int]]] = []
    values: list[int] = []
    textures: list[list[list[int | None]]] = []
    for face in faces:
        corners, places = _add_face(face, pool)
        if corners:
            boundaries.append(corners)
            values.append(face.semantic)
            textures.append(places)
    textured = any(rings[0] != [None] for rings in textures)
    semantics = _build_semantics(values, surfaces) if kind != "CompositeSurface" else None
    is_solid = kind == "Solid"  # has a list of shells around its faces
    geometry: JsonObject = {"type": kind, "lod": lod, "boundaries": [boundaries] if is_solid else boundaries}
    if semantics is not None:
        geometry["semantics"] = semantics | ({"values": [semantics["values"]]} if is_solid else {})
    if textured:
        geometry["texture"] = {THEME: {"values": [textures] if is_solid else textures}}
    return geometry


def _add_face(face: ModelFace, pool: VertexPool) -> tuple[list[list[int]], list[list[int | None]]]:
    """Add a face to the pool; returns the corners and the texture of its rings, empty without area on the grid."""
    uv: Sequence[Float64Array | None] = face.uv if face.page is not None else [None] * len(face.rings)
    rings = [pool.add_ring(points, own) for points, own in zip(face.rings, uv, strict=True)]
    if not rings[0][0]:
        return [], []
    rings = [ring for ring in rings if ring[0]]
    page: list[int | None] = [None] if face.page is None else [pool.add_page(face.page)]
    return [corners for corners, _ in rings], [[*page, *places] for _, places in rings]


def _build_semantics(values: Sequence[int], surfaces: Sequence[SemanticSurface]) -> JsonObject:
    """Build the semantics of faces from the used surfaces and their parents, with children."""
    used = set(values)
    used |= {surfaces[i]["parent"] for i in used if "parent" in surfaces[i]}
    index = {old: new for new, old in enumerate(sorted(used))}
    kept: list[SemanticSurface] = [{**surfaces[old]} for old in sorted(used)]
    for new, surface in enumerate(kept):
        if "parent" in surface:
            surface["parent"] = index[surface["parent"]]
            kept[surface["parent"]].setdefault("children", []).append(new)
    return {"surfaces": kept, "values": [index[value] for value in values]}


def empty_document(
    title: str, origin: Float64Array, reference_system: str | None, attribution: Attribution
) -> JsonObject:
    """Return a CityJSON 2.0 document without objects.

    The attribution uses an extension, because the core has only a point of contact with an address.

    Parameters
    ----------
    title : name of the model.
    origin : (3,) origin of the grid, world metres.
    reference_system : URL of the reference system; None if unknown.
    attribution : attribution of the data.
    """
    return {
        "type": "CityJSON",
        "version": "2.0",
        "extensions": {"MetadataExtended": METADATA_EXTENDED},
        "transform": {"scale": [METRES_PER_UNIT] * 3, "translate": origin.tolist()},
        "metadata": {
            "title": title,
            **({"referenceDate": attribution.production_date} if attribution.production_date else {}),
            **({"referenceSystem": reference_system} if reference_system else {}),
        },
        "+metadata-extended": {**attribution.iso_metadata(), "textures": "present", "materials": "absent"},
        "CityObjects": {},
        "vertices": [],
    }
