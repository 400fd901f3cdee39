"""What cities of ten thousand, a million and a hundred million facades would take, by the model: blocks as those of packaged
Helsinki, at so many texels a metre.

python -m benchmarks.city.scale [--texels 16] [--night 4]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from benchmarks.city.blocks import write_block
from benchmarks.timing import figures
from tasks.city.block_counts import NO_COUNTS
from tasks.city.blocks import partition_city_file
from tasks.city.cost import load_cost_model

SIZES = (10_000, 1_000_000, 100_000_000)


def measure(texels: float, night: float) -> dict[str, Any]:
    """By facades; night: hours in which all of it is to be done."""
    with tempfile.TemporaryDirectory() as name:
        file = write_block(Path(name) / "in", None)
        keys = yaml.safe_load(file.read_text())
        keys["texture"]["texels_per_metre"] = texels
        file.write_text(yaml.safe_dump(keys))
        blocks = partition_city_file(file, Path(name) / "out").blocks
    cost = load_cost_model()
    total = sum((block.counts.multiply(cost.counted) for block in blocks), NO_COUNTS)
    seconds, size, commits = (
        sum(asdict(total.multiply(one)).values()) for one in (cost.seconds, cost.bytes, cost.commits)
    )
    found: dict[str, Any] = {"helsinki": {name: round(value) for name, value in asdict(total).items()}}
    for facades in SIZES:
        times = facades / total.facades
        found[f"{facades:,}"] = {
            "blocks": round(len(blocks) * times),
            "processor_hours": figures(seconds * times / 3600),
            "processors_for_a_night": figures(seconds * times / 3600 / night),
            "terabytes": figures(size * times / 1e12),
            "commits": figures(commits * times),
            "commits_a_second_in_a_night": figures(commits * times / 3600 / night),
        }
    return found | {"texels_per_metre": texels, "night_hours": night, "fitted": cost.fitted}


def main() -> None:
    """Print the table as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--texels", type=float, default=16.0, help="a metre [16]")
    parser.add_argument("--night", type=float, default=4.0, help="hours [4]")
    asked = parser.parse_args()
    print(json.dumps(measure(asked.texels, asked.night), indent=1))


if __name__ == "__main__":
    main()
