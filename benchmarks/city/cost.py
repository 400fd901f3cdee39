"""The model by which `streetloom plan` estimates a city: fitted on runs of cities, checked on one that it was not fitted on.

    streetloom city a.yaml --out out/a; streetloom city b.yaml --out out/b
    python -m benchmarks.city.cost out/a --check out/b [--write]

What a facade, a viewpoint, a piece of ground, an exemplar takes is the mean over the records of units (of a viewpoint
the rays of the ingest too); of the clock, how much slower than that a block is, and what it takes beside, are a least-squares
fit over blocks. So are bytes. Only blocks that were done in one go count. `--write` keeps the model in the project.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.decisions.timing import bytes_in, figures
from catalogs.block import read_block
from tasks.city.account import BLOCKS, read_account
from tasks.city.cost import COEFFICIENTS, WHAT, Cost, cost_of
from tasks.city.counting import NOTHING, Counts, counts_of
from tasks.kinds.order import KINDS
from tasks.store.commits import journal
from tasks.store.standing import recorded_source

# Whose seconds are whose; surfaces are the facades' but for those of the ground.
OF = {
    "facades": "facades",
    "textures": "facades",
    "poses": "facades",
    "surfaces": "facades",
    "pages": "facades",
    "tiles": "facades",
    "pictures": "facades",
    "viewpoints": "viewpoints",
    "streets": "viewpoints",
    "ingest": "viewpoints",
    "exemplars": "exemplars",
}
# Viewpoints that begin within a second are one commit; pictures are made eight together.
COMMIT_S, TOGETHER = 1.0, 8


@dataclass(frozen=True)
class Block:
    """A block that was run: what its map told, what it had; seconds of workers and commits, by what they were of; bytes;
    seconds of the clock; texels a metre."""

    told: Counts
    had: Counts
    spent: Counts
    commits: Counts
    bytes: int
    seconds: float
    density: float


def blocks_of(out: Path) -> list[Block]:
    """The blocks of a city that were done in one go."""
    found = []
    for name, ended in read_account(out).blocks.items():
        folder = out / BLOCKS / name
        source = recorded_source(folder)
        if ended.code == 0 and source is not None and len(list((folder / "logs").glob("*.jsonl"))) == 1:
            found.append(_block(folder, source, ended.seconds))
    return found


def _block(folder: Path, source: Path, seconds: float) -> Block:
    units = [(kind.stage, r) for kind in KINDS for r in journal(folder / "store", kind.stage) if r and "seconds" in r]
    spent, commits = dict.fromkeys(WHAT, 0.0), dict.fromkeys(WHAT, 0.0) | {"blocks": 3.0}  # ingest, streets, publishing
    ended: dict[str, float] = {}
    for stage, record in units:
        ground = stage == "surfaces" and record["unit"].startswith("ground-")
        of = "ground" if ground else OF[stage]
        spent[of] += sum(record["seconds"].values())
        if stage == "viewpoints":
            street = record["unit"].rpartition("/")[0]
            if record["started"] - ended.get(street, -np.inf) < COMMIT_S:
                continue
            ended[street] = record["started"]
        commits[of] += 1 / TOGETHER if stage == "pictures" else 1
    for said in map(json.loads, next((folder / "logs").glob("*.jsonl")).read_text("utf-8").splitlines()):
        if said.get("stage") == "ingest" and "worker" in said:
            spent[OF["ingest"]] += sum(said["seconds"].values())
    count = {stage: sum(one == stage for one, _ in units) for stage, _ in units}
    pieces = sum(stage == "surfaces" and r["unit"].startswith("ground-") for stage, r in units)
    had = Counts(count.get("facades", 0), count.get("viewpoints", 0), pieces, count.get("exemplars", 0))
    block = read_block(source)
    size, density = bytes_in(folder), block.texture.texels_per_metre
    return Block(counts_of(block), had, Counts(**spent), Counts(**commits), size, seconds, density)


def fit(blocks: Sequence[Block], workers: int, machine: str = "") -> Cost:
    """The model of some blocks, run on a machine of these words."""
    from scipy.optimize import nnls

    told, had, spent, commits = (
        sum((getattr(block, name) for block in blocks), NOTHING) for name in ("told", "had", "spent", "commits")
    )

    def each(total: Counts, by: Counts) -> dict[str, float]:
        return {name: getattr(total, name) / max(getattr(by, name), 1.0) for name in WHAT}

    seconds = each(spent, had)
    workers_s = np.array([sum(asdict(block.spent).values()) for block in blocks])
    clock = np.column_stack([workers_s / workers, np.ones(len(blocks))])
    (slower, fixed), _ = nnls(clock, np.array([block.seconds for block in blocks]))
    columns = np.array([[getattr(block.had, name) for name in WHAT] for block in blocks])
    kept, _ = nnls(columns, np.array([float(block.bytes) for block in blocks]))
    return cost_of(
        {
            "fitted": {
                "on": datetime.now(UTC).strftime("%Y-%m-%d"),
                "machine": machine,
                "blocks": len(blocks),
                "facades": int(had.facades),
                "texels_per_metre": sorted({block.density for block in blocks}),
            },
            "counted": _rounded(each(had, told) | {"blocks": 1.0}),
            "seconds": _rounded(seconds | {"blocks": float(fixed)}),
            "bytes": _rounded(dict(zip(WHAT, kept.tolist(), strict=True))),
            "commits": _rounded(each(commits, had)),
            "slower": figures(float(slower)),
        }
    )


def _rounded(values: Mapping[str, float]) -> dict[str, float]:
    return {name: figures(value) for name, value in values.items()}


def checked(cost: Cost, blocks: Sequence[Block], workers: int) -> dict[str, Any]:
    """What the model says of blocks that were run, beside what they took."""
    said = cost.estimate([block.told for block in blocks], workers)
    took = {
        "facades": sum(block.had.facades for block in blocks),
        "viewpoints": sum(block.had.viewpoints for block in blocks),
        "ground": sum(block.had.ground for block in blocks),
        "hours": sum(block.seconds for block in blocks) / 3600,
        "gigabytes": sum(block.bytes for block in blocks) / 1e9,
        "commits": sum(sum(asdict(block.commits).values()) for block in blocks),
    }
    return {
        name: {"said": said[name], "took": figures(value), "of_it": figures(said[name] / value)}
        for name, value in took.items()
    }


def main() -> None:
    """Fit the model, check it, print both as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("cities", nargs="+", type=Path, metavar="OUT", help="cities that were run, to fit on")
    parser.add_argument("--check", type=Path, metavar="OUT", help="one that was run, to check on")
    parser.add_argument("--workers", type=int, default=2, help="by which they were run [2]")
    machine = f"{os.cpu_count()} cores, {platform.machine()}"
    parser.add_argument("--machine", default=machine, help=f"on which they were run, in words [{machine}]")
    parser.add_argument("--write", action="store_true", help="keep the model in the project")
    asked = parser.parse_args()
    blocks = [block for out in asked.cities for block in blocks_of(out)]
    if not blocks:
        raise SystemExit("no block of these cities was done in one go")
    cost = fit(blocks, asked.workers, asked.machine)
    held = blocks_of(asked.check) if asked.check else []
    result = asdict(cost) | {"fitted_on_itself": checked(cost, blocks, asked.workers)}
    print(json.dumps(result | ({"check": checked(cost, held, asked.workers)} if held else {}), indent=1))
    if asked.write:
        COEFFICIENTS.write_text(json.dumps(asdict(cost), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
