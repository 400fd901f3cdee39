"""Keys of units tell what changed."""

from __future__ import annotations

import os
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace as Value
from typing import Any

import numpy as np
import shapely

from catalogs.block.reader import TextureSettings
from catalogs.file_digest import file_digest
from facade_core.core.types import SHIPPED_MODELS, Building, Pose, Street
from facade_core.plan.ingest import BlockInputs, IngestSettings, build_plan
from facade_core.plan.plan import Plan
from tasks.engine.stage import match_units_by_key_or_name
from tasks.engine.unit import Unit
from tasks.engine.unit_key import diff_key_parts, join_key_parts, split_key
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.facades.keys import facade_keys
from tasks.stages.streets.keys import KEY_SETTINGS
from tasks.stages.streets.stage import STREETS


def test_keys_differ_in_the_parts_that_changed() -> None:
    one = join_key_parts("c", settings=[1, 2.0], photo="a", geometry={"b": 1})
    assert join_key_parts("c", settings=[1, 2.0], photo="a", geometry={"b": 1}) == one
    assert diff_key_parts(one, join_key_parts("c", settings=[1, 2.5], photo="b", geometry={"b": 1})) == [
        "photo",
        "settings",
    ]
    assert diff_key_parts(one, join_key_parts("c", settings=[1, 2.0], exemplar="a", geometry={"b": 1})) == [
        "exemplar",
        "photo",
    ]
    assert diff_key_parts(one, one) == []
    other = join_key_parts("d", settings=[1, 2.0], photo="a", geometry={"b": 1})
    assert diff_key_parts(one, other) == ["code"]
    assert [split_key(key).get("code") for key in (one, other, "0f")] == ["c", "d", None]


def test_every_setting_of_texture_is_of_streets_or_not() -> None:
    in_what_they_see = {
        "viewpoint_spacing",
        "viewpoint_height",
        "visibility_range",
        "walls",
        "roof_material",
        "materials",
    }
    of_surfaces = {"levelling", "sun"}
    assert {field.name for field in fields(TextureSettings)} == set(KEY_SETTINGS) | in_what_they_see | of_surfaces


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


def test_units_are_found_again_by_their_keys() -> None:
    def again(records: Any, *units: tuple[str, str]) -> dict[int, int]:
        return match_units_by_key_or_name(records, [Unit(i, name, (key,)) for i, (name, key) in enumerate(units)])

    records = [{"key": "a", "unit": "1"}, None, {"key": "c", "unit": "2"}]
    assert again(records, ("x", "c"), ("y", "b"), ("z", "a")) == {0: 2, 2: 0}
    records = [{"key": "a", "unit": "x"}, {"key": "b", "unit": "y"}, {"key": "c", "unit": "z"}]
    assert again(records, ("z", "a"), ("y", "new"), ("x", "d"), ("w", "e")) == {0: 0, 1: 1}


def test_streets_are_found_again_by_line_and_then_by_id() -> None:
    def plan(**lines: float) -> Any:
        streets = [Value(id=name, line=shapely.LineString([(0, y), (9, y)])) for name, y in lines.items()]
        return Value(streets=tuple(streets), wave=np.zeros(len(streets)))

    def again(before: Any, after: Any) -> dict[int, int]:
        change: Any = Value(before=before, after=after)
        return STREETS.match_previous(change)

    assert again(plan(g0=0, g1=1, g2=2), plan(g0=1, g1=2)) == {0: 1, 1: 2}  # named anew since one is gone
    assert again(plan(a=0, b=1), plan(a=0.5, b=1, c=2)) == {0: 0, 1: 1}  # a was moved


def test_a_facade_of_a_panorama_stands_on_what_is_between(tmp_path: Path) -> None:
    picture = tmp_path / "panorama.jpg"
    picture.write_bytes(b"")
    run: Any = Value(
        seed=1, privacy="blur", models=SHIPPED_MODELS, texture=TextureSettings(texels_per_metre=4.0, walls="translate")
    )

    def key(buildings: list[Building], pose: Pose, factor: tuple[float, ...] | None = None, raised: float = 1.0) -> str:
        plan = _plan(buildings)
        plan = replace(plan, street_density=plan.street_density / raised)
        facade = plan.facades.id.index("a-0")
        factors = {} if factor is None else {picture: factor}
        imagery = FacadeImagery(panoramas=((picture, pose),), exposure_factors=factors)
        return facade_keys(run, plan, facade, imagery, {}, ())[0]

    def house(name: str, x: float, y: float) -> Building:
        return Building(name, shapely.box(x, y, x + 10, y + 4), 8.0, "height")

    pose = Pose(5.0, -3.0, 2.5, 0.0, 0.0, 0.0)
    wall, kiosk, behind = house("a", 0, 5), house("k", 4, 0.5), house("z", 0, 30)
    alone = key([wall], pose)
    assert diff_key_parts(alone, key([wall, behind], pose)) == []
    assert diff_key_parts(alone, key([wall, kiosk], pose)) == ["between"]
    assert diff_key_parts(alone, key([wall], replace(pose, heading=1.0))) == ["panoramas"]
    assert diff_key_parts(alone, key([wall], pose, (1.125, 1.0, 1.0))) == ["panoramas"]
    raised = key([wall], pose, raised=1.5)  # it is parsed at the density by the streets
    assert diff_key_parts(alone, raised) == ["geometry"]
    assert diff_key_parts(raised, key([wall], pose, raised=2.0)) == ["geometry"]


def _plan(buildings: list[Building]) -> Plan:
    street = Street("1", None, shapely.LineString([(-10, -4), (30, -4)]))
    return build_plan(
        BlockInputs(buildings, [street]),
        IngestSettings(
            texels_per_metre=4.0,
            viewpoint_spacing=6.0,
            viewpoint_height=2.5,
            visibility_range=25.0,
            panorama_width=128,
            floor_height=3.2,
            walls="translate",
        ),
    )
