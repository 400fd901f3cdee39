"""Generated blocks in drawn formats, against their truth: `python -m benchmarks.generated_inputs` prints JSON.

Each case is a block of five to eight buildings, drawn by the seed and its number: a format, a frame, a way to state heights,
ids, names, streets, and for some panoramas, photos and one break. A process with bounds of time and memory reads it; one in ten
is planned too.

- right: heights within 2 %, places within 0.5 m; ids, names and counts as in the truth.
- noted: a difference that a note speaks of.
- set aside: units listed with a reason.
- refused: one line with the file and a remedy.
- silent: a difference that nothing speaks of.

A case is made again by `--seed N --only NUMBER --keep FOLDER`.
"""

from __future__ import annotations

import argparse
import json
import select
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import psutil

from benchmarks.generated_inputs.cases import write_case
from benchmarks.generated_inputs.judge import FAULTY, OUTCOMES, judge

MAX_SECONDS = 60.0
MAX_BYTES = 3 * 2**30
_STEP_S = 0.05
_START_SECONDS = 120.0  # of a process that compiles kernels


class Reader:
    """Process that reads cases; it is started again after one that ended it.

    Attributes
    ----------
    peak : most memory that any of them held, bytes.
    """

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None
        self.is_new = True
        self.peak = 0

    def ask(self, path: Path, *, with_plan: bool) -> dict[str, Any]:
        """Return the answer to one block file; of a process that had to be ended the reason."""
        if self.process is None:
            command = [sys.executable, "-m", "benchmarks.generated_inputs.child"]
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
            self.is_new = True
        process = self.process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps({"path": str(path), "plan": with_plan}) + "\n")
        process.stdin.flush()
        watched = psutil.Process(process.pid)
        end = time.monotonic() + MAX_SECONDS + (_START_SECONDS if self.is_new or with_plan else 0.0)
        result = "hang"
        while time.monotonic() < end:
            if select.select([process.stdout], [], [], _STEP_S)[0]:
                line = process.stdout.readline()
                if line:
                    self.is_new = False
                    answer: dict[str, Any] = json.loads(line)
                    return answer
                result = "killed"
                break
            try:
                self.peak = max(self.peak, watched.memory_info().rss)
            except psutil.Error:
                result = "killed"
                break
            if self.peak > MAX_BYTES:
                result = "over 3 GB"
                break
        self.close()
        return {"result": result, "message": f"exit {process.returncode}", "warnings": []}

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


def measure(seed: int, numbers: list[int], folder: Path) -> dict[str, Any]:
    """Read the cases of these numbers; the folder receives them."""
    reader = Reader()
    outcomes: Counter[str] = Counter()
    by_format: dict[str, Counter[str]] = defaultdict(Counter)
    cases, slowest = [], 0.0
    sound = Counter[str]()
    try:
        for number in numbers:
            case = write_case(seed, number, folder / f"{seed}-{number}")
            start = time.monotonic()
            answer = reader.ask(folder / f"{seed}-{number}" / "block.yaml", with_plan=case.plan)
            if not case.plan:
                slowest = max(slowest, time.monotonic() - start)
            outcome, why = judge(case, answer)
            outcomes[outcome] += 1
            by_format[case.made["format"]][outcome] += 1
            sound[outcome] += case.sound
            cases.append({"case": f"{seed}-{number}", "outcome": outcome, "why": why, "made": case.made, "sound": case.sound,
                          "notes": answer.get("notes", []), "faults": answer.get("faults", [])})  # fmt: skip
    finally:
        reader.close()
    return {
        "benchmark": "generated_inputs",
        "seed": seed,
        "cases": len(numbers),
        "outcomes": {outcome: outcomes[outcome] for outcome in OUTCOMES},
        "of_sound_inputs": {outcome: sound[outcome] for outcome in OUTCOMES if sound[outcome]},
        "by_format": {name: dict(found) for name, found in sorted(by_format.items())},
        "slowest_s": round(slowest, 2),
        "peak_mb": round(reader.peak / 1e6),
        "to_mend": [one for one in cases if one["outcome"] in FAULTY],
        "all": cases,
    }


def main() -> None:
    """Draw blocks in every format and convention, read each, and count how they are taken; prints one JSON object."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--count", type=int, default=300, help="number of cases")
    parser.add_argument("--seed", type=int, default=46, help="seed of the cases")
    parser.add_argument("--only", type=int, help="number of the one case to make")
    parser.add_argument("--keep", type=Path, help="folder that receives the cases; without it they are removed")
    parser.add_argument("--details", action="store_true", help="print every case, not only those to mend")
    options = parser.parse_args()
    numbers = list(range(options.count)) if options.only is None else [options.only]
    with tempfile.TemporaryDirectory() as scratch:
        result = measure(options.seed, numbers, (options.keep or Path(scratch)).absolute())
    cases = result.pop("all")
    print(json.dumps(result | ({"all": cases} if options.details else {}), indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
