"""What a run will do again of what an earlier one did, and why, in one line, before it starts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from catalogs.block import Block
from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.plan import Plan
from tasks.keys.streets import street_keys
from tasks.keys.units import changed_parts, exemplar_key, parts_of, pose_key, texture_key
from tasks.outcome import is_done
from tasks.run import Run
from tasks.stages.facades import facade_imagery, keys_of_facades
from tasks.stages.ingest import Outline
from tasks.units.context import plan_of_run

Record = dict[str, Any] | None

# Why a unit is due, by the kind of input that changed; the first that applies is told.
REASONS = {
    "photo": "photo changed",
    "picture": "picture changed",
    "panoramas": "panoramas or their poses changed",
    "pose": "pose changed",
    "exemplar": "exemplar changed",
    "own": "own texture changed",
    "aerial": "picture from above changed",
    "between": "surroundings changed",
    "above": "surroundings changed",
    "geometry": "geometry changed",
    "walls": "block's texture.walls changed",
    "settings": "block's settings changed",
    "code": "code or a library changed",
}
SEEN, READ, FOLLOW = "what is in sight changed", "what they see is done again", "texels of other streets changed"
NEW, AGAIN = "new", "not done before"


def what_is_due(run: Run, block: Block, outline: Outline) -> str | None:
    """One line: the units of an earlier run that are due again, by stage and reason; None where there was no earlier run.

    Later streets that only share ground with those are counted apart: they are due where that comes out differently.
    """
    if outline.anew:
        return f"all is due: {outline.anew}"
    session = open_repository(run.store).readonly_session(BRANCH)
    group = open_root(session)
    if not any(read_journal(group, "streets")):
        return None
    plan = plan_of_run(run)
    pictures = [panorama.path for panorama in block.panoramas]
    poses = _due(read_journal(group, "poses"), [(pose_key(run, plan, i, path),) for i, path in enumerate(pictures)])
    exemplars = _due(read_journal(group, "exemplars"), [(exemplar_key(run, path),) for path in block.exemplars])
    textures = _due(
        read_journal(group, "textures"),
        [(texture_key(run, plan, one.building, block.textures),) for one in outline.textured],
    )
    held = read_journal(group, "facades")
    facades = _due(held, keys_of_facades(run, facade_imagery(run, block, outline), block.textures))
    facades = _after(facades, held, outline, set(poses), {block.exemplars[i].stem for i in exemplars}, bool(exemplars))
    seeded = [int(plan.facades.chart[f]) for f in facades]
    seeded += [chart for i in textures for chart in plan.own_charts(outline.textured[i].building)]
    streets, follow = _streets(run, plan, group, seeded)
    told = [
        _told(len(pictures), "panorama", poses),
        _told(len(block.exemplars), "exemplar", exemplars),
        _told(len(outline.textured), "textured building", textures),
        _told(len(outline.facades), "facade", facades),
        _told(sum(map(len, outline.waves)), "street", streets),
    ]
    parts = [one for one in told if one]
    if follow:
        parts.append(f"{follow} more {'street' if follow == 1 else 'streets'} if texels that they share change")
    return f"due are {', '.join(parts)}; the rest stands" if parts else "nothing is due but what is published"


def what_is_set_aside(outline: Outline) -> list[str]:
    """A line for each kind of input that cannot be used, before anything is done without it."""
    found: dict[str, list[tuple[str, str]]] = {}
    for kind, unit, reason in outline.set_aside:
        found.setdefault(kind, []).append((unit, reason))
    lines = []
    for kind, units in found.items():
        unit, reason = units[0]
        more = f"; {len(units) - 1} more {kind}{'s' if len(units) > 2 else ''}" if len(units) > 1 else ""
        lines.append(f"set aside is {kind} {unit}: {reason}{more}")
    return lines


def _due(records: Sequence[Record], keys: Sequence[tuple[str, ...]]) -> dict[int, str]:
    """The units that are not done by any of their keys, by index, and why."""
    return {i: _why(records[i], own) for i, own in enumerate(keys) if not is_done(records[i], *own)}


def _why(record: Record, keys: tuple[str, ...]) -> str:
    if record is None:
        return NEW
    if record["key"] in keys:
        return AGAIN
    changed = min((changed_parts(record["key"], key) for key in keys), key=len)
    return next((reason for part, reason in REASONS.items() if part in changed), REASONS["settings"])


def _after(
    facades: Mapping[int, str], held: Sequence[Record], outline: Outline, poses: set[int], sources: set[str], anew: bool
) -> dict[int, str]:
    """The facades that are due once panoramas and exemplars are done again: keys as the journal stands know nothing of these.

    sources: the names of exemplars that are due; anew: whether some are.
    """
    found = {}
    for facade, record in enumerate(held):
        reason = facades.get(facade)
        if record is not None and anew and (reason in (None, REASONS["exemplar"])):
            reason = REASONS["exemplar"] if record.get("source") in sources else None
        from_panoramas = record is not None and "panoramas" in parts_of(record["key"])
        if reason is None and from_panoramas and any(panorama in poses for panorama, _ in outline.panoramas[facade]):
            reason = REASONS["panoramas"]
        if reason is not None:
            found[facade] = reason
    return found


def _streets(run: Run, plan: Plan, group: StoreGroup, seeded: Sequence[int]) -> tuple[dict[int, str], int]:
    """The streets that are due and why, and how many more are where others change what they share; seeded: the charts that are
    seeded again."""
    records = read_journal(group, "streets")
    pairs = plan.street_charts
    due: dict[int, str] = {}
    following: set[int] = set()
    for street in sorted(np.unique(pairs[:, 0]).tolist(), key=lambda s: (int(plan.wave[s]), s)):
        charts = pairs[pairs[:, 0] == street, 1]
        key = street_keys(run, plan, group, street).street
        record = records[street]
        if record is None:
            due[street] = NEW
        elif "views" in (changed := changed_parts(record["key"], key)):
            due[street] = SEEN
        elif why := next((part for part in ("settings", "code") if part in changed), None):
            due[street] = REASONS[why]
        elif np.isin(charts, seeded).any():
            due[street] = READ
        elif changed:
            due[street] = FOLLOW
        elif record["status"] != "done":
            due[street] = AGAIN
        else:
            before = pairs[np.isin(pairs[:, 0], [*due, *following]) & (plan.wave[pairs[:, 0]] < plan.wave[street]), 1]
            if plan.writable[np.intersect1d(charts, before)].any():
                following.add(street)
    return due, len(following)


def _told(total: int, name: str, due: Mapping[int, str]) -> str | None:
    """Such as "3 of 202 facades (2: photo changed, 1: new)"; None where none is due."""
    if not due:
        return None
    reasons = Counter(due.values()).most_common()
    why = reasons[0][0] if len(reasons) == 1 else ", ".join(f"{count}: {reason}" for reason, count in reasons)
    return f"{len(due)} of {total} {name if total == 1 else name + 's'} ({why})"
