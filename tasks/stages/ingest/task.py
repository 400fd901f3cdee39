"""Task of `ingest`: write a block's geometry, facades and viewpoints to the store."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from itertools import starmap
from pathlib import Path

import numpy as np
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.block.corrections import BUILDING_CORRECTION_KINDS
from catalogs.block.reader import Block
from catalogs.features import safe_file_stem
from facade_core.atlas.arrays import STORE_FORMAT, create_arrays
from facade_core.atlas.store import (
    BRANCH,
    Repository,
    commit,
    create_root,
    open_repository,
    open_root,
    open_root_of_any_format,
    read_format,
)
from facade_core.atlas.stored_files import EXEMPLARS
from facade_core.core.zarr_types import get_subgroup
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.walls import WallRole
from facade_core.plan.identity import ParallelMap, map_in_this_process
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan, write_plan
from facade_core.plan.posed_pictures import place_pictured_facades
from facade_core.plan.settings import PLANNED_FACADES
from tasks.engine.outline import PlanSummary
from tasks.engine.progress import begin_stage, report_progress
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.store.carry_over import (
    LastIngest,
    adapt_store_to_plan,
    fresh_ingest_reason,
    has_all_stages,
    read_last_ingest,
    read_last_places,
    store_compatibility_settings,
    unit_counts,
)
from tasks.engine.store.disk_space import require_disk_space, required_block_bytes
from tasks.stages.ingest.photo_resolution import photo_resolution
from tasks.stages.ingest.planning import make_plan, plan_reuse_key, update_plan_panoramas
from tasks.stages.shared.facade_corrections import map_changed_facade_ids, match_corrections
from tasks.stages.shared.materials import store_materials
from tasks.stages.shared.picture_choice import choose_pictures

MAX_NAMED_FACADES = 3  # facades of a building in a message
# Mark that file managers add to the name of a copy: "a (1)", "a copy", "a - Copy 2".
_COPY_MARK = re.compile(r"(\s*\(\d+\)|[\s_-]+copy(\s*\d+)?)$", re.IGNORECASE)


@task(name="ingest", task_run_name="ingest", cache_policy=NO_CACHE)
def ingest_block(run: Run, block: Block, each: ParallelMap = map_in_this_process) -> PlanSummary:
    """Write the block's plan and its arrays in one commit, unless the store holds them for the same inputs and code.

    Arrays are empty, or keep what remains valid of an earlier ingest.

    Parameters
    ----------
    each : maps a function over items; it may cast rays on workers.
    """
    begin_stage("ingest", 1)
    repository = open_repository(run.store, create=True)
    session = repository.writable_session(BRANCH)
    root = open_root_of_any_format(session)
    choices: dict[str, object] = {}
    skipped, anew = (
        root.attrs.get("key") == run.key and read_format(root) == STORE_FORMAT and has_all_stages(root),
        None,
    )
    if skipped:
        plan = read_plan(session)
    else:
        standing = plan_reuse_key(block)
        same = root.attrs.get("plan") == standing
        last = read_last_ingest(run, repository) or (
            _restore_last_ingest(run, block, repository, each) if same else None
        )
        plan = (
            update_plan_panoramas(block, last.plan)
            if last and same
            else make_plan(block, last.places if last else None, each)
        )
        plan = place_pictured_facades(plan, last.places if last else None, photo_resolution(block, plan))
        require_disk_space(run.local, required_block_bytes(plan, stored=run.local == run.folder))
        if last is None:
            anew = fresh_ingest_reason(run, root)
            if EXEMPLARS in root and read_format(root) == STORE_FORMAT:
                choices = dict(get_subgroup(root, EXEMPLARS).attrs)
            root = create_root(session)
        set_aside = [(fault.kind, fault.id, fault.reason) for fault in block.faults]
        set_aside += [("building", unit, reason) for unit, reason in plan.rejected_buildings]
        set_aside += [("block", run.block, reason) for reason in explain_missing_street_facades(plan)]
        set_aside += [("photo", unit, reason) for unit, reason in find_stray_photos(block.photos, plan.facades.id)]
        root.attrs.update(
            block=run.block,
            key=run.key,
            plan=standing,
            made_for=store_compatibility_settings(run),
            ingested_by=stage_code_digest("ingest"),
            published_by=stage_code_digest("publish"),
            crs=run.crs,
            seed=run.seed,
            relief=run.texture.relief,
            light=run.texture.light,
            sun=run.texture.sun and [run.texture.sun.azimuth, run.texture.sun.elevation],
            material_digest=store_materials(root, run.roof_material, run.materials, run.texture.texels_per_metre),
            geoid_separation=block.geoid_separation,
            notes=_notes(block, plan),
            set_aside=set_aside,
            corrected=sorted(block.corrections.select_kinds(BUILDING_CORRECTION_KINDS)),
            known_by_place={**block.corrections.new_ids, **map_changed_facade_ids(plan, block.corrections, block.crs)},
            ingested=time.time(),
        )
        write_plan(session, plan, block.buildings, run.crs)
        if last is None:
            create_arrays(
                root,
                plan.scene.spec,
                unit_counts(block, plan),
                crs=run.crs,
            )
            get_subgroup(root, EXEMPLARS).attrs.update(choices)
        else:
            adapt_store_to_plan(root, last, run, block, plan)
        commit(session, f"ingest {run.block}")
    report_progress("ingest", 1)
    return PlanSummary(tuple(map(tuple, root.attrs["set_aside"])), float(root.attrs["ingested"]), skipped, anew)


def _restore_last_ingest(run: Run, block: Block, repository: Repository, each: ParallelMap) -> LastIngest | None:
    """Make the plan of the last ingest again, of which tables are lost; None if its charts lie elsewhere now."""
    if (places := read_last_places(run, repository)) is None:
        return None
    plan = make_plan(block, places, each)
    plan = place_pictured_facades(plan, places, photo_resolution(block, plan))
    columns = ((getattr(one, field.name) for field in fields(one)) for one in (places.placement, plan.scene.placement))
    if not np.array_equal(plan.ids, places.ids) or not all(starmap(np.array_equal, zip(*columns, strict=True))):
        return None
    return LastIngest(open_root(repository.readonly_session(BRANCH)), plan)


def explain_missing_street_facades(plan: Plan) -> list[str]:
    """Explain in one line why no facade is on a street; empty list if one is."""
    if (plan.facades.role == WallRole.STREET).any():
        return []
    charts = plan.scene.charts
    wall = charts.kind == ChartKind.WALL
    small = wall & (
        (charts.size[:, 0] < PLANNED_FACADES.min_facade_width_m)
        | (charts.size[:, 1] < PLANNED_FACADES.min_facade_height_m)
    )
    coarse = (
        wall
        & ~small
        & (charts.texels(plan.scene.placement.texels_per_metre).min(axis=1) < PLANNED_FACADES.min_facade_texels)
    )
    unseen = int(wall.sum() - small.sum() - coarse.sum())
    return [
        f"none of the {wall.sum()} walls is a facade: {small.sum()} are under {PLANNED_FACADES.min_facade_width_m:g} x "
        f"{PLANNED_FACADES.min_facade_height_m:g} m, {coarse.sum()} have under {PLANNED_FACADES.min_facade_texels} "
        f"texels a side (raise texture.texels_per_metre), {unseen} are seen from no street "
        "(check streets, or raise texture.visibility_range)"
    ]


def _notes(block: Block, plan: Plan) -> list[str]:
    """Return notes on omitted, assumed and derived input."""
    notes = list(block.notes)
    if not block.streets:
        length = sum(street.line.length for street in plan.streets)
        notes.append(f"no streets given: {len(plan.streets)} of {length:.0f} m derived from the gaps between buildings")
    if unused := len(block.panoramas) - len(choose_pictures(plan, block)):
        notes.append(
            f"{unused} of {len(block.panoramas)} pictures show nothing that others do not show better: not used"
        )
    if block.corrections:
        notes += _unused_corrections(block, plan)
    return notes


def _unused_corrections(block: Block, plan: Plan) -> list[str]:
    """Return a note on corrections of facades, buildings or exemplars that the block lacks; they are kept."""
    lost = match_corrections(plan, block.corrections, block.crs)[1]
    buildings, exemplars = set(plan.scene.names), {path.stem for path in block.exemplars}
    for id, said in block.corrections.select_kinds(BUILDING_CORRECTION_KINDS).items():
        unknown = "exemplar" in said and said["exemplar"].value not in exemplars
        if id not in buildings or unknown:
            lost.append(id)
    if not lost:
        return []
    return [
        f"corrections of what is not in the block as it is, kept and not used: {len(lost)} ({', '.join(sorted(lost)[:3])})"
    ]


def find_stray_photos(photos: Mapping[str, Path], facades: Sequence[str]) -> list[tuple[str, str]]:
    """Find photos whose name is no facade's id, as (file name, reason with the nearest id)."""
    return [
        (
            photos[name].name,
            f"no facade has the id {name}; {_suggest_facades(name, facades)}; rename or remove the photo",
        )
        for name in sorted(set(photos) - set(facades) - set(map(safe_file_stem, facades)))
    ]


def _suggest_facades(name: str, facades: Sequence[str]) -> str:
    """Name the facade that a photo's name means: without case and the mark of a copy, by its building, or similar."""
    plain = _COPY_MARK.sub("", name).casefold()
    if same := [id for id in facades if id.casefold() in (plain, name.casefold())]:
        return f"the nearest is {same[0]}"
    if of_building := [id for id in facades if id.casefold().rpartition("-")[0] == plain]:
        more = f" and {len(of_building) - MAX_NAMED_FACADES} more" if len(of_building) > MAX_NAMED_FACADES else ""
        return f"the facades of this building are {', '.join(of_building[:MAX_NAMED_FACADES])}{more}"
    near = get_close_matches(name, facades, n=1, cutoff=0.6)
    return f"the nearest is {near[0]}" if near else "ids are in `streetloom query`"
