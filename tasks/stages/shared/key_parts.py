"""Keys of units: what each depends on, and nothing else of the block, so that a change makes due only what it reaches.

A key is text, one digest for each kind of input ("code:0f3a... photo:77b1..."): two keys of a unit tell why it is due.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.block.digest import model_digests
from catalogs.file_digest import file_digest
from catalogs.readers.pictures.folders import with_labels
from facade_core.atlas.journal import unit_key
from facade_core.core.types import AS_FOUND, Models, Pose
from facade_core.geometry.charts import CORNERS
from facade_core.geometry.walls import JOINT_M
from facade_core.plan.doors import has_back_door, turns_corner
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code
from tasks.stages.facades.imagery import Imagery, Taken

if TYPE_CHECKING:
    from facade_core.imagery.poses.joint_refinement import Alone
    from tasks.stages.bundles.worker import Member

# What of a block a panorama may be matched with, metres from where it was taken.
AROUND_POSE_M = 150.0
# Geometry lies this far off the planes of its charts at most.
OFF_PLANE_M = 1.0
# What does not rise this far above the foot of a wall does not hide it.
ABOVE_M = 0.01


def material_digests(run: Run) -> list[Any]:
    """What a block's own pictures of materials are."""
    return [[one.name, one.metres, file_digest(one.path)] for one in run.materials]


def parts_key(code: str, **parts: Any) -> str:
    """The key of a unit: of its stage's code, and its inputs by kind (strings, numbers, nested lists and dicts)."""
    return " ".join([f"code:{code}", *(f"{kind}:{unit_key(value)[:16]}" for kind, value in parts.items())])


def parts_of(key: str) -> dict[str, str]:
    """The digests that a key is made of, by kind: "code" first."""
    return dict(part.partition(":")[::2] for part in key.split())


def changed_parts(recorded: str, key: str) -> list[str]:
    """The kinds of input in which two keys of a unit differ."""
    before, now = parts_of(recorded), parts_of(key)
    return sorted(kind for kind in before | now if before.get(kind) != now.get(kind))


def exemplar_key(run: Run, path: Path) -> str:
    return parts_key(
        stage_code("exemplars"),
        settings=[run.seed, run.storey, run.texture.texels_per_metre, run.privacy],
        picture=[path.stem, *map(file_digest, with_labels(path))],
        **model_parts(Models(parser=run.models.parser)),  # an exemplar is parsed and not completed
    )


def model_parts(models: Models) -> dict[str, Any]:
    """What models of a block's own are, where there are some."""
    return {"models": model_digests(models)} if models.files else {}


def pose_key(run: Run, plan: Plan, panorama: int, path: Path, carried: bool) -> str:
    pose = plan.poses[panorama]
    place = np.array([pose.x, pose.y, pose.z])
    return parts_key(
        stage_code("poses"),
        settings=run.texture.texels_per_metre,
        picture=[path.name, file_digest(path)],
        pose=[*pose_numbers(pose), carried],
        geometry=plan.things.within(place - AROUND_POSE_M, place + AROUND_POSE_M),
    )


def bundle_key(run: Run, plan: Plan, members: Sequence[Member], surfaces: Sequence[int]) -> str:
    """Of panoramas that are refined together on some charts."""
    places = np.array([(one.alone.pose.x, one.alone.pose.y, one.alone.pose.z) for one in members]).reshape(-1, 3)
    around = (
        plan.things.within(places.min(axis=0) - AROUND_POSE_M, places.max(axis=0) + AROUND_POSE_M)
        if len(members)
        else []
    )
    return parts_key(
        stage_code("bundles"),
        settings=run.texture.texels_per_metre,
        pose=[pose_numbers(one.given) for one in members],
        panoramas=[[one.path.name, file_digest(one.path), *refined_pose_parts(one.alone)] for one in members],
        geometry=[[f"{number:016x}" for number in plan.ids[list(surfaces)].tolist()], around],
    )


def texture_key(run: Run, plan: Plan, building: int, textures: Sequence[Path]) -> str:
    """Of the charts of a building that have textures of their own, or are seen from above, its facades aside."""
    charts = plan.own_charts(building)
    parts: dict[str, Any] = {"settings": run.texture.texels_per_metre, "own": own_texture_parts(plan, charts, textures)}
    if run.aerial is not None and charts:
        parts["aerial"] = [run.aerial.content, run.aerial.crs, run.aerial.frame]
        low, high = bounding_box(plan, charts)
        high[2] = np.inf
        parts["above"] = plan.things.within(low - OFF_PLANE_M, high + OFF_PLANE_M)
    return parts_key(stage_code("textures"), **parts)


def ground_key(run: Run, plan: Plan, chart: int, taken: Sequence[Taken]) -> str:
    """Of a piece of ground that some panoramas are near."""
    return parts_key(
        stage_code("grounds"),
        settings=run.texture.texels_per_metre,
        geometry=f"{plan.ids[chart]:016x}",
        **panorama_parts(plan, {one: [chart] for one in taken}),
    )


def wall_key(run: Run, plan: Plan, charts: Sequence[int], taken: Sequence[Sequence[Taken]]) -> str:
    """Of walls and roofs of a building, and the panoramas that each is taken from."""
    charts_of: dict[Taken, list[int]] = {}
    for chart, of_chart in zip(charts, taken, strict=True):
        for one in of_chart:
            charts_of.setdefault(one, []).append(chart)
    return parts_key(
        stage_code("walls"),
        settings=run.texture.texels_per_metre,
        geometry=chart_ids(plan, charts),
        **panorama_parts(plan, dict(sorted(charts_of.items(), key=lambda item: item[0].path))),
    )


