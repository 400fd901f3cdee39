"""One description of values for digests and part files; lines of corrections and of fetched pictures are pinned."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from pyproj import CRS

from catalogs.block.corrections import LINE_KEYS, Correction, Corrections, append_corrections_to_file
from catalogs.block.digest import block_digest, plan_input_digest
from catalogs.block.extract import read_city_part_file, write_city_part_file
from catalogs.block.keys import ImagerySection, PhotosSection, SunSettings, TextureSettings
from catalogs.block.part import CityPart
from catalogs.block.reader import Block, city_part_file_values
from catalogs.block.value_encoding import VALUE_TYPES, DigestEncoder
from catalogs.features import Fault
from catalogs.imagery.fetch_log import read_fetch_log
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.types import (
    Building,
    BuildingFinish,
    BuildingShell,
    ElevationRaster,
    GroundArea,
    GroundWay,
    MappedGround,
    Pose,
    Roof,
    Street,
    TrainedModelFiles,
)
from tests.settings import block_settings


def small_block(folder: Path) -> Block:
    """Build a block in memory that holds every kind of value that is hashed or written."""
    names = ("wall.png", "photo.png", "panorama.png", "texture.png", "tiles.png", "parser.onnx", "parser.json")
    for number, name in enumerate(names):
        (folder / name).write_bytes(bytes([number, 7]))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.5]], np.float64)
    triangles, uv = np.array([[0, 1, 2]], np.int32), np.zeros((1, 3, 2), np.float32)
    shell = BuildingShell(corners, triangles, np.zeros(1, np.uint8), np.array([0], np.int32), uv)
    roof, finish = Roof("gabled", 3.5, 90.0, True, 30.0, 0.5), BuildingFinish((1, 2, 3), None, "brick", "slate")
    house = Building("a", shapely.box(0, 0, 10, 8), 7.25, "height", 2, "A", 1.5, roof, None, finish, 0.5, "whole")
    model = Building("b", shapely.box(20, 0, 30, 8), 9.0, "model", shell=shell)
    line = shapely.LineString([(0, -5), (30, -5)])
    way = GroundWay("w", line, "road", 6.5, "asphalt", False, 2, True, (2.5, 0.0), (0.0, 2.1), 3)
    outline = shapely.box(-50, -50, 80, 80)
    return Block(
        settings=block_settings(
            storey=3.0,
            failed_limit=0.1,
            seed=4,
            imagery=ImagerySection(photos=PhotosSection(path="photos", rectified=False)),
            texture=TextureSettings(walls="translate", sun=SunSettings(azimuth=135, elevation=40.5)),
        ),
        crs=CRS.from_user_input("EPSG:32635"),
        buildings=(house, model),
        streets=(Street("s1", "High Street", line),),
        shops=((5.0, 0.0),),
        entrances=((2.0, 0.0),),
        ground=MappedGround((way,), (GroundArea("g", shapely.multipolygons([outline]), "grass"),), outline),
        terrain=ElevationRaster(-1.0, 9.0, 2.0, np.array([[1, 2], [3, np.nan]], np.float32)),
        exemplars=(folder / "wall.png",),
        photos={"a-0": folder / "photo.png"},
        panoramas=(PosedPanorama("p", folder / "panorama.png", Pose(5, -5, None, 12.5), "2024-05-17"),),
        textures=(folder / "texture.png",),
        aerial=Orthophoto(folder / "above.png", "EPSG:32635", "EPSG:32635", "c0ffee"),
        roof_material=RoofPicture(folder / "tiles.png", 0.01),
        materials=(MaterialPicture("slabs", folder / "tiles.png", 0.8),),
        geoid_separation=17.25,
        notes=("a note",),
        faults=(Fault("x", "building", "has no outline; draw it again", shapely.Point(1, 2)),),
        digest="",
        corrections=Corrections({"a-0": {"facade": Correction("a-0", "facade", False, (24.9, 60.2), 8.0, "anna")}}),
        part=CityPart(("a",), ("s1",), (model,), ("High Street", "High Street"), (1, -1)),
        models=TrainedModelFiles(parser=folder / "parser.onnx"),
    )


def test_a_part_file_holds_every_value_exactly(tmp_path: Path) -> None:
    block = small_block(tmp_path)
    write_city_part_file(tmp_path / "part.npz", city_part_file_values(block, block))
    values = read_city_part_file(tmp_path / "part.npz")
    again = replace(block, **{name: value for name, value in values.items() if name not in ("crs", "extent")})
    assert block_digest(again) == block_digest(block)
    assert plan_input_digest(again) == plan_input_digest(block)


def test_every_change_of_a_value_changes_its_bytes() -> None:
    """Numbers are equal as numbers; types, lengths and nesting count."""

    def digested(value: object) -> bytes:
        return DigestEncoder().encode_bytes(value)

    assert digested([7, -0.0, np.float64(0.5)]) == digested((7.0, 0, 0.5))
    values = [
        None,
        False,
        0,
        "",
        "0",
        "None",
        [],
        [[]],
        [0],
        ["0"],
        {},
        {"a": 0},
        [["a", 0]],
        2**53 + 1,
        2.0**53,
        np.nan,
    ]
    values += [np.zeros(2), np.zeros(2, np.int64), np.zeros((2, 1)), shapely.Point(1, 2), shapely.Point(2, 1)]
    assert len({digested(value) for value in values}) == len(values)
    with pytest.raises(TypeError, match="no digest of the path a"):
        digested([Path("a")])
    with pytest.raises(TypeError, match="no serial form of object"):
        digested({"a": object()})


def test_the_keys_of_a_correction_line_are_pinned(tmp_path: Path) -> None:
    place = (24.9, 60.2)
    one = Correction("a-0", "hide", ((0.1, 0.2, 0.3, 0.4),), place, 8.5, "anna", "2026-11-25T10:00:00Z", "a van")
    append_corrections_to_file(tmp_path / "block.yaml", [one])
    [line] = (tmp_path / "block.corrections.jsonl").read_text().splitlines()
    assert line == (
        '{"id": "a-0", "what": "hide", "value": [[0.1, 0.2, 0.3, 0.4]], "place": [24.9, 60.2], "width": 8.5, '
        '"who": "anna", "when": "2026-11-25T10:00:00Z", "why": "a van"}'
    )


ACCOUNT_LINE = (
    '{"source": "s", "id": "1", "file": "1.jpg", "sha256": "ab", "bytes": 7, "lon": 24.9, "lat": 60.2, "heading": 10.0, '
    '"z": 2.5, "pitch": 1.0, "roll": -1.0, "captured": "2024-05-17", "author": "anna", "licence": "CC0-1.0", '
    '"licence_url": "https://example.org"}'
)


def test_the_keys_of_a_line_of_fetched_pictures_are_pinned(tmp_path: Path) -> None:
    (tmp_path / "fetched.jsonl").write_text(f"{ACCOUNT_LINE}\n")
    account = read_fetch_log(tmp_path)
    [picture] = account.pictures.values()
    account.append(picture)
    assert (tmp_path / "fetched.jsonl").read_text() == f"{ACCOUNT_LINE}\n" * 2
    account.append(replace(picture, file="", refused="is a drawing"))
    line = json.loads((tmp_path / "fetched.jsonl").read_text().splitlines()[-1])
    assert line == json.loads(ACCOUNT_LINE) | {"file": "", "refused": "is a drawing"}
    (tmp_path / "1.jpg").touch()
    account.append(picture)
    poses = json.loads(account.write_poses().read_text())["poses"]["1.jpg"]
    assert list(poses) == [
        "lon", "lat", "z", "heading", "pitch", "roll", "captured", "author", "licence", "licence_url", "source", "id",
        "sha256",
    ]  # fmt: skip


def test_every_key_of_a_line_is_a_field() -> None:
    assert set(LINE_KEYS.values()) == {field.name for field in fields(Correction)}


def test_every_class_that_a_block_reaches_is_encoded() -> None:
    """Settings are hashed by key, materials by the bytes of their pictures; corrections and models by their own functions."""
    handled = {Block, Correction, Corrections, MaterialPicture, TrainedModelFiles}
    waiting, reached = [Block], set()
    while waiting:
        cls = waiting.pop()
        if cls in reached or not is_dataclass(cls):
            continue
        reached.add(cls)
        names = {name for field in fields(cls) for name in re.findall(r"\w+", str(field.type))}
        waiting += [other for other in (*VALUE_TYPES.values(), *handled) if other.__name__ in names]
        in_module = (getattr(sys.modules[cls.__module__], name, None) for name in names)
        waiting += [
            one for one in in_module if is_dataclass(one) and one.__module__.startswith(("catalogs", "facade_core"))
        ]
    assert reached - handled == set(VALUE_TYPES.values())
