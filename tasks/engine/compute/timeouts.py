"""Timeouts of schedulers, workers and units."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Timeouts:
    """Timeouts in seconds; those of a running run count only time in which the process was awake.

    Attributes
    ----------
    connect : first answer of a scheduler.
    first_worker : first worker of a scheduler.
    poll_interval : time between two polls.
    answer : answer to a poll.
    silence : no answer until the scheduler is given up.
    empty : no worker until the run ends; a restarted worker needs some time.
    worker_silence : no heartbeat of a worker, or a paused worker, until it is left out.
    worker_start : the same for a new worker, which imports modules without heartbeats.
    unit_least : shortest limit of a unit.
    unit_first : limit of a unit before durations of others are known.
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
