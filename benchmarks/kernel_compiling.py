"""Processor seconds of compiling numba kernels on a first run: `python -m benchmarks.kernel_compiling`.

Runs the parts of `facade_core.kernel_warmup` with an empty cache. A kernel's seconds exclude those of kernels that its
types ask for, and include the machine code of what it calls: numba optimises all that a kernel calls again with it.
`outside` sums numba's own functions, such as `np.zeros` of a new type, which the list names too.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections import defaultdict
from typing import Any

from benchmarks.timing import once

PACKAGE = "facade_core."


def main() -> None:
    """Compile the kernels and print the seconds of the slowest."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--worst", type=int, default=20, help="number of kernels listed (20)")
    parser.add_argument("--part", action="append", help="a part of the warm-up, such as compile_layout_kernels (all)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder  # numba reads it when it is imported, by the modules below too
        print(json.dumps(measure_compilation(options.worst, options.part), indent=1))


def measure_compilation(worst: int, names: list[str] | None) -> dict[str, Any]:
    """Measure the compilation of kernels by parts of the warm-up, all where `names` is None."""
    from tasks.engine.compute.worker_setup import limit_threads

    limit_threads()
    from numba.core import event

    from facade_core.kernel_warmup import WARMUPS
    from tasks.engine.compute.kernel_compilation import collect_garbage_rarely

    class CompileTimes(event.Listener):
        """Processor seconds by kernel, without those of kernels compiled meanwhile."""

        def __init__(self) -> None:
            self.seconds: dict[str, list[float]] = defaultdict(list)
            self._started: list[float] = []
            self._inner: list[float] = [0.0]

        def on_start(self, event: Any) -> None:
            self._started.append(time.process_time())
            self._inner.append(0.0)

        def on_end(self, event: Any) -> None:
            seconds = time.process_time() - self._started.pop()
            function = event.data["dispatcher"].py_func
            self.seconds[f"{function.__module__}.{function.__qualname__}"].append(seconds - self._inner.pop())
            self._inner[-1] += seconds

    times = CompileTimes()
    with event.install_listener("numba:compile", times), collect_garbage_rarely():
        parts = {
            part.__name__: round(once(part, clock=time.process_time), 1)
            for part in WARMUPS
            if names is None or part.__name__ in names
        }
    kernels = {name: of for name, of in times.seconds.items() if name.startswith(PACKAGE)}
    slowest = sorted(times.seconds, key=lambda name: -sum(times.seconds[name]))
    return {
        "benchmark": "kernel_compiling",
        "parts": parts,
        "kernels": len(kernels),
        "signatures": sum(map(len, kernels.values())),
        "seconds": round(sum(map(sum, times.seconds.values())), 1),
        "outside": round(sum(sum(of) for name, of in times.seconds.items() if name not in kernels), 1),
        "worst": {
            name.removeprefix(PACKAGE): {
                "signatures": len(times.seconds[name]),
                "seconds": round(sum(times.seconds[name]), 2),
            }
            for name in slowest[:worst]
        },
    }


if __name__ == "__main__":
    main()
