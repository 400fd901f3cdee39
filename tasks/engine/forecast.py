"""Which units are due: those that the journal does not hold as done for what they stand on now. And what a run will do again
of what an earlier one did, and why, in one line, before it starts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import Record, read_journal
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.context import plan_of_run
from tasks.engine.outcome import is_done
from tasks.engine.run import Run
from tasks.engine.stage import Stage
from tasks.engine.store.carry_over import forget_units
from tasks.engine.unit import Piece, Unit
from tasks.engine.unit_key import changed_parts, parts_of
from tasks.stages.bundles.stage import bundles, members_of
from tasks.stages.facades.stage import panoramas_of
from tasks.stages.ingest.task import Outline
from tasks.stages.order import KINDS
from tasks.stages.shared.base_layer import BASE_LAYER_STAGES
from tasks.stages.streets.keys import street_keys

SEEN, READ, FOLLOW = "what is in sight changed", "what they see is done again", "texels of other streets changed"
# Why a unit is due, by the kind of input that changed; the first that applies is told.
REASONS = {
    "corrected": "corrected",
    "photo": "photo changed",
    "picture": "picture changed",
    "earlier": "panoramas of an earlier capture changed",
    "panoramas": "panoramas or their poses changed",
    "pose": "pose changed",
    "exemplar": "exemplar changed",
    "models": "block's models changed",
    "own": "own texture changed",
    "aerial": "picture from above changed",
    "entrances": "entrances of the map changed",
    "beside": "surroundings changed",
    "between": "surroundings changed",
    "above": "surroundings changed",
    "around": "surroundings changed",
    "lines": "streets changed",
    "views": SEEN,
    "seeds": "what they are made of is done again",
    "streets": "what they are made of is done again",
    "geometry": "geometry changed",
    "walls": "block's texture.walls changed",
    "settings": "block's settings changed",
    "code": "code or a library changed",
    "house": "pictures of its house changed",
}
NEW, AGAIN = "new", "not done before"


@dataclass(frozen=True)
class Due:
    """The units of a kind that are due, in pieces of what one worker does in one go, and the records of the others."""

    kind: Stage
    pieces: tuple[Piece, ...]
    done: tuple[Record, ...]

    @property
    def total(self) -> int:
        return len(self.done) + sum(map(len, self.pieces))


@dataclass(frozen=True)
class Ahead:
    """What is known before a run does anything: what it will do again, in a line, None where there was no earlier run; and the
    units by stage as the journal stood then."""

    said: str | None = None
    units: Mapping[str, Sequence[Unit]] = field(default_factory=dict)


def due_of(run: Run, block: Block, kind: Stage, units: Sequence[Unit] | None = None) -> Due:
    """What of a kind is due; what is known of that is forgotten where it seeds, so that nobody reads what is of before.

    units: all of the kind, where they are known and nothing was done since that they stand on.
    """
    if kind.units is None:
        raise TypeError(f"{kind.stage} are not fanned out")
    plan = plan_of_run(run)
    group = _newest(run)
    records = read_journal(group, kind.stage)
    if units is None:
        units = kind.units(run, block, plan, group)
    waiting = [unit for unit in units if not is_done(records[unit.index], *unit.keys)]
    if kind.writes_base_layer:
        forget_units(run, plan, kind.stage, {u.index: u.charts for u in waiting if u.charts and records[u.index]})
    indices = {unit.index for unit in waiting}
    return Due(
        kind,
        tuple(_pieces(waiting)),
        tuple(record for index, record in enumerate(records) if record and index not in indices),
    )


def _pieces(units: Sequence[Unit]) -> list[Piece]:
    """Units in what one worker does in one go, in the order of what they share, else of their indices."""
    alone = [(unit,) for unit in units if unit.group_id is None]
    shared = sorted((unit for unit in units if unit.group_id is not None), key=lambda unit: unit.group_id or 0)
    return [*alone, *(tuple(piece) for _, piece in groupby(shared, key=lambda unit: unit.group_id))]


def what_is_due(run: Run, block: Block, outline: Outline) -> Ahead:
    """The units of an earlier run that are due again, by stage and reason.

    Later streets that only share ground with those are counted apart: they are due where that comes out differently.
    """
    if outline.anew:
        return Ahead(f"all is due: {outline.anew}")
    group = _newest(run)
    if not any(read_journal(group, "streets")):
        return Ahead()
    plan = plan_of_run(run)
    units: dict[str, list[Unit]] = {}
    reasons: dict[str, dict[int, str]] = {}
    seeded: list[int] = []
    for kind in KINDS:
        if kind.units is None or kind.derived_only:
            continue
        records = read_journal(group, kind.stage)
        units[kind.stage] = kind.units(run, block, plan, group)
        reasons[kind.stage] = _due(records, units[kind.stage])
        if kind.stage == "bundles":
            reasons["bundles"] = _bundles(reasons, plan, block)
        if kind.stage in ("grounds", "walls") and (
            reasons["poses"] or reasons["bundles"]
        ):  # one exposure for all of them
            reasons[kind.stage] = dict.fromkeys((u.index for u in units[kind.stage]), REASONS["panoramas"])
        if kind.stage == "facades":
            reasons["facades"] = _after(reasons, units, records, plan, block)
        if kind.writes_base_layer:
            seeded += [chart for u in units[kind.stage] if u.index in reasons[kind.stage] for chart in u.charts]
    reasons["streets"], follow = _streets(run, plan, group, seeded)
    if run.texture.translator != "neural":
        reasons["viewpoints"] = _viewpoints(reasons["streets"], seeded, plan)
    reasons["surfaces"] = _surfaces(reasons, units["surfaces"], seeded, plan)
    totals = {stage: len(of) for stage, of in units.items()}
    totals |= {"streets": sum(map(len, outline.waves)), "viewpoints": sum(outline.viewpoints)}
    lines = [_line(totals[k.stage], k.noun, reasons[k.stage]) for k in KINDS if k.stage in reasons]
    parts = [line for line in lines if line]
    if follow:
        parts.append(f"{follow} more {'street' if follow == 1 else 'streets'} if texels that they share change")
    said = f"due are {', '.join(parts)}; the rest stands" if parts else "nothing is due but what is published"
    return Ahead(said, units)


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


def _newest(run: Run) -> StoreGroup:
    return open_root(open_repository(run.store).readonly_session(BRANCH))


def _due(records: Sequence[Record | None], units: Sequence[Unit]) -> dict[int, str]:
    """The units that are not done by any of their keys, by index, and why."""
    return {u.index: _why(records[u.index], u.keys) for u in units if not is_done(records[u.index], *u.keys)}


def _why(record: Record | None, keys: tuple[str, ...]) -> str:
    if record is None:
        return NEW
    if record["key"] in keys:
        return AGAIN
    changed = min((changed_parts(record["key"], key) for key in keys), key=len)
    return next((reason for part, reason in REASONS.items() if part in changed), REASONS["settings"])


def _bundles(reasons: Mapping[str, Mapping[int, str]], plan: Plan, block: Block) -> dict[int, str]:
    """The bundles that are due, those too of panoramas that are refined again."""
    again = reasons["poses"].keys()
    following = (number for number, bundle in enumerate(bundles(plan, block)) if again & set(bundle))
    return dict.fromkeys(following, REASONS["panoramas"]) | dict(reasons["bundles"])


def _after(
    reasons: Mapping[str, Mapping[int, str]],
    units: Mapping[str, Sequence[Unit]],
    records: Sequence[Record | None],
    plan: Plan,
    block: Block,
) -> dict[int, str]:
    """The facades that are due once panoramas and exemplars are done again, of which their keys know nothing yet."""
    facades, exemplars = reasons["facades"], reasons["exemplars"]
    poses = {*reasons["poses"], *members_of(plan, block, sorted(reasons["bundles"]))}
    sources = {unit.name for unit in units["exemplars"] if unit.index in exemplars}
    shown = [(*of.newest, *of.before) for of in panoramas_of(plan, block)] if poses else []
    found = {}
    for facade, record in enumerate(records):
        reason = facades.get(facade)
        if record is not None and exemplars and (reason in (None, REASONS["exemplar"])):
            reason = REASONS["exemplar"] if record.get("source") in sources else None
        from_panoramas = record is not None and "panoramas" in parts_of(record["key"])
        if reason is None and from_panoramas and poses and any(panorama in poses for panorama in shown[facade]):
            reason = REASONS["panoramas"]
        if reason is not None:
            found[facade] = reason
    of_house = plan.facades.house.tolist()
    houses = {of_house[facade] for facade, reason in found.items() if reason == REASONS["panoramas"]}
    for facade, record in enumerate(records):
        if record is not None and of_house[facade] in houses and "house" in parts_of(record["key"]):
            found.setdefault(facade, REASONS["house"])
    return dict(sorted(found.items()))


def _streets(run: Run, plan: Plan, group: StoreGroup, seeded: Sequence[int]) -> tuple[dict[int, str], int]:
    """The streets that are due and why, and how many more are where others change what they share; seeded: the charts that are
    seeded again."""
    records = read_journal(group, "streets")
    blends = run.texture.translator == "neural"  # of what viewpoints show; a field's texels stand on none of that
    journals = {stage: read_journal(group, stage) for stage in (*BASE_LAYER_STAGES, "viewpoints")}
    due: dict[int, str] = {}
    following: set[int] = set()
    # charts that streets of earlier waves which are due, or follow one that is, show; and those of the wave at hand
    earlier, wave = np.zeros(len(plan.ids), bool), -1
    of_wave: list[np.ndarray] = []
    for street in sorted(np.unique(plan.street_charts[:, 0]).tolist(), key=lambda s: (int(plan.wave[s]), s)):
        if plan.wave[street] != wave:
            earlier[np.concatenate([np.zeros(0, np.int64), *of_wave])] = True
            of_wave, wave = [], int(plan.wave[street])
        charts = plan.charts_of_street(street)
        key = street_keys(run, plan, group, street, journals).street
        record = records[street]
        if record is None:
            due[street] = NEW
        elif "views" in (changed := changed_parts(record["key"], key)):
            due[street] = SEEN
        elif why := next((part for part in ("settings", "code") if part in changed), None):
            due[street] = REASONS[why]
        elif blends and np.isin(charts, seeded).any():
            due[street] = READ
        elif changed:
            due[street] = FOLLOW
        elif record["status"] != "done":
            due[street] = AGAIN
        elif blends and (plan.writable[charts] & earlier[charts]).any():
            following.add(street)
        if street in due or street in following:
            of_wave.append(charts)
    return due, len(following)


def _viewpoints(streets: Mapping[int, str], seeded: Sequence[int], plan: Plan) -> dict[int, str]:
    """The viewpoints that are due as they show what is seeded again, but for those of streets that are due as a whole."""
    shown = np.unique(plan.views_of_charts(np.array(seeded, np.int64))[:, 0])
    return {int(v): READ for v in shown if plan.viewpoints[v].street not in streets}


def _surfaces(
    reasons: Mapping[str, Mapping[int, str]], units: Sequence[Unit], seeded: Sequence[int], plan: Plan
) -> dict[int, str]:
    """The surfaces that are due, those too that are once what is seeded again and the streets that are due are done."""
    again = np.zeros(len(plan.ids), bool)
    again[list(seeded)] = True
    for street in reasons["streets"]:
        charts = plan.charts_of_street(street)
        again[charts[plan.writable[charts]]] = True
    following = {unit.index: REASONS["seeds"] for unit in units if again[list(unit.arguments[0])].any()}
    return following | dict(reasons["surfaces"])


def _line(total: int, name: str, due: Mapping[int, str]) -> str | None:
    """Such as "3 of 202 facades (2: photo changed, 1: new)"; None where none is due."""
    if not due:
        return None
    reasons = Counter(due.values()).most_common()
    why = reasons[0][0] if len(reasons) == 1 else ", ".join(f"{count}: {reason}" for reason, count in reasons)
    return f"{len(due)} of {total} {name if total == 1 else name + 's'} ({why})"
