"""Models show every chart with its own raster, keep pictures as encoded, and are valid."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from facade_core.export.models.glb import GltfNode, Primitive, encode_glb
from facade_core.export.models.pages import GUTTER_TEXELS, draw_page, lay_out_shelves
from facade_core.export.models.textured_mesh import (
    TexturedMesh,
    build_nodes,
    encode_pages,
    mesh_y_up_frame,
    pack_charts_on_pages,
)
from tests.facade_core.export.conftest import colour_of

NAMES = {0: "a", 1: "b/1 ü"}


def model(source: TexturedMesh, buildings: list[int], scale: float = 1.0) -> bytes:
    drawn = pack_charts_on_pages(source, source.select_charts(np.array(buildings)), scale)
    nodes, _ = build_nodes([drawn], NAMES, mesh_y_up_frame(source.mesh))
    return encode_glb(nodes, encode_pages(drawn), extras={"origin": [1, 2, 3]})


def test_every_triangle_shows_its_own_chart(coloured: TexturedMesh) -> None:
    scene = trimesh.load(io.BytesIO(model(coloured, [0, 1, -1])), file_type="glb")
    assert set(scene.graph.nodes_geometry) == {"a", "b/1 ü", "ground"}
    frame = mesh_y_up_frame(coloured.mesh)
    middles = frame.points(coloured.mesh.vertices[coloured.mesh.triangles].mean(axis=1))
    checked = 0
    for part in scene.geometry.values():
        image = np.asarray(part.visual.material.baseColorTexture.convert("RGB")).astype(int)
        at = part.visual.uv[part.faces].mean(axis=1)
        pixels = image[((1 - at[:, 1]) * image.shape[0]).astype(int), (at[:, 0] * image.shape[1]).astype(int)]
        for middle, pixel in zip(part.vertices[part.faces].mean(axis=1), pixels, strict=True):
            chart = coloured.mesh.chart[np.linalg.norm(middles - middle, axis=1).argmin()]
            assert np.abs(pixel - colour_of(chart)).max() < 12, "JPEG's error at most"
            checked += 1
    assert checked == len(coloured.mesh.triangles)


def test_pictures_are_embedded_byte_for_byte() -> None:
    buffer = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (31, 17, 3), np.uint8)).save(buffer, "JPEG")
    triangle = Primitive(np.eye(3), np.eye(3), np.zeros((3, 2)), np.array([[0, 1, 2]]), 0)
    data = encode_glb([GltfNode("n", (triangle,))], [buffer.getvalue()])
    length, _ = struct.unpack_from("<II", data, 12)
    document = json.loads(data[20 : 20 + length])
    view = document["bufferViews"][document["images"][0]["bufferView"]]
    start = 28 + length + view["byteOffset"]
    assert data[start : start + view["byteLength"]] == buffer.getvalue()
    assert struct.unpack_from("<I", data, 8)[0] == len(data)


def test_models_are_valid(coloured: TexturedMesh, gltf_issues: Callable[..., list[dict]], tmp_path: Path) -> None:
    for name, data in {"block": model(coloured, [0, 1, -1]), "far": model(coloured, [1], 0.1)}.items():
        (tmp_path / f"{name}.glb").write_bytes(data)
    (tmp_path / "empty.glb").write_bytes(encode_glb([], []))
    for issues in gltf_issues(*sorted(tmp_path.glob("*.glb"))):
        assert issues["numErrors"] == 0, issues["messages"]
        assert issues["numWarnings"] == 0, issues["messages"]


@pytest.mark.parametrize("largest", [256, 512])
def test_no_mip_level_down_to_an_eighth_mixes_two_pieces(largest: int) -> None:
    rng = np.random.default_rng(3)
    size = rng.integers(1, 150, (40, 2))
    layout = lay_out_shelves(size, np.arange(40) // 4, largest=largest)
    assert layout.pages.max() <= largest
    assert len(layout.pages) > 1
    colours = rng.integers(0, 255, (40, 3), np.uint8)
    for page in range(len(layout.pages)):
        drawn = draw_page(layout, page, lambda i: np.broadcast_to(colours[i], (size[i, 1], size[i, 0], 3)))
        assert drawn.shape == (layout.pages[page, 1], layout.pages[page, 0], 3)
        coarse = (
            drawn.reshape(drawn.shape[0] // GUTTER_TEXELS, GUTTER_TEXELS, -1, GUTTER_TEXELS, 3)
            .astype(float)
            .mean(axis=(1, 3))
        )
        for i in np.flatnonzero(layout.page == page):
            left, top = layout.x[i] // GUTTER_TEXELS - 1, layout.y[i] // GUTTER_TEXELS - 1
            right, below = (
                -(-(at + side) // GUTTER_TEXELS) for at, side in ((layout.x[i], size[i, 0]), (layout.y[i], size[i, 1]))
            )
            assert (coarse[top : below + 1, left : right + 1] == colours[i]).all(), "and so is the gutter around it"


def test_neighbouring_buildings_share_pages() -> None:
    layout = lay_out_shelves(np.full((64, 2), 90), np.arange(64) // 4, largest=512)
    for page in range(len(layout.pages)):
        held = np.unique((np.arange(64) // 4)[layout.page == page])
        assert (np.diff(held) == 1).all()


def test_a_smaller_scale_has_as_many_fewer_texels(coloured: TexturedMesh) -> None:
    charts = coloured.select_charts(np.array([0]))
    whole, quarter = pack_charts_on_pages(coloured, charts), pack_charts_on_pages(coloured, charts, 0.25)
    assert quarter.layout.size.prod(axis=1).sum() == pytest.approx(whole.layout.size.prod(axis=1).sum() / 16, rel=0.05)
