"""Factored models of a whole published run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from facade_core.core.errors import InputError
from facade_core.export.models.glb import read_glb_header
from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock

pytestmark = pytest.mark.long

Run = tuple[Path, dict[str, Any]]


def test_a_factored_model_has_few_pictures_and_answers(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    whole = export_run(undisturbed[0], "glb", tmp_path / "whole").path
    made = export_run(undisturbed[0], "glb", tmp_path / "factored", textures="factored").path
    assert [path.name for path in sorted(Path(str(made)).iterdir())] == ["block.glb", "export.json", "figures.json"]
    with (made / "block.glb").open("rb") as file:
        document, _ = read_glb_header(file)
    assert {node["name"] for node in document["nodes"]} == {
        *(found.names[b] for b in found.select_buildings(()).tolist()),
        "ground",
    }
    primitives = [primitive for mesh in document["meshes"] for primitive in mesh["primitives"]]
    assert all("COLOR_0" in one["attributes"] and one["extensions"]["EXT_mesh_features"] for one in primitives)
    told = json.loads((made / "figures.json").read_text())
    assert told["types"] < told["elements"]
    assert told["draw_calls"] == len(primitives)
    parts = trimesh.load(whole / "block.glb").geometry.values()
    textured = [part.bounds for part in parts if part.visual.material.name != "surroundings"]
    other = np.array([np.min(textured, axis=0)[0], np.max(textured, axis=0)[1]])
    assert np.abs(trimesh.load(made / "block.glb").bounds - other).max() < 0.1
    with pytest.raises(
        InputError,
        match="--textures: is of 3dtiles and factored glb and factored 3dtiles; leave it out with factored usd",
    ):
        export_run(undisturbed[0], "usd", textures="factored")
    with pytest.raises(InputError, match="--lit: is of glb and 3dtiles and usd; leave it out with factored glb"):
        export_run(undisturbed[0], "glb", textures="factored", lit=True)


def test_factored_tiles_share_pictures_and_have_a_flat_level_of_fewer_types(undisturbed: Run, tmp_path: Path) -> None:
    made = Path(str(export_run(undisturbed[0], "3dtiles", tmp_path / "tiles", textures="factored").path))
    tiles: dict[str, tuple[float, str | None]] = {}

    def walk(tile: dict[str, Any], folder: Path) -> None:
        uri = (folder / tile["content"]["uri"]).resolve()
        if uri.suffix == ".json":
            walk(json.loads(uri.read_text())["root"], uri.parent)
            return
        below = [one for one in tile.get("children", []) if not one["content"]["uri"].endswith(".json")]
        assert all(one["geometricError"] < tile["geometricError"] for one in below)
        names = [Path(one["content"]["uri"]).name for one in below]
        tiles[uri.name] = (tile["geometricError"], names[0] if len(names) == 1 else None)
        for child in tile.get("children", []):
            walk(child, folder)

    block, objects = json.loads((made / "tileset.json").read_text())["root"]["children"]
    walk(block, made)
    assert {*tiles, Path(objects["content"]["uri"]).name} == {path.name for path in (made / "tiles").glob("*.glb")}
    far = [name for name in tiles if name.startswith("far")]
    assert far
    named: list[set[str]] = []
    for name in far:
        near = name.replace("far", "near", 1)
        assert tiles[name][1] == near
        assert tiles[near][0] == 0
        documents = []
        for one in (name, near):
            with (made / "tiles" / one).open("rb") as file:
                documents.append(read_glb_header(file)[0])
        triangles = [
            sum(document["accessors"][part["indices"]]["count"] for part in document["meshes"][0]["primitives"])
            for document in documents
        ]
        assert triangles[0] < triangles[1]
        uris = [{image["uri"] for image in document["images"]} for document in documents]
        assert uris[0] <= uris[1], "what is seen from afar needs no picture of its own"
        assert all((made / "tiles" / uri).is_file() for uri in uris[1])
        named.append(uris[1])
        ids = documents[1]["meshes"][0]["primitives"][0]["extensions"]["EXT_mesh_features"]["featureIds"]
        assert [one["label"] for one in ids] == ["part", "building"]
    assert {uri for uris in named for uri in uris} == {
        f"../pictures/{path.name}" for path in (made / "pictures").iterdir()
    }
    told = json.loads((made / "figures.json").read_text())
    assert told["types_from_far"] < told["types"]
    again = Path(str(export_run(undisturbed[0], "3dtiles", tmp_path / "again", textures="factored").path))
    for path in (made / "tiles").iterdir():
        assert path.read_bytes() == (again / "tiles" / path.name).read_bytes()
    with pytest.raises(InputError, match="--max-texture-mb: is of 3dtiles; leave it out with factored 3dtiles"):
        export_run(undisturbed[0], "3dtiles", textures="factored", max_texture_mb=100)
