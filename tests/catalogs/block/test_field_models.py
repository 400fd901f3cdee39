"""Models and parts of ../shared/data/field_inputs, which were read wrongly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from catalogs.block.reader import Block, read_block

RED, GREEN = (203, 63, 53), (52, 152, 62)


def read(data: Path, name: str) -> Block:
    folder = data / "field_inputs" / name
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    return read_block(folder / "block.yaml")


@pytest.mark.parametrize(
    ("name", "colours"),
    [
        ("gltf-plain", {(0.0, 1.0)}),
        ("gltf-norm-uv", {(0.0, 0.5)}),
        ("gltf-texture-transform", {(0.5, 1.0)}),
        ("gltf-webp", {(0.0, 0.5)}),
    ],
)
def test_gltf_shows_its_part_of_the_atlas(data: Path, name: str, colours: set[tuple[float, float]]) -> None:
    block = read(data, name)
    (building,) = block.buildings
    assert building.shell is not None
    textured = building.shell.texture >= 0
    uv = building.shell.uv[textured].reshape(-1, 2)
    assert (round(float(uv[:, 0].min()), 2), round(float(uv[:, 0].max()), 2)) in colours
    if name != "gltf-plain":
        assert (round(float(uv[:, 1].min()), 2), round(float(uv[:, 1].max()), 2)) == (0.5, 1.0)
        picture = Image.open(block.textures[int(building.shell.texture[textured][0])]).convert("RGB")
        u, v = uv.mean(axis=0)
        shown = picture.getpixel((int(u * picture.width), int((1 - v) * picture.height)))
        right = GREEN if name == "gltf-texture-transform" else RED
        assert np.abs(np.subtract(shown, right)).max() < 60


def test_an_obj_with_y_up_stands(data: Path) -> None:
    block = read(data, "obj-y-up")
    assert [(one.height, one.base) for one in block.buildings] == [(9, 0), (12, 0)]
    assert [one.footprint.bounds[1::2] for one in block.buildings] == [(6_671_006, 6_671_015)] * 2
    assert any("y is up, turned" in note for note in block.notes)


def test_underground_buildings_of_overture_are_set_aside(data: Path) -> None:
    block = read(data, "overture-underground")
    assert [one.id for one in block.buildings] == ["08a", "08c"]
    assert "buildings under ground set aside: 1 (08b)" in block.notes


def test_multipatches_are_models(data: Path) -> None:
    block = read(data, "multipatch")
    assert [(one.id, one.height, one.base, one.height_source) for one in block.buildings] == [
        ("a", 9, 10, "model"),
        ("b", 12, 10, "model"),
    ]


def test_implicit_windows_of_citygml_are_counted(data: Path) -> None:
    block = read(data, "gml-implicit-windows")
    assert (block.buildings[0].height, block.buildings[0].base) == (9, 10)
    assert any("1 lod3ImplicitRepresentation of city.gml" in note for note in block.notes)


def test_materials_of_citygml_are_colours(data: Path) -> None:
    assert read(data, "gml-x3dmaterial").buildings[0].finish.wall_colour == (230, 26, 26)
