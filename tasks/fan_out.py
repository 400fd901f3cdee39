"""Units of a stage fanned out to workers, each committed with its journal records as it completes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from tasks.commits import begin, finish
from tasks.compute import Compute
from tasks.outcome import Outcome, failure
from tasks.progress import advance
from tasks.run import Run


@dataclass(frozen=True)
class Work:
    """What one worker does in one go: (name, key) of the units by index, and the arguments of the function that does them."""

    units: Mapping[int, tuple[str, str]]
    arguments: tuple


def fan_out(run: Run, stage: str, function: Callable[..., Any], work: Iterable[Work], compute: Compute) -> Outcome:
    """Call function(run, fork, *arguments) for every piece of work; it returns the fork and its units' records.

    What raises as a whole leaves a failed record for each of its units, and nothing else.
    """
    started: dict[Any, tuple[Work, Any]] = {}
    for piece in work:
        session, fork = begin(run.store)
        started[compute.submit(function, run, fork, *piece.arguments)] = (piece, session)
    outcome = Outcome()
    for future in compute.completed(started):
        piece, session = started[future]
        try:
            fork, records = future.result()
        except Exception as error:
            session, fork = begin(run.store)
            records = {index: failure(name, key, error) for index, (name, key) in piece.units.items()}
        finish(session, fork, stage, records, f"{stage} {', '.join(name for name, _ in piece.units.values())}")
        made = Outcome().add(records.values())
        advance(stage, made.finished, len(made.failed))
        outcome += made
    return outcome
