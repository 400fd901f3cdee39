"""One decision, measured in this process: what `benchmarks.decisions` runs for each."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import time
from pathlib import Path

from benchmarks.decisions import DECISIONS


def main() -> None:
    """Measure one decision and print its figures with what else the machine was doing."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("name", choices=DECISIONS)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    before, start = os.getloadavg()[0], time.perf_counter()
    figures = importlib.import_module(f"benchmarks.decisions.{options.name}").measure(options.quick, options.data)
    machine = {
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "load_before": round(before, 2),
        "load_after": round(os.getloadavg()[0], 2),
        "seconds": round(time.perf_counter() - start, 1),
    }
    print(json.dumps({"record": DECISIONS[options.name], "machine": machine} | figures))


if __name__ == "__main__":
    main()
