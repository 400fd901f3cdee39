"""Keys change where what they stand on does, and nowhere else: whichever inputs are others, exactly their parts are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
import trimesh
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

from catalogs.block.keys import SunSettings
from catalogs.block.reader import TextureSettings
from catalogs.block.settings import replace_settings
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture
from facade_core.core.types import Building, BuildingShell, Element, IngestSettings, Pose, Street
from facade_core.export.tiles.block_tiles import BlockTile
from facade_core.imagery.poses.joint_refinement import PriorPose
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan
from tasks.engine.inputs import digest_inputs, join_key
from tasks.engine.run import Run
from tasks.stages.bundles.stage import bundle_inputs
from tasks.stages.bundles.worker import BundlePanorama
from tasks.stages.exemplars.stage import exemplar_inputs
from tasks.stages.facades.imagery import ChosenExemplar, FacadeImagery
from tasks.stages.facades.stage import facade_inputs
from tasks.stages.poses.stage import list_pose_units
from tasks.stages.shared.scene_view import store_charts
from tasks.stages.surfaces.stage import surface_inputs
from tasks.stages.textures.stage import texture_inputs
from tasks.stages.tiles.stage import tile_inputs
from tests.keys import differing_inputs
from tests.settings import block_settings

RUN = Run(
    out="/out",
    block="block",
    key="k",
    crs="EPSG:3067",
    settings=block_settings(
        seed=1, texture=TextureSettings(texels_per_metre=4.0, panorama_width=128, walls="translate")
    ),
)
TEXTURE = {field.name for field in fields(TextureSettings)}
POSE = Pose(5.0, -3.0, 2.5, 30.0, 1.0, 2.0)
TOLD = np.diag([0.1, 0.1, 0.2, 0.5])
BRICK = ChosenExemplar(0, "brick", "e0")
# Settings that no key of a facade, a pose or an exemplar knows of.
ELSEWHERE = {"out": "/other", "block": "other", "key": "l", "crs": "EPSG:32635", "ingested": 2.0, "failed_limit": 0.5}


def changed(run: Run, values: dict[str, Any]) -> Run:
    """A run with other values of its own or of its settings of texture."""
    own = {field.name for field in fields(Run)}
    of_run = {name: value for name, value in values.items() if name in own}
    stated = {name: value for name, value in values.items() if name not in own}
    if privacy := stated.pop("privacy", None):
        stated["imagery"] = run.settings.imagery.model_copy(update={"privacy": privacy})
    return replace(run, settings=replace_settings(run.settings, **stated), **of_run)


def house(name: str, x: float, y: float, height: float = 8.0) -> Building:
    return Building(name, shapely.box(x, y, x + 10, y + 4), height, "height")


def carrying(name: str, x: float, y: float) -> Building:
    """A house whose walls carry the first of the block's pictures."""
    box = trimesh.creation.box((10, 4, 8))
    box.apply_translation((x + 5, y + 2, 4))
    count = len(box.faces)
    wall = np.abs(box.face_normals[:, 2]) < 0.5
    uv = np.broadcast_to(np.float32([[0, 0], [1, 0], [1, 1]]), (count, 3, 2)) * wall[:, None, None]
    shell = BuildingShell(
        box.vertices.astype(np.float64),
        box.faces.astype(np.int32),
        np.where(wall, 0, 1).astype(np.uint8),
        np.where(wall, 0, -1).astype(np.int32),
        uv.astype(np.float32),
    )
    return Building(name, shapely.box(x, y, x + 10, y + 4), 8.0, "model", shell=shell)


