"""Which facades are due, and what each is made from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.block import Block
from facade_core.style import choose_exemplars
from tasks.keys.units import facade_keys
from tasks.outcome import is_done
from tasks.run import Run
from tasks.stages.fan_out import Stage, Work
from tasks.stages.ingest import Outline
from tasks.stages.poses import refined
from tasks.store.carry import forget_units
from tasks.store.commits import journal
from tasks.units.context import plan_of_run
from tasks.units.facade import facade_unit
from tasks.units.imagery import Imagery, imagery_of
from tasks.units.memory import facade_memory


@task(name="choose exemplars", task_run_name="choose exemplars", cache_policy=NO_CACHE)
def choose(run: Run, block: Block, outline: Outline) -> list[Imagery]:
    """The imagery of every facade, with the exemplar chosen for it: `facade_imagery` when panoramas and exemplars are done."""
    return facade_imagery(run, block, outline)


def facade_imagery(run: Run, block: Block, outline: Outline) -> list[Imagery]:
    """The imagery of every facade as the journal stands: poses that are refined, exemplars that could be prepared."""
    chosen = _chosen(run) if run.walls == "exemplar" else {}
    panoramas = [[(block.panoramas[p].path, pose) for p, pose in shown] for shown in refined(run, outline.panoramas)]
    return imagery_of(outline.facades, block.photos, block.photos_rectified, panoramas, outline.own, chosen)


def _chosen(run: Run) -> dict[int, tuple[int, str]]:
    """An exemplar, (index, name), for every facade; none where no exemplar could be prepared.

    Whatever pictures there are, of it or of others: a photo that comes, goes or is refused changes its own facade alone.
    """
    usable = [(i, r) for i, r in enumerate(journal(run.store, "exemplars")) if r and r["status"] == "done"]
    plan = plan_of_run(run)
    facades = plan.facades
    if not usable or not len(facades):
        return {}
    chosen = choose_exemplars(
        facades.width,
        facades.floors,
        plan.scene.building_numbers[facades.building],
        [r["width_m"] for _, r in usable],
        [r["floors"] for _, r in usable],
        seed=run.seed,
    )
    return {facade: (usable[c][0], usable[c][1]["unit"]) for facade, c in enumerate(chosen.tolist())}


def keys_of_facades(run: Run, imagery: Sequence[Imagery], textures: Sequence[Path]) -> list[tuple[str, ...]]:
    """The keys of every facade as the journal stands."""
    plan = plan_of_run(run)
    exemplars = {i: r["key"] for i, r in enumerate(journal(run.store, "exemplars")) if r and r["status"] == "done"}
    return [facade_keys(run, plan, f, one, exemplars, textures) for f, one in enumerate(imagery)]


def facades_due(
    run: Run,
    buildings: Sequence[Sequence[int]],
    names: Sequence[str],
    texels: Sequence[int],
    imagery: Sequence[Imagery],
    textures: Sequence[Path],
) -> Stage:
    """The facades that the journal does not hold yet. Those of a building go to one worker: they may share chunks."""
    held = journal(run.store, "facades")
    keys = keys_of_facades(run, imagery, textures)
    due = {f for f, own in enumerate(keys) if not is_done(held[f], *own)}
    stale = [f for f in sorted(due) if held[f]]
    plan = plan_of_run(run)
    forget_units(run, plan, "facades", {f: [int(plan.facades.chart[f])] for f in stale})
    work = []
    for facades in buildings:
        if mine := [f for f in facades if f in due]:
            arguments = (mine, {f: keys[f] for f in mine}, {f: imagery[f] for f in mine}, textures)
            memory = max(facade_memory(texels[f], imagery[f]) for f in mine)
            work.append(Work({f: (names[f], keys[f][-1]) for f in mine}, arguments, memory))
    return Stage("facades", facade_unit, work, [r for f, r in enumerate(held) if r and f not in due])
