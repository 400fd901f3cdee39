"""Keys of units tell what changed."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace as Value
from typing import Any

import numpy as np
import pytest
import shapely

from catalogs.block.reader import TextureSettings
from catalogs.file_digest import file_digest
from facade_core.core.labels import FacadeClass
from facade_core.core.types import SHIPPED_MODELS, Building, IngestSettings, Pose, Street
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan
from tasks.engine.inputs import (
    CODE,
    CODE_CHANGED,
    digest_inputs,
    digest_values,
    explain_difference,
    input_field,
    is_valid_key,
    join_key,
    note_reads,
    split_key,
)
from tasks.engine.stage import match_units_by_name
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.facades.stage import facade_inputs
from tests.keys import differing_inputs


@dataclass(frozen=True)
class Sample:
    photo: Path | None = input_field("photo changed", new="new photo")
    size: tuple[int, ...] = input_field("size changed")
    place: int = 0


def test_a_key_names_the_inputs_that_were_read(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"a")
    inputs = Sample(path, (1, 2), 3)
    digests = {CODE: "c"} | digest_inputs(inputs)
    assert digests.keys() == {CODE, "photo", "size"}, "a place in the block is no input"
    noted, read = note_reads(inputs)
    assert noted.size == (1, 2)
    key = join_key(digests, read)
    assert split_key(key) == {CODE: "c", "size": digests["size"]}

    def validity(other: Sample, code: str = "c") -> tuple[bool, str]:
        now = {CODE: code} | digest_inputs(other)
        return is_valid_key(key, now), explain_difference(join_key(digests), other, now)

    assert validity(replace(inputs, place=4))[0]
    assert validity(replace(inputs, photo=None)) == (True, "photo changed"), "it was not looked at"
    assert validity(replace(inputs, size=(1, 3))) == (False, "size changed")
    assert validity(inputs, "d") == (False, CODE_CHANGED)
    without = replace(inputs, photo=None)
    before = join_key({CODE: "c"} | digest_inputs(without))
    assert explain_difference(before, inputs, digests) == "new photo"


def test_what_has_no_digest_is_no_input() -> None:
    with pytest.raises(TypeError, match="object has no digest"):
        digest_inputs(Sample(None, (object(),)))  # type: ignore[arg-type]


def test_inputs_of_different_content_have_different_digests(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"a")
    other = tmp_path / "b" / "a.png"
    other.parent.mkdir()
    other.write_bytes(b"b")
    values = [
        None, True, 1, 2.5, "1", (), (1,), ((1,),), {"a": 1}, {"a": 2}, np.zeros(2), np.zeros(3), np.zeros(2, np.int32),
        path, other, Pose(1.0, 2.0, None, 3.0), Pose(1.0, 2.0, 0.0, 3.0), FacadeClass.WALL,
    ]  # fmt: skip
    digests = [digest_values(value=value)["value"] for value in values]
    assert len(set(digests)) == len(values)


def test_a_file_is_read_again_when_it_changed(tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    path.write_bytes(b"one")
    first = file_digest(path)
    assert file_digest(path) == first
    path.write_bytes(b"two")
    state = path.stat()
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns + 1))
    assert file_digest(path) != first
    path.write_bytes(b"one")
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns + 2))
    assert file_digest(path) == first


def test_units_are_found_again_by_their_names() -> None:
    def again(records: Any, *names: str) -> dict[int, int]:
        return match_units_by_name(records, names)

    records = [{"unit": "1"}, None, {"unit": "2"}]
    assert again(records, "2", "3", "1") == {0: 2, 2: 0}
    twice = [{"unit": "x"}, {"unit": "y"}, {"unit": "x"}]
    assert again(twice, "x", "x", "y", "x") == {0: 0, 1: 2, 2: 1}


def test_a_facade_of_a_panorama_stands_on_what_is_between(tmp_path: Path) -> None:
    picture = tmp_path / "panorama.jpg"
    picture.write_bytes(b"")
    run: Any = Value(
        seed=1,
        ingested=0.0,
        privacy="blur",
        models=SHIPPED_MODELS,
        texture=TextureSettings(texels_per_metre=4.0, walls="translate"),
    )

    def key(buildings: list[Building], pose: Pose, factor: tuple[float, ...] | None = None, raised: float = 1.0) -> str:
        plan = _plan(buildings)
        plan = replace(plan, street_density=plan.street_density / raised)
        facade = plan.facades.id.index("a-0")
        factors = {} if factor is None else {picture: factor}
        imagery = FacadeImagery(panoramas=((picture, pose),), exposure_factors=factors)
        inputs = facade_inputs(run, plan, facade, imagery, ())
        return join_key({name: digest for name, digest in digest_inputs(inputs).items() if name != "house_view"})

    def house(name: str, x: float, y: float) -> Building:
        return Building(name, shapely.box(x, y, x + 10, y + 4), 8.0, "height")

    pose = Pose(5.0, -3.0, 2.5, 0.0, 0.0, 0.0)
    wall, kiosk, behind = house("a", 0, 5), house("k", 4, 0.5), house("z", 0, 30)
    alone = key([wall], pose)
    assert differing_inputs(alone, key([wall, behind], pose)) == []
    assert differing_inputs(alone, key([wall, kiosk], pose)) == ["between"]
    assert differing_inputs(alone, key([wall], replace(pose, heading=1.0))) == ["panoramas"]
    assert differing_inputs(alone, key([wall], pose, (1.125, 1.0, 1.0))) == ["exposure_factors"]
    raised = key([wall], pose, raised=1.5)  # it is parsed at the density by the streets
    assert differing_inputs(alone, raised) == ["view"]
    assert differing_inputs(raised, key([wall], pose, raised=2.0)) == ["view"]


def _plan(buildings: list[Building]) -> Plan:
    street = Street("1", None, shapely.LineString([(-10, -4), (30, -4)]))
    return build_plan(
        BlockInputs(buildings, [street], floor_height=3.2),
        IngestSettings(
            texels_per_metre=4.0,
            viewpoint_spacing=6.0,
            viewpoint_height=2.5,
            visibility_range=25.0,
            panorama_width=128,
            walls="translate",
        ),
    )
