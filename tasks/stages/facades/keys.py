"""Keys of facades: one for each source of imagery, in the order of trying."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from catalogs.file_digest import file_digest
from facade_core.atlas.journal import unit_key
from facade_core.core.types import AS_FOUND
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.plan.doors import has_back_door, is_corner_facade
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit_key import join_key_parts
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.shared.key_parts import (
    bounding_box,
    model_key_parts,
    object_digests_between,
    own_texture_key_parts,
    pose_key_parts,
)


def facade_keys(
    run: Run,
    plan: Plan,
    facade: int,
    imagery: FacadeImagery,
    exemplars: Mapping[int, str],
    textures: Sequence[Path],
) -> tuple[str, ...]:
    """Return the keys of a facade, one for each source in order: it is made from that source after all before it failed.

    Parameters
    ----------
    facade : index of the facade.
    imagery : its pictures.
    exemplars : key of each exemplar that could be prepared, by index.
    textures : files of the model's textures.
    """
    table, placement = plan.facades, plan.scene.placement
    chart = int(table.chart[facade])
    shape = (int(placement.width[chart]), int(placement.height[chart]))
    size = (float(table.width[facade]), float(table.height[facade]), int(table.floors[facade]))
    low, high = bounding_box(plan, table.chart[table.run_members(facade)].tolist())
    house: list[object] = [
        float(table.foot[facade]),
        float(table.eaves[facade]),
        int(table.storeys[facade]),
        int(table.role[facade]),
    ]
    house += [bool(table.raised[facade]), int(table.house[facade])]
    house += [is_corner_facade(plan.scene.charts, table, facade), has_back_door(table, facade)]
    house += [bool(table.roofed[facade])]
    parts: dict[str, object] = {
        "entrances": [float(table.along[facade]), *imagery.entrances] if imagery.entrances else [],
        "settings": [table.id[facade], run.seed, run.texture.texels_per_metre],
        "geometry": [f"{plan.ids[chart]:016x}", shape, size],
    }
    if plan.street_density[chart] != placement.texels_per_metre[chart]:
        parts["geometry"] = [f"{plan.ids[chart]:016x}", shape, size, float(plan.street_density[chart])]
    if imagery.corrected != AS_FOUND:
        said = imagery.corrected
        parts["corrected"] = [said.elements, said.hide, said.keep, said.facade]
    keys = []
    for source in imagery.sources():
        if source in ("photo", "panoramas"):
            parts["privacy"] = run.privacy
        if source in ("photo", "panoramas", "own"):
            parts |= model_key_parts(replace(run.models, translator=None))
        if source == "photo" and imagery.photo is not None:
            parts["photo"] = [imagery.photo.name, imagery.rectified, file_digest(imagery.photo)]
        elif source == "panoramas":
            parts["panoramas"], earlier = (
                [
                    [
                        path.name,
                        file_digest(path),
                        pose_key_parts(pose),
                        *filter(None, [imagery.captured.get(path), imagery.exposure_factors.get(path)]),
                    ]
                    for path, pose in pictures
                ]
                for pictures in (imagery.panoramas, imagery.earlier)
            )
            if earlier:
                parts["earlier"] = earlier
            parts["between"] = [
                object_digests_between(plan, [chart], pose) for _, pose in (*imagery.panoramas, *imagery.earlier)
            ]
        elif source == "own":
            parts["own"] = own_texture_key_parts(plan, [chart], textures)
        elif imagery.exemplar is not None:
            chosen = [imagery.exemplar[1], exemplars.get(imagery.exemplar[0]), imagery.shops]
            chosen += ["stated"] if imagery.is_exemplar_stated else []
            parts |= {"exemplar": chosen, "walls": run.texture.walls}
            parts["beside"] = [
                house,
                plan.scene_objects.digests_in_box(low - FACADE_WALLS.max_joint_m, high + FACADE_WALLS.max_joint_m),
            ]
        else:
            parts["walls"] = run.texture.walls
        keys.append(join_key_parts(stage_code_digest("facades"), **parts))
    return tuple(keys)


def add_house_to_key(key: str, pictured: Sequence[str]) -> str:
    """Extend a facade's key by the keys of pictured facades that give its wall colour, style or exposure."""
    return f"{key} house:{unit_key(list(pictured))[:16]}" if pictured else key
