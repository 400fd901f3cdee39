"""What benchmarks printed, kept as files: a record is made by running a command, and by nothing else."""

from __future__ import annotations

import json
import os
import platform
import shlex
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.figures.code import code_of
from facade_core.core.errors import InputError
from tasks.engine.stage_code import ROOT

FOLDER = Path(__file__).parent / "records"
LARGEST = 64_000  # characters: a benchmark that prints more has to be asked for less, or to print less


@dataclass(frozen=True)
class Record:
    """command: with names for paths, such as DIR; machine: cores, system, Python; load: of the last minute, before and after;
    code: digest of each room that the command reached (`code_of`); values: what it printed."""

    command: str
    date: str
    machine: dict[str, Any]
    load: tuple[float, float]
    seconds: float
    code: dict[str, str]
    values: dict[str, Any]


def read_record(name: str, folder: Path = FOLDER) -> Record:
    """The record of a name; InputError where there is none."""
    try:
        return Record(**json.loads((folder / f"{name}.json").read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise InputError(f"{name}: no record; make it with: python -m benchmarks.figures {name}") from None


def write_record(name: str, record: Record, folder: Path = FOLDER) -> Path:
    text = json.dumps(asdict(record), indent=1, ensure_ascii=False) + "\n"
    if len(text) > LARGEST:
        raise InputError(
            f"{name}: prints {len(text)} characters, and a record has at most {LARGEST}: have it print less"
        )
    path = folder / f"{name}.json"
    path.write_text(text, encoding="utf-8")
    return path


def measure(command: str, places: Mapping[str, str]) -> Record:
    """Run a command and keep the JSON object that it prints; InputError where it fails, or prints none.

    places: what stands for the names in the command, such as DIR; these names stand for it in what is kept.
    """
    code, before, start = code_of(command), os.getloadavg()[0], time.monotonic()
    words = [places.get(word, word) for word in shlex.split(command)]
    if missing := [word for word in words if word.isupper() and len(word) > 1 and word not in places.values()]:
        raise InputError(f"{command}: say what {missing[0]} is: python -m benchmarks.figures NAME {missing[0]}=PATH")
    done = subprocess.run(_program(words), cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    said = done.stdout
    if done.returncode or "{" not in said:
        raise InputError(f"{command}: ended with {done.returncode} and without JSON; what it said is above")
    for name, place in (*((name, place) for name, place in places.items()), (".", str(ROOT))):
        said = said.replace(str(Path(place).resolve()), name).replace(place, name)
    return Record(
        command,
        datetime.now(UTC).date().isoformat(),
        {
            "cores": os.cpu_count(),
            "system": f"{platform.system()} {platform.machine()}",
            "python": ".".join(map(str, sys.version_info[:2])),
        },
        (round(before, 1), round(os.getloadavg()[0], 1)),
        round(time.monotonic() - start, 1),
        code,
        json.loads(said[said.index("{") :]),
    )


def _program(words: list[str]) -> list[str]:
    """The words of a command, run by this interpreter: `streetloom` is `-m flows`."""
    match words:
        case ["streetloom", *rest]:
            return [sys.executable, "-m", "flows", *rest]
        case ["python", *rest]:
            return [sys.executable, *rest]
    raise InputError(f"{shlex.join(words)}: a record is of `streetloom` or of `python -m`")
