"""How long schedulers, workers and units are waited for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Timeouts:
    """All in seconds, those of a run under way by the time in which its process was awake.

    Args:
        greeting: in which a scheduler at an address must answer at first.
        arrival: in which it must show a worker: those may be on their way.
        look: between two looks at the scheduler.
        answer: for it to answer one.
        silence: without an answer until it is given up.
        empty: that a cluster may be without any worker; one that is started anew, by its nanny or by a scaler, needs some.
        worker_silence: without a sign of a worker, or with one that takes no units, until it is left out.
        worker_start: likewise of one that has just joined and imports what units need, of which nothing is heard meanwhile.
        unit_least: that a unit may take at least, however short the others of its stage were.
        unit_first: that a unit may take before it is known what others take.
    """

    connect: float = 8.0
    first_worker: float = 30.0
    poll_interval: float = 2.0
    answer: float = 30.0
    silence: float = 300.0
    empty: float = 120.0
    worker_silence: float = 30.0
    worker_start: float = 120.0
    unit_least: float = 600.0
    unit_first: float = 3600.0


DEFAULT_TIMEOUTS = Timeouts()