@cache
def planned(*kinds: str) -> Plan:
    """House a on a street, or one higher or carrying pictures of its own; another near it, or far behind, and other streets."""
    first = (
        house("a", 0, 5, 11.0)
        if "higher" in kinds
        else carrying("a", 0, 5)
        if "carrying" in kinds
        else house("a", 0, 5)
    )
    others = {"near": house("k", 4, 0.5), "far": house("z", 0, 400)}
    lines = {"1": [(-10, -4), (30, -4)]} | (
        {"2": [(-20, -14), (-20, 30)], "3": [(40, -14), (40, 30)]} if "streets" in kinds else {}
    )
    return build_plan(
        BlockInputs(
            [first, *(building for kind, building in others.items() if kind in kinds)],
            [Street(name, None, shapely.LineString(line)) for name, line in lines.items()],
            floor_height=3.2,
        ),
        IngestSettings(
            texels_per_metre=4.0,
            viewpoint_spacing=6.0,
            viewpoint_height=2.5,
            visibility_range=60.0,
            panorama_width=128,
            walls="translate",
        ),
    )


@dataclass
class Inputs:
    """What the keys of a house, its pictures and an exemplar are made of."""

    folder: Path
    run: Run = RUN
    kinds: frozenset[str] = frozenset()
    pose: Pose = POSE
    given: Pose = POSE
    rectified: bool = True
    exemplar: ChosenExemplar = BRICK
    entrances: tuple[float, ...] = ()
    files: dict[str, bytes] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """A picture, of this content alone: the digest of a file is kept while it is as old and as large."""
        content = self.files.get(name, b"as it was")
        folder = self.folder / content.hex()
        folder.mkdir(exist_ok=True)
        path = folder / name
        path.write_bytes(content)
        return path

    def imagery(self) -> FacadeImagery:
        panoramas = ((self.path("panorama.jpg"), self.pose),)
        return FacadeImagery(
            photo=self.path("photo.jpg"),
            rectified=self.rectified,
            panoramas=panoramas,
            exemplar=self.exemplar,
            entrances=self.entrances,
        )

    def plan(self) -> Plan:
        return planned(*sorted(self.kinds))


def of_run(**values: Any) -> Callable[[Inputs], None]:
    def change(inputs: Inputs) -> None:
        inputs.run = changed(inputs.run, values)

    return change


def of_inputs(**values: Any) -> Callable[[Inputs], None]:
    def change(inputs: Inputs) -> None:
        for name, value in values.items():
            setattr(inputs, name, value)

    return change


def of_file(name: str) -> Callable[[Inputs], None]:
    return lambda inputs: inputs.files.update({name: b"another"})


def of_kinds(kind: str) -> Callable[[Inputs], None]:
    def change(inputs: Inputs) -> None:
        inputs.kinds |= {kind}

    return change


def build_facade_inputs(inputs: Inputs) -> object:
    plan = inputs.plan()
    facade = plan.facades.id.index("a-0")
    return facade_inputs(inputs.run, plan, facade, inputs.imagery(), ())


def build_pose_inputs(inputs: Inputs) -> object:
    plan = replace(inputs.plan(), poses=(inputs.pose,))
    panorama = SimpleNamespace(path=inputs.path("panorama.jpg"), pose=inputs.pose)
    block: Any = SimpleNamespace(panoramas=[panorama], buildings=[])
    return list_pose_units(inputs.run, block, plan, zarr.create_group({}))[0].inputs


def build_bundle_inputs(inputs: Inputs) -> object:
    prior = PriorPose(inputs.pose, TOLD if inputs.rectified else None)
    member = BundlePanorama(inputs.path("panorama.jpg"), inputs.given, prior)
    return bundle_inputs(inputs.run, inputs.plan(), (member, member), (0,))


def build_exemplar_inputs(inputs: Inputs) -> object:
    return exemplar_inputs(inputs.run, inputs.path("exemplar.png"))


def build_texture_inputs(inputs: Inputs) -> object:
    inputs.kinds |= {"carrying"}
    return texture_inputs(inputs.run, inputs.plan(), 0, [inputs.path("own.png")])


