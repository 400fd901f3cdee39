"""Compare the digests of a run's results under the kernels that OpenBLAS, numpy and OpenCV choose for several processors.

Settings that this processor cannot run are left out. A run takes minutes; `--workers 4` computes units side by side.

    python -m benchmarks.processors
    python -m benchmarks.processors --case photos --settings unset,Nehalem
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.same_bytes import CASES, ROOT
from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import BRANCH, open_repository, open_root
from tasks.stages.facades.record import FacadeRecord
from tests.pipeline.runs import environment

# Environment of each setting, and the flag of the processor that it needs.
SETTINGS: dict[str, tuple[dict[str, str], str]] = {
    "unset": ({}, ""),
    "Haswell": ({"OPENBLAS_CORETYPE": "Haswell"}, "avx2"),
    "SkylakeX": ({"OPENBLAS_CORETYPE": "SkylakeX"}, "avx512dq"),
    "Zen": ({"OPENBLAS_CORETYPE": "Zen"}, "avx2"),
    "Sandybridge": ({"OPENBLAS_CORETYPE": "Sandybridge"}, "avx"),
    "Nehalem": ({"OPENBLAS_CORETYPE": "Nehalem"}, "sse4_2"),
    "numpy without AVX2": ({"NPY_DISABLE_CPU_FEATURES": "X86_V3"}, "avx2"),
    "numpy without AVX-512": ({"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"}, "avx512dq"),
    "4 threads": ({"OPENBLAS_NUM_THREADS": "4", "OMP_NUM_THREADS": "4"}, ""),
}


def measure(case: str, settings: tuple[str, ...], workers: int) -> dict[str, dict[str, str]]:
    """Run a case once for each setting.

    Parameters
    ----------
    case : one of `benchmarks.same_bytes.CASES`.
    settings : names of SETTINGS.
    workers : processes of each run.

    Returns
    -------
    By setting: digests of the atlas and of all hierarchy files, and how many of these differ from the first setting's.
    """
    found: dict[str, dict[str, str]] = {}
    first: list[str] = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        inputs = CASES[case].write(folder / "input")
        for setting in settings:
            out = folder / setting.replace(" ", "-")
            done = subprocess.run(
                [sys.executable, "-m", "flows", "run", str(inputs), "--out", out, "--json", "--workers", str(workers)],
                cwd=ROOT,
                env=environment(folder) | SETTINGS[setting][0],
                capture_output=True,
                text=True,
            )
            if done.returncode:
                raise SystemExit(f"{setting}: {done.stderr[-2000:]}")
            group = open_root(open_repository(out / "store").readonly_session(BRANCH))
            records = read_journal(group, "facades", FacadeRecord)
            files = [str(record.get("variation_digest")) if record else "" for record in records]
            first = first or files
            found[setting] = {
                "atlas": json.loads(done.stdout.strip().splitlines()[-1])["atlas_digest"][:16],
                "hierarchies": hashlib.sha256("".join(files).encode()).hexdigest()[:16],
                "other_hierarchies": str(sum(one != other for one, other in zip(files, first, strict=True))),
            }
    return found


def main() -> None:
    """Print a table of digests; the exit code is 1 if they differ."""
    flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    runnable = [name for name, (_, flag) in SETTINGS.items() if not flag or flag in flags]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", default="demo", choices=CASES, help="inputs (%(default)s)")
    parser.add_argument("--settings", default=",".join(runnable), help="names, with commas between (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes of each run (%(default)s)")
    options = parser.parse_args()
    chosen = tuple(options.settings.split(","))
    if unknown := set(chosen) - set(runnable):
        parser.error(f"--settings: {', '.join(sorted(unknown))} cannot run here; there is {', '.join(runnable)}")
    found = measure(options.case, chosen, options.workers)
    for setting, digests in found.items():
        print(f"{setting:24}", *(f"{name} {digest}" for name, digest in digests.items()))
    sys.exit(len({tuple(digests.values()) for digests in found.values()}) > 1)


if __name__ == "__main__":
    main()
