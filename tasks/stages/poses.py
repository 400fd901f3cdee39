"""The poses of panoramas, refined against the block before facades are taken from them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from facade_core.types import Pose
from tasks.keys.units import pose_key
from tasks.outcome import is_done
from tasks.run import Run
from tasks.stages.fan_out import Stage, Work
from tasks.store.commits import journal
from tasks.units.context import plan_of_run
from tasks.units.memory import pose_memory
from tasks.units.pose import pose_unit


def poses_due(run: Run, paths: Sequence[Path]) -> Stage:
    """The panoramas whose pose is not refined yet."""
    held = journal(run.store, "poses")
    plan = plan_of_run(run)
    keys = [pose_key(run, plan, i, path) for i, path in enumerate(paths)]
    due = [i for i, key in enumerate(keys) if not is_done(held[i], key)]
    work = [Work({i: (paths[i].name, keys[i])}, (i, paths[i], keys[i]), pose_memory(paths[i])) for i in due]
    return Stage("poses", pose_unit, work, held=[r for i, r in enumerate(held) if r and i not in due])


def refined(run: Run, given: Sequence[Sequence[tuple[int, Pose]]]) -> list[list[tuple[int, Pose]]]:
    """Panoramas and their poses, by facade, with the refined pose of each; the given one where refining failed."""
    held = journal(run.store, "poses")

    def pose(panorama: int, given: Pose) -> Pose:
        record = held[panorama]
        if record is None or record["status"] != "done":
            return given
        x, y, z, heading, pitch, roll = record["pose"]
        return Pose(x, y, z, heading, pitch, roll, given.view)

    return [[(panorama, pose(panorama, one)) for panorama, one in shown] for shown in given]
