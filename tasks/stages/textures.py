"""The textures that buildings carry, into the atlas, a building at a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tasks.keys.units import texture_key
from tasks.outcome import is_done
from tasks.run import Run
from tasks.stages.fan_out import Stage, Work
from tasks.stages.ingest import Textured
from tasks.store.carry import forget_units
from tasks.store.commits import journal
from tasks.units.context import plan_of_run
from tasks.units.memory import texture_memory
from tasks.units.texture import texture_unit


def textures_due(run: Run, buildings: Sequence[Textured], textures: Sequence[Path]) -> Stage:
    """The buildings with textures of their own that the journal does not hold yet."""
    if not buildings:
        return Stage("textures", texture_unit)
    held = journal(run.store, "textures")
    plan = plan_of_run(run)
    names = [plan.scene.names[one.building] for one in buildings]
    keys = [texture_key(run, plan, one.building, textures) for one in buildings]
    due = [i for i, key in enumerate(keys) if not is_done(held[i], key)]
    forget_units(run, plan, "textures", {i: plan.own_charts(buildings[i].building) for i in due if held[i]})
    work = [
        Work(
            {i: (names[i], keys[i])},
            (i, buildings[i].building, names[i], keys[i], textures),
            texture_memory(buildings[i].texels, [textures[picture] for picture in buildings[i].pictures]),
        )
        for i in due
    ]
    return Stage("textures", texture_unit, work, held=[r for i, r in enumerate(held) if r and i not in due])
