"""Exports in Blender: pictures are there and stay there, and it draws what Streetloom draws."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.clients.blender import (
    compared,
    in_blender,
    moved_by_cjio,
    obj_by_cjio,
    of_street,
    origin_of_models,
    own_picture,
    shot,
)
from facade_core.export.models.glb import extract_images
from tasks.publish.published_run import PublishedBlock
from tests.clients.conftest import Exported, first, present

Seen = Mapping[str, SimpleNamespace]


@pytest.fixture(scope="module")
def seen(exported: Exported, found: PublishedBlock, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """What Blender made of a model, and of CityJSON without and with openings as cjio writes it: `told` by Blender, `compared`
    with Streetloom's own picture, the pictures of the `given` export and of the GLB that Blender wrote of it `again`."""
    folder = tmp_path_factory.mktemp("blender")
    camera, origin = of_street(found), origin_of_models(found)
    own, built = own_picture(found, camera)
    steps, given = {}, {}
    with present():
        model = first(exported("glb", lit=False))
        steps["glb"] = {"open": str(model), "render": shot(camera, origin, folder / "glb.png")}
        given["glb"] = extract_images(model.read_bytes())
        for style in ("cityjson", "lod3"):
            shutil.copytree(exported(style), folder / style)
            city = first(folder / style)
            to = folder / f"{style}.png"
            steps[style] = {"open": str(obj_by_cjio(city)), "render": shot(camera, moved_by_cjio(city), to)}
            given[style] = [path.read_bytes() for path in sorted((city.parent / "textures").iterdir())]
        for style, step in steps.items():
            step["export"] = str(folder / f"{style}-again.glb")
        told = in_blender(list(steps.values()))
    return {
        style: SimpleNamespace(
            told=one,
            compared=compared(own, folder / f"{style}.png", built),
            given=given[style],
            again=extract_images((folder / f"{style}-again.glb").read_bytes()),
        )
        for style, one in zip(steps, told, strict=True)
    }


@pytest.mark.long
@pytest.mark.parametrize("style", ["glb", "cityjson", "lod3"])
def test_every_part_shows_a_picture(seen: Seen, style: str) -> None:
    told = seen[style].told
    assert told["triangles"] > 500
    assert len(told["pictures"]) == len(seen[style].given)
    around = 2 if style == "glb" else 0  # neighbours and street lamps have plain colours
    assert told["slots"] - around == told["slots_with_picture"] > 0


@pytest.mark.parametrize("style", ["glb", "cityjson", "lod3"])
def test_pictures_survive_the_way_through_blender(seen: Seen, style: str) -> None:
    assert sorted(seen[style].again) == sorted(seen[style].given), "to the byte"


# Openings stand back in LoD3 and glb, so their edges are elsewhere; cjio writes places in a picture with three digits.
@pytest.mark.parametrize(("style", "edges"), [("glb", 0.85), ("cityjson", 0.9), ("lod3", 0.7)])
def test_blender_draws_what_streetloom_draws(seen: Seen, style: str, edges: float) -> None:
    found = seen[style].compared
    assert found["shown"] > 0.99
    assert found["colour_difference"] < 5
    assert found["edges_shared"] > edges


@pytest.mark.long
def test_a_lit_model_opens_with_all_of_its_pictures(exported: Exported) -> None:
    model = first(exported("glb", lit=True))
    with present():
        (told,) = in_blender([{"open": str(model)}])
    assert told["slots"] - 2 == told["slots_with_picture"] > 0, "but for neighbours and street lamps"
    assert len(told["pictures"]) > 1, "colours, normals and what gives light"


def test_openusd_opens_with_all_of_its_pictures(exported: Exported) -> None:
    pytest.importorskip("pxr", reason="no pxr here; `make usd-setup` installs it")
    stage = first(exported("usd"))
    with present():
        (told,) = in_blender([{"open": str(stage)}])
    assert told["slots"] == told["slots_with_picture"] > 0
    maps = [path for path in (stage.parent / "textures").iterdir() if "glow" not in path.name]
    assert len(told["pictures"]) == len(maps) > 2, (
        "colours, normals, and occlusion with roughness and metal; no glow by day"
    )


def test_openings_are_there_as_geometry(seen: Seen) -> None:
    assert seen["lod3"].told["triangles"] > 3 * seen["cityjson"].told["triangles"]


def test_another_texture_is_told_from_the_own(tmp_path: Path) -> None:
    """The measure: of a picture and one that has nothing to do with it."""
    from PIL import Image

    rng = np.random.default_rng(3)
    own, other = (np.kron(rng.integers(0, 255, (20, 20, 3)), np.ones((8, 8, 1))).astype(np.uint8) for _ in range(2))
    everywhere = np.ones(own.shape[:2], bool)
    Image.fromarray(np.dstack([own, np.full(own.shape[:2], 255, np.uint8)])).save(tmp_path / "same.png")
    Image.fromarray(np.dstack([other, np.full(own.shape[:2], 255, np.uint8)])).save(tmp_path / "other.png")
    same, different = (compared(own, tmp_path / f"{name}.png", everywhere) for name in ("same", "other"))
    assert same == {"colour_difference": 0, "shown": 1, "edges_shared": 1}
    assert different["colour_difference"] > 50
    assert different["edges_shared"] < 0.7
