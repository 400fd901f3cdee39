"""0014: what the network runtime costs to load, and that nothing of torch is loaded with it."""

from __future__ import annotations

import importlib.util
import json
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.timing import bytes_in, figures

# Run in a fresh interpreter: seconds and megabytes of resident memory that a statement adds.
_COST = """
import json, psutil, sys, time
memory = psutil.Process().memory_info
before, start = memory().rss, time.perf_counter()
{statement}
print(json.dumps([time.perf_counter() - start, (memory().rss - before) / 1e6, "torch" in sys.modules]))
"""
_STATEMENTS = {
    "import_onnxruntime": "import onnxruntime",
    "load_shipped_parser": "from facade_core.parsing.forest import load; load()",
    "parse_a_facade": (
        "import numpy as np; from facade_core.parse import parse; "
        "parse(np.random.default_rng(0).integers(0, 256, (400, 300, 3), dtype=np.uint8))"
    ),
}


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Seconds and memory of loading onnxruntime and the shipped parser, next to torch where that is installed."""
    repeats = 1 if quick else 5
    costs = {name: _cost(statement, repeats) for name, statement in _STATEMENTS.items()}
    here = importlib.util.find_spec("torch") is not None
    return {
        **costs,
        "torch_loaded_by_parse": costs["parse_a_facade"].pop("torch"),
        "import_torch": _cost("import torch", repeats) if here else "absent",
        "installed_mb": {name: _installed_mb(name) for name in ("onnxruntime", *(["torch"] if here else []))},
    }


def _cost(statement: str, repeats: int) -> dict[str, Any]:
    command = [sys.executable, "-c", _COST.format(statement=statement)]
    runs = [json.loads(subprocess.run(command, check=True, capture_output=True).stdout) for _ in range(repeats + 1)]
    seconds, megabytes, torch = zip(*runs[1:], strict=True)  # the first fills the page cache
    return {
        "seconds": figures(statistics.median(seconds)),
        "memory_mb": figures(statistics.median(megabytes)),
        "torch": any(torch),
    }


def _installed_mb(package: str) -> float:
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    return figures(bytes_in(Path(spec.origin).parent) / 1e6)
