"""A wall clock that is set forward for the processes that a benchmark starts, and for no others."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

ZONE = ZoneInfo("Europe/Amsterdam")
# Variables of the environment that set the clock of a process and its children.
VARIABLES = ("LD_PRELOAD", "SHIFTED_CLOCK")


@dataclass(frozen=True)
class ShiftedClock:
    """Clock whose distance from the machine's is in a file that the processes map."""

    file: Path

    def now(self) -> datetime:
        (ahead,) = struct.unpack("l", self.file.read_bytes())
        return datetime.fromtimestamp(time.time() + ahead, ZONE)

    def advance_to(self, moment: datetime) -> None:
        """Set the clock forward; a moment that is past leaves it as it is."""
        if moment > self.now():
            with self.file.open("r+b") as file:
                file.write(struct.pack("l", round(moment.timestamp() - time.time())))


@contextmanager
def shift_clock(folder: Path) -> Iterator[ShiftedClock]:
    """Compile the library that shifts clocks, and set it for all processes that are started until the block ends.

    libfaketime 0.9.10 is not used: with it, `time.sleep` of Python 3.11 fails where monotonic clocks are left as they are.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        raise SystemExit("cc: not found; install a C compiler")
    library, file = folder / "clock.so", folder / "seconds-ahead"
    source = Path(__file__).with_suffix(".c")
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True)
    file.write_bytes(struct.pack("l", 0))
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(LD_PRELOAD=str(library), SHIFTED_CLOCK=str(file))
    try:
        yield ShiftedClock(file)
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
