"""Which facades lie partly in the shadow of what stands opposite: `python -m benchmarks.shadows --data DIR` prints JSON.

MARKED are the photos of ecp, of its 83, whose wall is partly in the sun and partly in a large shadow, marked by eye on
thumbnails. The labels are the parser's own, so the photos that it learnt from are seen better than others would be; nothing is
learnt from the marks, but the threshold `SHADED` was chosen with all of them in view.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from facade_core.facade.exemplar_quality import USUAL_SHADED_SHARE
from facade_core.imagery.rectify.shadow import shadow_share
from facade_core.parsing.segmenter import parse
from training.datasets.facades import ECP, read_dataset

MARKED = frozenset(
    {
        "13",
        "17",
        "19",
        "21",
        "24",
        "25",
        "26",
        "27",
        "29",
        "29bis",
        "3",
        "33",
        "35",
        "39",
        "43",
        "53",
        "55",
        "59",
        "69",
        "7",
    }
)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Count the facades in partial shadow that are told to be.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/ecp",
    )
    options = parser.parse_args(arguments)
    told = {
        photo.name.removeprefix("monge_"): shadow_share(photo.image, parse(photo.image).labels)
        for photo in read_dataset(ECP, options.data / "facades" / "ecp")
    }
    over = {name for name, share in told.items() if share > USUAL_SHADED_SHARE}
    print(
        json.dumps(
            {
                "benchmark": "shadows",
                "photos": len(told),
                "marked": len(MARKED),
                "unmarked": len(told) - len(MARKED),
                "told": len(over),
                "both": len(over & MARKED),
                "missed": sorted(MARKED - over),
                "false": sorted(over - MARKED),
            }
        )
    )


if __name__ == "__main__":
    main()
