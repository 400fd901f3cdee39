"""The model by which `streetloom plan` estimates a city: fitted on blocks of several sizes and densities, checked on one that
it was not fitted on. Seconds are those of the processor, so other work on the machine does not count.

    python -m benchmarks.city.cost [--blocks 1x1@3 3x1@3 1x1@8 1x1@3/4.5] [--check 2x1@5 3x3@4] [--write]

A block is so many tiles of a town (`benchmarks.city.reading`) at so many texels a metre, and viewpoints so far apart (9 m). Its
stages are run one after the other in this process, after one that compiles; what the command takes beside, for starting and
ending, is measured on the first.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.city.reading import write_town
from benchmarks.decisions.timing import bytes_in, figures
from catalogs.block import read_block
from facade_core.atlas.store import BRANCH, open_repository
from tasks.city.account import Ended
from tasks.city.cost import COEFFICIENTS, WHAT, Cost, cost_of
from tasks.city.counting import NOTHING, Counts, counts_of
from tasks.city.running import run_block
from tasks.stages.publish import publish_block
from tasks.store.commits import journal
from tests.pipeline.stages import texture

# What a block's seconds, bytes and commits are laid to, by least squares that are not negative: few enough for few blocks.
OF = {
    "seconds": ("facades", "viewpoints", "megatexels", "blocks"),
    "bytes": ("facades", "viewpoints", "megatexels", "blocks"),
    "commits": ("facades", "viewpoints", "blocks"),
}


@dataclass(frozen=True)
class Ran:
    """A block that was run: its name, texels a metre; what its map told, what it had; seconds, bytes, commits."""

    name: str
    density: float
    told: Counts
    had: Counts
    seconds: float
    bytes: float
    commits: float


def run(folder: Path, name: str) -> Ran:
    """Run a block, such as 3x1@8: tiles along and across, texels a metre."""
    density = _written(folder, name)
    told = counts_of(read_block(folder / "block.yaml"))
    begun = time.process_time()
    done = texture(folder / "block.yaml", folder / "out").run
    repository = open_repository(done.store)
    commits = len(list(repository.ancestry(branch=BRANCH))) - 1
    publish_block.fn(done, folder / "block.yaml")
    seconds = time.process_time() - begun

    def count(stage: str, start: str = "") -> int:
        return sum(record is not None and record["unit"].startswith(start) for record in journal(done.store, stage))

    had = Counts(
        count("facades"), count("viewpoints"), count("surfaces", "ground-"), count("exemplars"), told.megatexels
    )
    return Ran(name, density, told, had, seconds, float(bytes_in(folder / "out")), float(commits))


def _written(folder: Path, name: str) -> float:
    """Write a block by its name; says its texels a metre."""
    found = re.fullmatch(r"(\d+)x(\d+)@([\d.]+)(?:/([\d.]+))?", name)
    if found is None:
        raise SystemExit(f"{name}: is no block; write it such as 3x1@8 or 1x1@3/4.5")
    columns, rows, density, spacing = found.groups()
    write_town(folder, int(columns), int(rows), texels=float(density), spacing=float(spacing or 9))
    return float(density)


def starting(folder: Path, name: str, units: float) -> float:
    """What the command takes of a block beside its units, its 3D Tiles included, seconds of the processor."""
    _written(folder, name)
    options = ["--workers", "1"]
    ended = run_block.fn(folder, "one", folder / "block.yaml", options, Ended(), "", "", None, tiles=True)
    if ended.code:
        raise SystemExit(f"{name}: {ended.reason}")
    return max(0.0, ended.processor - units)


def fit(blocks: Sequence[Ran], start: float, machine: str = "") -> Cost:
    """The model of some blocks, run on a machine of these words."""
    told, had = (sum((getattr(block, name) for block in blocks), NOTHING) for name in ("told", "had"))
    each = {name: getattr(had, name) / max(getattr(told, name), 1e-9) for name in WHAT}
    parts = {what: _laid(blocks, what, names) for what, names in OF.items()}
    parts["seconds"]["blocks"] = figures(parts["seconds"]["blocks"] + start)
    return cost_of(
        {
            "fitted": {
                "on": datetime.now(UTC).strftime("%Y-%m-%d"),
                "machine": machine,
                "blocks": len(blocks),
                "facades": int(had.facades),
                "texels_per_metre": sorted({block.density for block in blocks}),
            },
            "counted": {name: figures(value) for name, value in each.items()},
            **parts,
        }
    )


def _laid(blocks: Sequence[Ran], what: str, names: Sequence[str]) -> dict[str, float]:
    """Least squares of shares: a block that is off by a tenth counts the same whatever its size."""
    from scipy.optimize import nnls

    took = np.array([getattr(block, what) for block in blocks])
    columns = np.array([[getattr(block.had, name) for name in names] for block in blocks])
    found, _ = nnls(columns / took[:, None], np.ones(len(blocks)))
    return dict.fromkeys(WHAT, 0.0) | {name: figures(one) for name, one in zip(names, found.tolist(), strict=True)}


def checked(cost: Cost, blocks: Sequence[Ran], start: float) -> dict[str, Any]:
    """What the model says of the units of blocks that were run, beside what they took."""
    said = sum((block.told.times(cost.counted) for block in blocks), NOTHING)
    pairs = {name: (getattr(said, name), sum(getattr(b.had, name) for b in blocks)) for name in WHAT[:3]}
    for what in OF:
        beside = start * len(blocks) if what == "seconds" else 0.0
        spent = sum(asdict(said.times(getattr(cost, what))).values()) - beside
        pairs[what] = spent, sum(getattr(block, what) for block in blocks)
    return {
        name: {"said": figures(one), "took": figures(took), "of_it": figures(one / took)}
        for name, (one, took) in pairs.items()
    }


def main() -> None:
    """Run the blocks, fit the model, check it, print all of that as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--blocks", nargs="+", default=["1x1@3", "3x1@3", "1x1@8", "1x1@3/4.5"], help="to fit on")
    parser.add_argument("--check", nargs="*", default=["2x1@5", "3x3@4"], help="to check on")
    machine = f"{os.cpu_count()} cores, {platform.machine()}"
    parser.add_argument("--machine", default=machine, help=f"on which they are run, in words [{machine}]")
    parser.add_argument("--write", action="store_true", help="keep the model in the project")
    asked = parser.parse_args()
    ran: dict[str, Ran] = {}
    with tempfile.TemporaryDirectory() as name:
        run(Path(name) / "compiles", asked.blocks[0])
        for number, block in enumerate((*asked.blocks, *asked.check)):
            ran[block] = run(Path(name) / str(number), block)
            print(json.dumps(asdict(ran[block])), flush=True)
        start = starting(Path(name) / "command", asked.blocks[0], ran[asked.blocks[0]].seconds)
    fitted_on = [ran[block] for block in asked.blocks]
    cost = fit(fitted_on, figures(start), asked.machine)
    result = {"model": asdict(cost), "fitted_on_itself": checked(cost, fitted_on, start)}
    held = {block: checked(cost, [ran[block]], start) for block in asked.check}
    print(json.dumps(result | {"check": held}, indent=1))
    if asked.write:
        COEFFICIENTS.write_text(json.dumps(asdict(cost), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
