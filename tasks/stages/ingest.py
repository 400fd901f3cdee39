"""Ingest a block: its geometry, facades, viewpoints and waves into the store."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.features import file_stem
from facade_core.atlas.arrays import create_arrays
from facade_core.atlas.plan_tables import read_plan, write_plan
from facade_core.atlas.store import BRANCH, commit, new_root, open_repository, root_of_any_format
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.facades import FACADE_HEIGHT_M, FACADE_TEXELS, FACADE_WIDTH_M
from facade_core.geometry.charts import WALL
from facade_core.plan import Plan
from facade_core.types import Pose
from tasks.keys.stage_code import stage_code
from tasks.keys.units import exemplar_key, pose_key
from tasks.progress import advance, begin_stage
from tasks.run import Run
from tasks.stages.planning import plan_of
from tasks.store.carry import carry_over, last_ingest, made_for, why_anew
from tasks.store.room import require_room, room_for

if TYPE_CHECKING:
    from catalogs.block import Block

# Panoramas at most that a facade is taken from: more show nothing better, and each must be parsed.
VIEWS = 4


@dataclass(frozen=True)
class Textured:
    """A building with textures of its own, by index: texels of its textured charts, and the pictures that they use."""

    building: int
    texels: int
    pictures: tuple[int, ...]


@dataclass(frozen=True)
class Outline:
    """What the flow needs of a plan to order the work: units by index, no arrays.

    texels: of each facade; buildings: the facades of each building that has some; textured: the buildings with textures of
    their own, in order; panoramas: those that show each facade, best first, as (index, pose); own: whether each facade has a
    texture of its own; streets: names; waves: the streets of each wave; viewpoints: how many each street has; windows: texels
    that each street sees, and those of them that it writes; set_aside: input that cannot be used, as (kind, unit, reason);
    ingested: when the plan was written, seconds since 1970; anew: why nothing of an earlier ingest was taken over, if so.
    """

    facades: tuple[str, ...]
    texels: tuple[int, ...]
    buildings: tuple[tuple[int, ...], ...]
    streets: tuple[str, ...]
    waves: tuple[tuple[int, ...], ...]
    viewpoints: tuple[int, ...]
    windows: tuple[tuple[int, int], ...]
    textured: tuple[Textured, ...]
    panoramas: tuple[tuple[tuple[int, Pose], ...], ...]
    own: tuple[bool, ...]
    set_aside: tuple[tuple[str, str, str], ...]
    ingested: float
    skipped: bool
    anew: str | None = None


@task(name="ingest", task_run_name="ingest", cache_policy=NO_CACHE)
def ingest_block(run: Run, block: Block) -> Outline:
    """Write the block's plan and its arrays in one commit, unless the store holds them for the same inputs and code.

    Arrays are empty, or hold what is left of an earlier ingest.
    """
    begin_stage("ingest", 1)
    repository = open_repository(run.store, create=True)
    session = repository.writable_session(BRANCH)
    root = root_of_any_format(session)
    skipped, anew = root.attrs.get("key") == run.key, None
    if skipped:
        plan = read_plan(session)
    else:
        last = last_ingest(run, repository)
        plan = plan_of(block, last.places if last else None)
        require_room(Path(run.out), room_for(plan, run.panorama_width))
        if last is None:
            anew = why_anew(run, root)
            root = new_root(session)
        set_aside = [(fault.kind, fault.id, fault.reason) for fault in block.faults]
        set_aside += [("building", unit, reason) for unit, reason in plan.refused]
        set_aside += [("building", "all buildings", reason) for reason in no_facade(plan, run.texels_per_metre)]
        set_aside += [("photo", unit, reason) for unit, reason in stray_photos(block.photos, plan.facades.id)]
        root.attrs.update(
            block=run.block,
            key=run.key,
            made_for=made_for(run),
            ingested_by=stage_code("ingest"),
            published_by=stage_code("publish"),
            crs=run.crs,
            seed=run.seed,
            geoid_separation=block.geoid_separation,
            notes=_notes(block, plan),
            set_aside=set_aside,
            ingested=time.time(),
        )
        write_plan(session, plan, block.buildings, run.crs)
        if last is None:
            create_arrays(
                root,
                plan.scene.spec,
                {
                    "poses": len(block.panoramas),
                    "exemplars": len(block.exemplars),
                    "textures": len(plan.textured_buildings()),
                    "facades": len(plan.facades),
                    "viewpoints": len(plan.viewpoints),
                    "streets": len(plan.streets),
                },
                crs=run.crs,
                panorama_width=run.panorama_width,
            )
        else:
            carry_over(
                root,
                last,
                plan,
                panorama_width=run.panorama_width,
                poses=[(p.path.name, pose_key(run, plan, i, p.path)) for i, p in enumerate(block.panoramas)],
                exemplars=[(path.stem, exemplar_key(run, path)) for path in block.exemplars],
            )
        commit(session, f"ingest {run.block}")
    advance("ingest", 1)
    return replace(_outline(plan, root, skipped), anew=anew)


def no_facade(plan: Plan, texels_per_metre: float) -> list[str]:
    """Why a block has no facade at all, in one line, with the remedy; nothing where it has one."""
    if len(plan.facades):
        return []
    charts = plan.scene.charts
    wall = charts.kind == WALL
    small = wall & ((charts.size[:, 0] < FACADE_WIDTH_M) | (charts.size[:, 1] < FACADE_HEIGHT_M))
    coarse = wall & ~small & (charts.texels(texels_per_metre).min(axis=1) < FACADE_TEXELS)
    unseen = int(wall.sum() - small.sum() - coarse.sum())
    return [
        f"none of the {wall.sum()} walls is a facade: {small.sum()} are under {FACADE_WIDTH_M:g} x {FACADE_HEIGHT_M:g} m, "
        f"{coarse.sum()} have under {FACADE_TEXELS} texels a side (raise texture.texels_per_metre), {unseen} are seen from no "
        "street (check streets, or raise texture.visibility_range)"
    ]


def _notes(block: Block, plan: Plan) -> list[str]:
    """What was left out or assumed, and what was derived."""
    notes = list(block.notes)
    if not block.streets:
        length = sum(street.line.length for street in plan.streets)
        notes.append(f"no streets given: {len(plan.streets)} of {length:.0f} m derived from the gaps between buildings")
    return notes


def _outline(plan: Plan, root: StoreGroup, skipped: bool) -> Outline:
    building = plan.facades.building.tolist()
    facades: dict[int, list[int]] = {}
    for facade, one in enumerate(building):
        facades.setdefault(one, []).append(facade)
    streets = np.array([v.street for v in plan.viewpoints], np.int64)
    per_street = np.bincount(streets, minlength=len(plan.wave)).tolist()
    texels = plan.texels()
    return Outline(
        facades=plan.facades.id,
        texels=tuple(texels[plan.facades.chart].tolist()),
        buildings=tuple(tuple(facades[one]) for one in sorted(facades)),
        streets=tuple(street.name or street.id for street in plan.streets),
        waves=tuple(
            tuple(s for s in range(len(plan.wave)) if plan.wave[s] == wave and per_street[s])
            for wave in range(int(plan.wave.max(initial=-1)) + 1)
        ),
        viewpoints=tuple(per_street),
        windows=tuple((read, written) for read, written in plan.street_texels().tolist()),
        textured=_textured(plan, texels),
        panoramas=tuple(
            tuple((p, plan.poses[p]) for p in plan.sightings.of(i)[:VIEWS].tolist()) for i in range(len(plan.facades))
        ),
        own=tuple(plan.textured[plan.facades.chart].tolist()),
        set_aside=tuple(map(tuple, root.attrs["set_aside"])),
        ingested=float(root.attrs["ingested"]),
        skipped=skipped,
    )


def _textured(plan: Plan, texels: np.ndarray) -> tuple[Textured, ...]:
    textured = np.flatnonzero(plan.textured & (plan.scene.charts.building >= 0))
    totals = np.zeros(int(plan.scene.charts.building.max(initial=-1)) + 1, np.int64)
    np.add.at(totals, plan.scene.charts.building[textured], texels[textured])
    pictures = plan.own_pictures()
    return tuple(Textured(one, int(totals[one]), tuple(pictures.get(one, ()))) for one in plan.textured_buildings())


def stray_photos(photos: Mapping[str, Path], facades: Sequence[str]) -> list[tuple[str, str]]:
    """Photos whose name is no facade's id, as (file name, reason with the nearest id)."""
    strays = []
    for name in sorted(set(photos) - set(facades) - set(map(file_stem, facades))):
        near = get_close_matches(name, facades, n=1, cutoff=0.6)
        hint = f"the nearest is {near[0]}; " if near else "ids are in `streetloom query`; "
        strays.append((photos[name].name, f"no facade has the id {name}; {hint}rename or remove the photo"))
    return strays
