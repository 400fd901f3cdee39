"""The published block as binary glTF: the atlas as it is, one node per building."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from facade_core.export.glb import Node, Primitive, glb_bytes
from facade_core.export.models import GROUND_NODE, grouped, local_frame
from facade_core.street.scene import Scene


def write_glb(path: Path, scene: Scene, pages: Mapping[int, bytes], names: Mapping[int, str] | None = None) -> None:
    """Write a block as GLB: a node per building and one for the ground, textured with the atlas pages' JPEGs in `pages`.

    names: building -> name of its node, its number where there is none. glTF's frame is y up: (x, y, z) = (east, up, -north)
    metres around the block's centre on its lowest ground, which is kept in the scene's extras as `origin` (easting, northing,
    height). The file appears whole or not at all.
    """
    charts, placement, mesh, spec = scene.charts, scene.placement, scene.mesh, scene.spec
    frame = local_frame(mesh)
    position = frame.points(mesh.vertices).astype(np.float32)
    xy = mesh.chart_coordinates(charts) * spec.texels_per_metre
    uv = (np.column_stack([placement.x, placement.y])[mesh.vertex_chart] + xy) / spec.page
    normals = frame.directions(charts.normal()[mesh.vertex_chart])

    shown = sorted(pages)
    parts: dict[int, list[Primitive]] = {}
    owner, page = charts.building[mesh.chart].astype(np.int64), placement.page[mesh.chart]
    for code, triangles in grouped((owner + 1) * placement.pages + page).items():
        building, picture = code // placement.pages - 1, code % placement.pages
        if picture not in pages:
            continue
        used, index = np.unique(mesh.triangles[triangles], return_inverse=True)
        part = Primitive(position[used], normals[used], uv[used], index.reshape(-1, 3), shown.index(picture))
        parts.setdefault(building, []).append(part)
    names = names or {}
    nodes = [
        Node(names.get(building, str(building)) if building >= 0 else GROUND_NODE, tuple(parts[building]))
        for building in sorted(parts, key=lambda b: (b < 0, b))
    ]
    data = glb_bytes(nodes, [pages[page] for page in shown], extras={"origin": frame.origin.tolist()})
    temporary = path.with_suffix(".tmp")
    temporary.write_bytes(data)
    os.replace(temporary, path)