def panorama_parts(plan: Plan, charts_of: Mapping[Taken, Sequence[int]]) -> dict[str, Any]:
    """What panoramas are, which charts are taken from each, and what may stand between."""
    return {
        "panoramas": [
            [one.path.name, file_digest(one.path), pose_numbers(one.pose), list(one.factor), one.squares, chart_ids(plan, charts)]
            for one, charts in charts_of.items()
        ],
        "between": [digests_between(plan, charts, one.pose) for one, charts in charts_of.items()],
    }


def chart_ids(plan: Plan, charts: Sequence[int]) -> list[str]:
    return [f"{plan.ids[chart]:016x}" for chart in charts]


def facade_keys(
    run: Run,
    plan: Plan,
    facade: int,
    imagery: Imagery,
    exemplars: Mapping[int, str],
    textures: Sequence[Path],
) -> tuple[str, ...]:
    """The keys of a facade, one for each of its sources in order: when it is made from that, those before it having failed.

    exemplars: the key of each exemplar that could be prepared, by index.
    """
    table, placement = plan.facades, plan.scene.placement
    chart = int(table.chart[facade])
    shape = (int(placement.width[chart]), int(placement.height[chart]))
    size = (float(table.width[facade]), float(table.height[facade]), int(table.floors[facade]))
    low, high = bounding_box(plan, table.chart[table.laid_out_with(facade)].tolist())
    house: list[Any] = [
        float(table.foot[facade]),
        float(table.eaves[facade]),
        int(table.storeys[facade]),
        int(table.role[facade]),
    ]
    house += [bool(table.raised[facade]), int(table.house[facade])]
    house += [turns_corner(plan.scene.charts, table, facade), has_back_door(table, facade)]
    parts: dict[str, Any] = {
        "entrances": [float(table.along[facade]), *imagery.entrances] if imagery.entrances else [],
        "settings": [table.id[facade], run.seed, run.texture.texels_per_metre],
        "geometry": [f"{plan.ids[chart]:016x}", shape, size],
    }
    if imagery.corrected != AS_FOUND:
        said = imagery.corrected
        parts["corrected"] = [said.elements, said.hide, said.keep, said.facade]
    keys = []
    for source in imagery.sources():
        if source in ("photo", "panoramas"):
            parts["privacy"] = run.privacy
        if source in ("photo", "panoramas", "own"):
            parts |= model_parts(run.models)
        if source == "photo" and imagery.photo is not None:
            parts["photo"] = [imagery.photo.name, imagery.rectified, file_digest(imagery.photo)]
        elif source == "panoramas":
            parts["panoramas"], earlier = (
                [
                    [path.name, file_digest(path), pose_numbers(pose), *filter(None, [imagery.captured.get(path)])]
                    for path, pose in pictures
                ]
                for pictures in (imagery.panoramas, imagery.earlier)
            )
            if earlier:
                parts["earlier"] = earlier
            parts["between"] = [digests_between(plan, [chart], pose) for _, pose in (*imagery.panoramas, *imagery.earlier)]
        elif source == "own":
            parts["own"] = own_texture_parts(plan, [chart], textures)
        elif imagery.exemplar is not None:
            chosen = [imagery.exemplar[1], exemplars.get(imagery.exemplar[0]), imagery.shops]
            parts |= {"exemplar": chosen, "walls": run.texture.walls}
            parts["beside"] = [house, plan.things.within(low - JOINT_M, high + JOINT_M)]
        else:
            parts["walls"] = run.texture.walls
        keys.append(parts_key(stage_code("facades"), **parts))
    return tuple(keys)


def with_house(key: str, pictured: Sequence[str]) -> str:
    """The key of a facade without a picture, which takes its wall's colour from others of its house that have pictures, by the
    keys of these."""
    return f"{key} house:{unit_key(list(pictured))[:16]}" if pictured else key


def pose_numbers(pose: Pose) -> list[Any]:
    return [pose.x, pose.y, pose.z, pose.heading, pose.pitch, pose.roll, list(pose.view)]


def refined_pose_parts(one: Alone) -> list[Any]:
    return [pose_numbers(one.pose), None if one.spread is None else one.spread.tolist()]


def digests_between(plan: Plan, charts: Sequence[int], pose: Pose) -> list[str]:
    """What may stand between a panorama and charts, or is one of them."""
    place = np.array([pose.x, pose.y, pose.z])
    low, high = bounding_box(plan, charts)
    # what lies below both hides nothing: level ground does not count
    beside = np.array([OFF_PLANE_M, OFF_PLANE_M, -ABOVE_M])
    return plan.things.within(np.minimum(low, place) - beside, np.maximum(high, place) + OFF_PLANE_M)


def bounding_box(plan: Plan, charts: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """The corners (3,) of the box around some charts."""
    corners = plan.scene.charts.at_shares(np.array(charts), CORNERS)
    return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))


def own_texture_parts(plan: Plan, charts: Sequence[int], textures: Sequence[Path]) -> list[Any]:
    """The textures that some charts carry, by chart: where each corner lies on which picture."""
    mesh = plan.scene.mesh
    found = []
    for chart in charts:
        mine = mesh.triangles_of(chart)
        pictures = [file_digest(textures[i]) if i >= 0 else None for i in mesh.texture[mine].tolist()]
        shape = mesh.vertices[mesh.triangles[mine]].tobytes() + mesh.uv[mine].tobytes()
        found.append([f"{plan.ids[chart]:016x}", blake2b(shape, digest_size=8).hexdigest(), pictures])
    return found
