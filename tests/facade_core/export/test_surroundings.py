"""Street objects in exported models."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from facade_core.core.street_objects import OBJECT_KINDS, PlacedObjects
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS
from facade_core.export.models.glb import read_glb_header
from facade_core.export.models.glb_merge import merge_glbs, read_glb_file_header
from facade_core.export.models.textured_mesh import YUpFrame
from facade_core.export.surroundings.gltf import SurroundingModel, encode_surroundings_glb
from facade_core.export.surroundings.models import build_object_model

FRAME = YUpFrame(np.array([100.0, 200.0, 5.0]))
MODELS = [(kind, variant) for kind in OBJECT_KINDS for variant in range(kind.variants)]


def every_object() -> PlacedObjects:
    count = len(MODELS)
    return PlacedObjects(
        tuple(f"n{i}" for i in range(count)),
        np.array([OBJECT_KINDS.index(kind) for kind, _ in MODELS], np.int32),
        np.array([variant for _, variant in MODELS], np.int32),
        np.column_stack([100.0 + 10 * np.arange(count), np.full(count, 210.0), np.full(count, 6.0)]),
        np.linspace(0, 330, count),
        np.array([kind.size for kind, _ in MODELS]) * 1.5,
        np.arange(count) > 0,
    )


@pytest.mark.parametrize(("kind", "variant"), MODELS, ids=[f"{kind.name}-{variant}" for kind, variant in MODELS])
def test_a_model_has_its_size_and_faces_outward(kind, variant) -> None:  # type: ignore[no-untyped-def]
    model = build_object_model(kind, variant)
    corners = model.position[model.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 12 <= len(model.triangles) <= 850
    assert (np.einsum("ij,ikj->ik", normal, model.normal[model.triangles]).sum(axis=1) > 0).all()
    assert np.einsum("ij,ij->i", corners[:, 0], normal).sum() > 0  # the volume: faces look outward
    low, high = model.position.min(axis=0), model.position.max(axis=0)
    assert abs(low[2]) < 0.05 or kind.is_overhead
    assert high[2] == pytest.approx(kind.size[2], rel=0.08)
    # no wider than its size says: what is kept from walls is all of it
    assert ((high - low)[:2] <= np.array(kind.size[:2]) * 1.09 + 0.1).all()
    if kind.name in ("tree", "conifer"):
        assert np.hypot(*model.position[:, :2].T).max() <= kind.size[0] / 2 + 1e-4


def encode(extras: dict[str, object], *, is_instanced: bool = False) -> bytes:
    model = SurroundingModel(every_object(), NO_SURROUNDINGS, FRAME, is_instanced=is_instanced)
    return encode_surroundings_glb(model, extras, "A")


def test_instances_and_nodes_have_the_same_transforms() -> None:
    instanced, nodes = (read_glb_header(io.BytesIO(encode({}, is_instanced=way)))[0] for way in (True, False))
    assert instanced["extensionsRequired"] == ["EXT_mesh_gpu_instancing"]
    assert "extensionsRequired" not in nodes
    assert len(nodes["nodes"]) == len(MODELS)
    first = nodes["nodes"][0]
    assert first["translation"] == [0.0, 1.0, -10.0]
    assert first["rotation"] == [0.0, 0.0, 0.0, 1.0]  # heading 0 faces north
    assert first["scale"] == [1.5, 1.5, 1.5]
    assert [node.get("extras") for node in nodes["nodes"]] == [{"stated": False}] + [None] * (len(MODELS) - 1)


def test_points_of_a_model_are_those_of_its_instances() -> None:
    placed = every_object()
    model = SurroundingModel(placed, NO_SURROUNDINGS, FRAME)
    points = model.points()
    assert len(points) == sum(len(build_object_model(*one).position) for one in MODELS)
    kind, variant = MODELS[0]
    own = build_object_model(kind, variant).position * 1.5 + placed.position[0] - FRAME.origin
    assert points[: len(own)] == pytest.approx(np.column_stack([own[:, 0], own[:, 2], -own[:, 1]]))


def test_objects_are_merged_at_their_places(tmp_path: Path) -> None:
    part = tmp_path / "part.glb"
    part.write_bytes(encode({"origin": [100.0, 200.0, 5.0]}))
    merge_glbs(tmp_path / "all.glb", [read_glb_file_header(part)] * 2, [90.0, 200.0, 5.0], extras={})
    document = read_glb_file_header(tmp_path / "all.glb").document
    assert len(document["nodes"]) == 2 * len(MODELS)
    assert document["nodes"][0]["translation"] == [10.0, 1.0, -10.0]
    assert document["nodes"][-1]["mesh"] == len(document["meshes"]) - 1
    json.dumps(document)
