"""Processor seconds of a command's processes by their role, and their memory; the environment of a command that is measured."""

from __future__ import annotations

import os

import psutil

ROLES = ("coordinator", "server", "workers")


def user_environment() -> dict[str, str]:
    """Return the environment of a user's command: without settings of a Prefect server, and with modules kept compiled."""
    return {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PREFECT_") and name != "PYTHONDONTWRITEBYTECODE"
    }


def add_used(root: psutil.Process, used: dict[int, tuple[str, float]]) -> None:
    """Update the role and the processor seconds of a process and its descendants, by process id.

    Entries of processes that have ended stay as they are.
    """
    try:
        family = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return
    for process in family:
        try:
            times = process.cpu_times()
            role = used[process.pid][0] if process.pid in used else process_role(process, root)
        except psutil.Error:
            continue
        used[process.pid] = (role, times.user + times.system)


def process_role(process: psutil.Process, root: psutil.Process) -> str:
    """Return the role of a process below the command's root process."""
    if process.pid == root.pid:
        return "coordinator"
    return "workers" if "multiprocessing" in " ".join(process.cmdline()) else "server"


def measure_family_mb(pid: int) -> float:
    """Measure the memory of a process and its descendants, MB; shared pages count once where the system tells them."""
    total = 0.0
    try:
        family = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0.0
    for process in family:
        try:
            memory = process.memory_full_info()
            total += getattr(memory, "pss", memory.rss)
        except psutil.Error:
            continue
    return total / 1e6
