"""Disk space: the need of a block, checked before anything is written, and the reserve that must stay free."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from facade_core.core.errors import MachineError
from facade_core.plan.plan import Plan

# Free at every stage: the run's own server, its log, and commits that are being made.
RESERVED_BYTES = 50_000_000
# What the smallest blocks and the demo took, in bytes: a texel of every array of the atlas in the store, compressed; and a
# texel of the pages, the model and the report as published. Pictures of real walls take more: what this refuses could not have
# ended well.
STORE_TEXEL, PUBLISHED_TEXEL = 2.0, 1.5


def required_block_bytes(plan: Plan, *, stored: bool = True) -> int:
    """Estimate the least bytes of a block, published and, unless in a bucket, in its store."""
    texels = int(plan.texel_counts().sum())
    return int(texels * (PUBLISHED_TEXEL + STORE_TEXEL * stored))


def free_bytes(folder: Path) -> int:
    """Return the free bytes of a folder's disk."""
    return shutil.disk_usage(folder).free


def require_disk_space(folder: Path, needed: int = 0, free_bytes: Callable[[Path], int] = free_bytes) -> None:
    """Check that the disk of `folder` has room for `needed` bytes, minus its present store, and the reserve.

    Raises
    ------
    MachineError : there is less.
    """
    free = free_bytes(folder)
    if free >= needed + RESERVED_BYTES:  # what lies in the store already need not be counted, of very many files
        return
    stored = sum(path.stat().st_size for path in (folder / "store").rglob("*") if path.is_file()) if needed else 0
    needed = max(0, needed - stored) + RESERVED_BYTES
    if free < needed:
        raise MachineError(
            f"{folder}: needs about {needed / 1e6:,.0f} MB of space and its disk has {free / 1e6:,.0f} MB free; "
            "free some space, or name a folder on another disk with --out, and run again: finished work is kept"
        )