AERIAL: Any = Orthophoto(Path("above.tif"), "EPSG:3067", "EPSG:3067", "x")
SEEDS = {"seed", "wall_seed", "building_seed"}
VIEWS = {"view", "between", "house_view"}
Changes = Mapping[str, tuple[Callable[[Inputs], None], set[str]]]
NOWHERE: Changes = {name: (of_run(**{name: value}), set()) for name, value in ELSEWHERE.items()}
# Of the inputs of each kind of unit: what is another, how, and the inputs that differ.
CHANGES: Mapping[str, tuple[Callable[[Inputs], object], Changes]] = {
    "facade": (
        build_facade_inputs,
        {
            "seed": (of_run(seed=2), SEEDS),
            "resolution": (of_run(texels_per_metre=5.0), VIEWS),
            "walls": (of_run(walls="exemplar"), {"walls"}),
            "photo": (of_file("photo.jpg"), {"photo"}),
            "rectified": (of_inputs(rectified=False), {"rectified"}),
            "privacy": (of_run(privacy="keep"), {"privacy"}),
            "panorama": (of_file("panorama.jpg"), {"panoramas"}),
            "pose": (of_inputs(pose=replace(POSE, roll=3.0)), {"panoramas"}),
            "what is between": (of_kinds("near"), {"between", "house_view"}),
            "what is behind": (of_kinds("far"), set()),
            "the house": (of_kinds("higher"), VIEWS),
            "which exemplar": (of_inputs(exemplar=ChosenExemplar(0, "plaster", "e0")), {"exemplar"}),
            "the exemplar": (of_inputs(exemplar=ChosenExemplar(0, "brick", "f0")), {"exemplar"}),
            "its place in the block": (of_inputs(exemplar=ChosenExemplar(3, "brick", "e0")), set()),
            "entrances": (of_inputs(entrances=(4.5,)), {"entrances"}),
            "storey": (of_run(storey=4.0), set()),
        }
        | NOWHERE,
    ),
    "pose": (
        build_pose_inputs,
        {
            "resolution": (of_run(texels_per_metre=5.0), {"around"}),
            "seed": (of_run(seed=2), set()),
            "panorama": (of_file("panorama.jpg"), {"picture"}),
            "pose": (of_inputs(pose=replace(POSE, heading=31.0)), {"given"}),
            "near": (of_kinds("near"), {"around"}),
            "far": (of_kinds("far"), set()),
        }
        | NOWHERE,
    ),
    "bundle": (
        build_bundle_inputs,
        {
            "resolution": (of_run(texels_per_metre=5.0), {"around", "surfaces"}),
            "seed": (of_run(seed=2), set()),
            "panorama": (of_file("panorama.jpg"), {"members"}),
            "the pose refined alone": (of_inputs(pose=replace(POSE, heading=31.0)), {"members"}),
            "the stated pose": (of_inputs(given=replace(POSE, x=1.0)), {"members"}),
            "what told it": (of_inputs(rectified=False), {"members"}),
            "near": (of_kinds("near"), {"around"}),
            "far": (of_kinds("far"), set()),
        }
        | NOWHERE,
    ),
    "exemplar": (
        build_exemplar_inputs,
        {
            "seed": (of_run(seed=2), {"seed"}),
            "storey": (of_run(storey=4.0), {"storey"}),
            "resolution": (of_run(texels_per_metre=5.0), {"texels_per_metre"}),
            "walls": (of_run(walls="exemplar"), set()),
            "privacy": (of_run(privacy="keep"), {"privacy"}),
            "picture": (of_file("exemplar.png"), {"picture"}),
        }
        | NOWHERE,
    ),
    "texture": (
        build_texture_inputs,
        {
            "resolution": (of_run(texels_per_metre=5.0), {"own", "above"}),
            "seed": (of_run(seed=2), set()),
            "picture": (of_file("own.png"), {"own"}),
            "far": (of_kinds("far"), set()),
            "from above": (of_run(aerial=AERIAL), {"aerial", "above"}),
        }
        | NOWHERE,
    ),
}


