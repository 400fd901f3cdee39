"""The textured block as binary glTF."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from facade_core.street.scene import Scene


def write_glb(path: Path, scene: Scene, pages: Mapping[int, bytes]) -> None:
    """Write a block as GLB: one primitive per atlas page, textured with the page's JPEG in `pages`.

    glTF's frame is y up: (x, y, z) = (east, up, -north) metres around the block's centre on its lowest ground, which is kept
    in the scene's extras as `origin` (easting, northing, height). The file appears whole or not at all.
    """
    import trimesh
    from PIL import Image

    charts, placement, mesh, spec = scene.charts, scene.placement, scene.mesh, scene.spec
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    origin = np.append(((low + high) / 2)[:2].round(), np.floor(low[2]))
    local = mesh.vertices - origin
    position = np.column_stack([local[:, 0], local[:, 2], -local[:, 1]])
    xy = mesh.chart_coordinates(charts) * spec.texels_per_metre
    corner = np.column_stack([placement.x, placement.y])[mesh.vertex_chart]
    uv = (corner + xy) / spec.page
    uv[:, 1] = 1 - uv[:, 1]  # trimesh counts v upwards and turns it over when it writes glTF
    normals = charts.normal()[mesh.vertex_chart]
    normals = np.column_stack([normals[:, 0], normals[:, 2], -normals[:, 1]])

    model = trimesh.Scene(metadata={"origin": origin.tolist()})
    triangle_page = placement.page[mesh.chart]
    for page, jpeg in sorted(pages.items()):
        triangles = mesh.triangles[triangle_page == page]
        if len(triangles) == 0:
            continue
        used, local_index = np.unique(triangles, return_inverse=True)
        material = trimesh.visual.material.PBRMaterial(
            name=f"page-{page}",
            baseColorTexture=Image.open(io.BytesIO(jpeg)),
            metallicFactor=0.0,
            roughnessFactor=1.0,
        )
        part = trimesh.Trimesh(
            vertices=position[used],
            faces=local_index.reshape(-1, 3),
            vertex_normals=normals[used],
            visual=trimesh.visual.TextureVisuals(uv=uv[used], material=material),
            process=False,
        )
        model.add_geometry(part, node_name=f"page-{page}", geom_name=f"page-{page}")
    temporary = path.with_suffix(".tmp")
    temporary.write_bytes(trimesh.exchange.gltf.export_glb(model, include_normals=True))
    os.replace(temporary, path)
