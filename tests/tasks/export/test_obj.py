"""The block as Wavefront OBJ: the triangles, places and textures of the model as GLB."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from facade_core.core.errors import InputError
from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock


def test_an_obj_is_the_textured_model(
    undisturbed: tuple[Path, dict[str, Any]], found: PublishedBlock, tmp_path: Path
) -> None:
    path = Path(str(export_run(undisturbed[0], "obj", tmp_path / "obj", relief="off").files[0]))
    glb = Path(str(export_run(undisturbed[0], "glb", tmp_path / "glb", lit=False, relief="off").files[0]))
    model, other = (trimesh.load(file, process=False, force="scene") for file in (path, glb))
    textured = [part.bounds for part in other.geometry.values() if part.visual.material.name != "surroundings"]
    bounds = np.min(textured, axis=0)[0], np.max(textured, axis=0)[1]
    np.testing.assert_allclose(model.bounds, bounds, atol=0.002)
    assert sum(len(part.faces) for part in model.geometry.values()) == len(found.textured_mesh.mesh.triangles)
    lines = path.read_text("utf-8").splitlines()
    objects = [line.removeprefix("o ") for line in lines if line.startswith("o ")]
    assert objects == [*found.names.values(), "ground"]
    used = {line for line in lines if line.startswith("usemtl ")}
    textures = [line.split()[1] for line in path.with_suffix(".mtl").read_text().splitlines() if "map_Kd" in line]
    assert len(used) == len(textures)
    for texture in textures:
        with Image.open(path.parent / texture) as image:
            assert image.format == "JPEG"


def test_relief_adds_elements_to_the_buildings_alone(
    undisturbed: tuple[Path, dict[str, Any]], found: PublishedBlock, tmp_path: Path
) -> None:
    deep, flat, same = (
        trimesh.load(
            Path(str(export_run(undisturbed[0], "glb", tmp_path / str(k), lit=False, **options).files[0])),
            force="scene",
        )
        for k, options in enumerate(({}, {"relief": "off"}, {"relief": "elements"}))
    )
    default, off, asked = ((tmp_path / str(k) / "block.glb").read_bytes() for k in range(3))
    assert default == asked != off, "as texture.relief states unless an option does"
    assert set(deep.geometry) == set(flat.geometry) == set(same.geometry)
    more = {name: len(part.faces) - len(flat.geometry[name].faces) for name, part in deep.geometry.items()}
    elements = sum(len(found.elements(i)) for i in found.select_finished_facades(found.select_buildings(())))
    assert 0 < sum(more.values()) <= 40 * elements
    assert all(count == 0 for name, count in more.items() if name.startswith("ground"))
    np.testing.assert_allclose(deep.bounds, flat.bounds, atol=1.0)
    with pytest.raises(InputError, match="--relief: is of glb and 3dtiles and obj and usd"):
        export_run(undisturbed[0], "lod3", tmp_path / "lod3", relief="elements")