@pytest.mark.parametrize("kind", CHANGES)
@settings(max_examples=20)
@given(data=st.data())
def test_exactly_what_changed_differs(tmp_path_factory: pytest.TempPathFactory, kind: str, data: st.DataObject) -> None:
    build_inputs, changes = CHANGES[kind]
    chosen = data.draw(st.lists(st.sampled_from(sorted(changes)), unique=True, max_size=4))
    folder = tmp_path_factory.mktemp("pictures")
    before = digest_inputs(build_inputs(Inputs(folder)))
    assert digest_inputs(build_inputs(Inputs(folder))) == before
    inputs = Inputs(folder)
    for name in chosen:
        changes[name][0](inputs)
    now = digest_inputs(build_inputs(inputs))
    expected = {part for name in chosen for part in changes[name][1]}
    if "above" in expected and "from above" not in chosen:
        expected.remove("above")
    assert set(differing_inputs(join_key(before), join_key(now))) == expected


def test_pictures_of_materials_are_in_the_keys_of_surfaces(tmp_path: Path) -> None:
    plan = planned("near", "streets")
    charts = np.flatnonzero(plan.scene.charts.building == plan.scene.names.index("a")).tolist()

    def keys(*pictures: MaterialPicture, roof: RoofPicture | None = None) -> str:
        run = replace(RUN, materials=pictures, roof_material=roof)
        return join_key(digest_inputs(surface_inputs(run, plan, charts, [], {}, {}, store_charts(run, plan, (), {}))))

    path = tmp_path / "slabs.png"
    path.write_bytes(b"one")
    plain, once, wider = keys(), keys(MaterialPicture("slabs", path, 1.0)), keys(MaterialPicture("slabs", path, 2.0))
    for before, now in ((plain, once), (once, wider)):
        assert differing_inputs(before, now) == ["materials"]
    other = path.rename(tmp_path / "renamed.png")
    assert keys(MaterialPicture("slabs", other, 1.0)) == once
    laid = keys(roof=RoofPicture(other, 0.02))
    assert laid != plain
    assert keys(roof=RoofPicture(other.rename(path), 0.02)) == laid


def test_a_sun_is_in_the_keys_of_surfaces_alone_and_reaches_as_far_as_shadows() -> None:
    def key(run: Run, *kinds: str) -> str:
        plan = planned(*kinds)
        charts = np.flatnonzero(plan.scene.charts.building == plan.scene.names.index("a")).tolist()
        return join_key(digest_inputs(surface_inputs(run, plan, charts, [], {}, {}, store_charts(run, plan, (), {}))))

    sunny = changed(RUN, {"sun": SunSettings(200.0, 30.0)})
    assert {"sun"} <= set(differing_inputs(key(RUN), key(sunny))) <= {"sun", "around"}
    assert key(sunny) != key(changed(RUN, {"sun": SunSettings(200.0, 31.0)}))
    assert key(RUN) == key(RUN, "far")
    assert key(sunny) == key(sunny, "far")


def test_elements_in_depth_are_in_the_keys_of_tiles_with_the_houses_before_them() -> None:
    def key(elements: list[Element], *kinds: str) -> str:
        plan = planned(*kinds)
        charts = np.flatnonzero(plan.scene.charts.building == plan.scene.names.index("a"))
        tile = BlockTile("0_0", np.array([plan.scene.names.index("a")]), charts, (0.0, 0.0, 0.0))
        return join_key(digest_inputs(tile_inputs(RUN, plan, 0, tile, {}, dict.fromkeys(charts.tolist(), elements))))

    window = [Element("window", 1.0, 2.0, 2.0, 4.0)]
    assert differing_inputs(key([]), key(window)) == ["elements"]
    assert key([]) == key([], "near")
    assert differing_inputs(key(window), key(window, "near")) == ["objects"]
    assert key(window) == key(window, "far")
