"""A part of a city read of its own file is what was read of the city, bit for bit; a damaged file is refused in a line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from catalogs.block.digest import block_digest
from catalogs.block.extract import EXTRACT_FORMAT, PartContents, read_city_part_file, write_city_part_file
from catalogs.block.part import CityIndex, CityPartIds
from catalogs.block.reader import city_part_file_values, read_block
from catalogs.features import Fault
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.errors import InputError
from facade_core.core.types import BuildingShell, GroundArea, GroundWay, Pose, Roof
from tests.pipeline.stages import write_block


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> CityIndex:
    """A small city, with one of everything that a city may have."""
    folder = tmp_path_factory.mktemp("city")
    block = read_block(write_block(folder))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1 / 3]], float)
    shell = BuildingShell(corners, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.uint8), np.array([2], np.int32),
                  np.zeros((1, 3, 2), np.float32))  # fmt: skip
    first, second, *others = block.buildings
    place = first.footprint.centroid
    pictures = tuple(block.exemplars[:1] * 3)
    ground = replace(
        block.ground,
        ways=(GroundWay("w1", block.streets[0].line, "road", 7.5, "asphalt", pavement=(2.5, 0.0)),),
        areas=(GroundArea("a", shapely.multipolygons([place.buffer(9)]), "grass"),),
        outline=shapely.box(0, 0, 1, 1),
    )
    return CityIndex(
        replace(
            block,
            buildings=(replace(first, shell=shell), replace(second, roof=Roof("gabled", 3.1), levels=3), *others),
            textures=pictures,
            ground=ground,
            shops=((place.x, place.y),),
            entrances=tuple(one.footprint.exterior.coords[0][:2] for one in block.buildings),
            photos={f"{first.id}-0": block.exemplars[0], f"{others[0].id}-0": block.exemplars[1]},
            panoramas=(PosedPanorama("p", block.exemplars[0], Pose(place.x, place.y, None, 12.5)),),
            faults=(Fault("x.png", "exemplar", "is torn; mend it"), Fault("h", "building", "is none; remove it")),
        )
    )


def chosen(whole: CityIndex) -> CityPartIds:
    first, second, *_ = (one.id for one in whole.segments)
    return CityPartIds(
        "part",
        buildings=("a", "b"),
        streets=(first,),
        halo_buildings=("e",),
        halo_streets=(second,),
        distant_buildings=("c",),
    )


def test_what_is_kept_is_what_was_read(whole: CityIndex, tmp_path: Path) -> None:
    part = whole.extract_part(chosen(whole))
    write_city_part_file(tmp_path / "p.npz", city_part_file_values(part, whole.block))
    values = read_city_part_file(tmp_path / "p.npz")
    assert set(values) == {"crs", "extent", *PartContents.__annotations__}
    again = replace(part, **{name: values[name] for name in PartContents.__annotations__})
    assert block_digest(again) == block_digest(part)
    assert values["panoramas"] == part.panoramas
    assert values["photos"] == part.photos
    assert values["faults"] == part.faults == (Fault("x.png", "exemplar", "is torn; mend it"),)
    moved = replace(again, buildings=(replace(again.buildings[0], height=7.0000001), *again.buildings[1:]))
    assert block_digest(moved) != block_digest(part)
    written = (tmp_path / "p.npz").stat().st_mtime_ns
    write_city_part_file(tmp_path / "p.npz", city_part_file_values(part, whole.block))
    assert (tmp_path / "p.npz").stat().st_mtime_ns == written, "the same is not written again"


def test_a_part_has_what_is_its_own_and_what_is_around(whole: CityIndex) -> None:
    part = whole.extract_part(chosen(whole))
    assert part.part is not None
    assert [one.id for one in part.buildings] == ["a", "b", "e"]
    assert [one.id for one in part.streets] == [one.id for one in whole.segments[:2]]
    assert (part.part.buildings, part.part.streets) == (("a", "b"), (whole.segments[0].id,))
    assert [one.id for one in part.part.distant_buildings] == ["c"]
    assert part.part.shop_flags == (1, 0, 0)
    assert part.entrances == whole.block.entrances[:2], "of its own buildings alone"
    assert len(part.part.front_streets) == 3
    assert list(part.photos) == ["a-0"]
    assert len(part.panoramas) == 1
    assert len(part.textures) == 1
    assert part.buildings[0].shell is not None
    assert part.buildings[0].shell.texture.tolist() == [0], "pictures of others are not counted"


@pytest.mark.parametrize("cut", [0, 30, -40])
def test_a_damaged_file_is_refused_in_a_line(whole: CityIndex, tmp_path: Path, cut: int) -> None:
    path = tmp_path / "p.npz"
    write_city_part_file(path, city_part_file_values(whole.extract_part(chosen(whole)), whole.block))
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(InputError, match="streetloom city` writes it") as raised:
        read_city_part_file(path)
    assert "\n" not in str(raised.value)


def test_nothing_is_made_of_what_a_file_names_but_the_classes_of_a_part(tmp_path: Path) -> None:
    import json

    path = tmp_path / "p.npz"
    for said in ({"Popen": ["ls"]}, {"array": ["|O", [1], 0]}, {"shape": [0, 900]}):
        text = json.dumps({"format": EXTRACT_FORMAT, "values": {"map": [["a", said]]}}).encode()
        np.savez_compressed(path, text=np.frombuffer(text, np.uint8), blob=np.zeros(8, np.uint8))
        with pytest.raises(InputError):
            read_city_part_file(path)
