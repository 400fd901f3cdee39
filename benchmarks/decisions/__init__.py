"""The measurements that carry the decisions in deploy/adr/, re-run: `streetloom bench decisions [NAME ...]`.

One module per decision, each with `measure(quick, data)`. Every decision is measured in a process of its own, so that imports,
threads and memory of one do not colour another. Ratios travel between machines; absolute times do not.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

# name -> the record that the measurement carries
DECISIONS = {
    "dispatch": "0001-prefect-orders-dask-computes",
    "killed": "0002-one-commit-per-unit",
    "ownership": "0003-chunks-have-one-owner",
    "commits": "0004-panoramas-are-the-truth",
    "nodes": "0005-facade-maps-share-the-atlas",
    "unseen": "0006-unseen-texels-are-filled-when-published",
    "setup": "0009-setup",
    "weights": "0010-eq-1",
    "runtime": "0014-runtime-without-torch",
    "texels": "0015-affine-texels",
    "rays": "0016-rays-and-rectangles",
    "catalogue": "0017-parquet-and-duckdb",
    "determinism": "0018-same-input-same-bits",
    "ranks": "0019-who-wins-on-a-texel",
    "publishing": "0020-published-by-snapshot",
    "manifests": "0045-what-a-city-costs",
    "bucket": "0071-a-run-lives-in-a-bucket",
}


def main(arguments: list[str] | None = None) -> None:
    """Measure the named decisions, or all, and print one JSON object."""
    parser = argparse.ArgumentParser(description=main.__doc__, epilog=f"decisions: {', '.join(DECISIONS)}")
    parser.add_argument("names", nargs="*", metavar="NAME", help="decisions to measure [all]")
    parser.add_argument("--data", type=Path, help="the data folder, for the real city of `rays`")
    parser.add_argument("--quick", action="store_true", help="toy sizes: shows that it runs, not what it costs")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.names if name not in DECISIONS]:
        parser.error(f"no decision {unknown[0]}; there is {', '.join(DECISIONS)}")
    extra = [*(["--quick"] if options.quick else []), *(["--data", str(options.data)] if options.data else [])]
    figures = {name: _apart(name, extra) for name in options.names or DECISIONS}
    print(json.dumps({"benchmark": "decisions", "quick": options.quick, "decisions": figures}, indent=1))


def _apart(name: str, extra: list[str]) -> dict:
    command = [sys.executable, "-m", "benchmarks.decisions.one", name, *extra]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"decision {name} could not be measured; its error is above")
    return json.loads(done.stdout)
