"""The packaged map of Helsinki whole, as a city of blocks: one undisturbed run, one that is killed at random times, one with
nothing changed, one with one photo more.

    python -m benchmarks.city.whole OUT [--texels 3] [--panorama 128] [--spacing 15] [--exemplars 6] [--kills 3] [--seed 1]

OUT is a folder that is not there yet; with --go-on, one in which an earlier call was ended, whose parts that were finished by
the same code stand. Each part is `streetloom city` in a process of its own, looked at as it runs; what each took is kept in
OUT/whole.json and printed as JSON at the end, and memory over time is drawn, OUT/whole.svg.

- `undisturbed`: seconds of the clock and of the processor, facades a minute, memory of all processes at its peak and by tenths
  of the run (what processes share counts once for each share), bytes of stores and of what is published, what the model said.
- `killed`: the same city into another folder; SIGKILL to the whole process group at random times; then on to the end. `same`:
  of how many blocks that both have done the `atlas_digest` is the same.
- `again`: the command once more, nothing changed. `one_photo`: a photo of one facade is added; which blocks are done.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import yaml

from benchmarks.city.blocks import add_photo, write_block
from benchmarks.city.plot import plot
from benchmarks.city.runs import Look, look_at
from benchmarks.process_usage import add_used, user_environment
from benchmarks.timing import bytes_in, figures
from flows.city_options import CityOptions
from tasks.city.city_log import BLOCKS_FOLDER, read_city_log
from tasks.city.source_digests import block_code_version

# Seconds between two looks.
LOOK_S = 2.0
# A life that is killed lasts a share of the undisturbed run's between these.
LIFE = (0.05, 0.3)
# What a killed run leaves has so long to end by itself, seconds.
GONE_S = 60.0
CITY = "block.yaml"


@dataclass
class Life:
    """A command until it ended or was killed: its code (None: killed), seconds of the clock and of processors, how long its
    processes took to be gone, the machine's load meanwhile, and looks."""

    code: int | None
    seconds: float
    processor: float
    gone_s: float = 0.0
    loads: list[float] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)


def live(city: Path, out: Path, asked: CityOptions, kill_after: float | None = None) -> Life:
    """Run the city into a folder; where told to, until it is killed with all of its process group."""
    command = [sys.executable, "-m", "flows", "city", str(city), "--out", str(out), *_options(asked), "--json"]
    begun = time.time()
    with (out.parent / f"{out.name}.log").open("ab") as log:
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=log, env=user_environment(), start_new_session=True
        )
    used: dict[int, tuple[str, float]] = {}
    looks: list[Look] = []
    loads = [os.getloadavg()[0]]
    watcher = threading.Thread(target=_watch, args=(process, used, looks, loads))
    watcher.start()
    gone = 0.0
    try:
        code: int | None = process.wait(kill_after)
    except subprocess.TimeoutExpired:
        family = psutil.Process(process.pid).children(recursive=True)
        os.killpg(process.pid, signal.SIGKILL)
        killed = time.time()
        process.wait()
        code = None
        _, left = psutil.wait_procs(family, GONE_S)
        if left:
            raise SystemExit(f"{out}: killed, and {len(left)} of its processes go on") from None
        gone = time.time() - killed
    ended = time.time()
    watcher.join()
    return Life(code, ended - begun - gone, sum(seconds for _, seconds in used.values()), gone, loads, looks)


def _options(asked: CityOptions) -> list[str]:
    until = [] if asked.until is None else ["--until", asked.until]
    return ["--workers", str(asked.workers), "--at-once", str(asked.at_once), *until]


def _watch(
    process: subprocess.Popen, used: dict[int, tuple[str, float]], looks: list[Look], loads: list[float]
) -> None:
    root = psutil.Process(process.pid)
    looked = 0.0
    while process.poll() is None:
        add_used(root, used)  # more often: a block's processes end with what they used since they were looked at
        if time.time() - looked >= LOOK_S:
            looks.append(look_at(process.pid))
            loads.append(os.getloadavg()[0])
            looked = time.time()
        time.sleep(LOOK_S / 8)


def digests(out: Path) -> dict[str, str]:
    """The `atlas_digest` of each block that is done."""
    blocks = read_city_log(out).blocks.items()
    return {name: ended.summary["atlas_digest"] for name, ended in blocks if ended.code in (0, 1)}


def undisturbed(city: Path, out: Path, asked: CityOptions) -> dict[str, Any]:
    """Figures of a run from nothing."""
    life = live(city, out, asked)
    account = read_city_log(out)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    facades = summary["facades_done"]
    return {
        **_of(life),
        "blocks": len(account.blocks),
        "codes": {name: ended.code for name, ended in account.blocks.items() if ended.code},
        **{name: summary[name] for name in ("facades_done", "facades_failed", "viewpoints", "units_done")},
        "facades_a_minute": figures(60 * facades / life.seconds),
        "processor_s_a_facade": figures(life.processor / facades),
        "memory_mb": _memory(life),
        "stores_mb": figures(_megabytes(out, "store")),
        "published_mb": figures(_megabytes(out, "published")),
        "tiles_mb": figures(_megabytes(out, "exports")),
        "all_mb": figures(bytes_in(out) / 1e6),
        "seconds_by_block": {name: ended.seconds for name, ended in account.blocks.items()},
        "processor_s_by_block": {name: ended.processor for name, ended in account.blocks.items()},
        "estimate": summary["estimate"],
        "looks": [asdict(one) for one in life.looks],
    }


def killed(city: Path, out: Path, asked: CityOptions, kills: int, lasted: float, seed: int) -> dict[str, Any]:
    """Figures of a run that is killed so many times, at random times of those that it would take, and goes on."""
    random = np.random.default_rng(seed)
    lives, done = [], []
    for after in [*(lasted * random.uniform(*LIFE, kills)), None]:
        lives.append(live(city, out, asked, after))
        done.append([name for name, ended in read_city_log(out).blocks.items() if ended.code in (0, 1)])
    whole = Life(
        lives[-1].code,
        sum(one.seconds for one in lives),
        sum(one.processor for one in lives),
        loads=[load for one in lives for load in one.loads],
        looks=[look for one in lives for look in one.looks],
    )
    return {
        **_of(whole),
        "killed_after_s": [round(one.seconds) for one in lives[:-1]],
        "processes_gone_after_s": [figures(one.gone_s) for one in lives[:-1]],
        "blocks_done_then": [len(one) for one in done],
        "looks": [asdict(one) for one in whole.looks],
    }


def again(city: Path, out: Path, asked: CityOptions) -> dict[str, Any]:
    """Figures of a run with nothing to do, or with what changed since."""
    before = read_city_log(out).blocks
    life = live(city, out, asked)
    after = read_city_log(out).blocks
    done = [name for name in after if after[name] != before[name]]
    units = {name: after[name].summary.get("units_done") for name in done}
    return {**_of(life), "blocks_done": done, "units_done": units}


def _of(life: Life) -> dict[str, Any]:
    return {
        "code": life.code,
        "load": {"mean": round(float(np.mean(life.loads)), 1), "most": round(max(life.loads), 1)},
        "seconds": figures(life.seconds, 4),
        "processor_s": figures(life.processor, 4),
    }


def _memory(life: Life) -> dict[str, Any]:
    total = [look.total for look in life.looks]
    tenths = [round(max(one, default=0.0)) for one in np.array_split(np.array(total), 10)]
    return {"peak": round(max(total)), "peak_by_tenth_of_the_run": tenths}


def _megabytes(out: Path, named: str) -> float:
    return sum(bytes_in(one) for one in (out / BLOCKS_FOLDER).glob(f"*/{named}")) / 1e6


def write_city(folder: Path, texture: Mapping[str, float], metres: float, exemplars: int) -> Path:
    """The city file of the whole map, with some settings of texture, cut into blocks of so many metres."""
    path = write_block(folder, None)
    for picture in sorted((folder / "exemplars").iterdir())[2 * exemplars :]:  # each with its labels beside it
        picture.unlink()
    keys = yaml.safe_load(path.read_text(encoding="utf-8"))
    keys["texture"] |= texture
    path.write_text(yaml.safe_dump(keys | {"cut": {"metres": metres}}, sort_keys=False), encoding="utf-8")
    return path


def main() -> None:
    """Run the city four ways and print what that took as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("out", type=Path, help="a folder for all of it")
    parser.add_argument("--go-on", action="store_true", help="keep the parts of an earlier call that were finished")
    parser.add_argument("--texels", type=float, default=3.0, help="a metre [3]")
    parser.add_argument("--panorama", type=int, default=128, help="pixels of a panorama's width [128]")
    parser.add_argument("--spacing", type=float, default=15.0, help="metres between viewpoints [15]")
    parser.add_argument("--exemplars", type=int, default=6, help="painted ones, of 40 [6]")
    parser.add_argument("--metres", type=float, default=400.0, help="a block's side [400]")
    parser.add_argument("--kills", type=int, default=3, help="of the second run [3]")
    parser.add_argument("--seed", type=int, default=1, help="of the times at which it is killed [1]")
    parser.add_argument("--at-once", type=int, default=2, help="blocks at a time [2]")
    parser.add_argument(
        "--until", help="time of day, such as 06:00, at which a city is left, done or not; it is told of how many"
    )
    parser.add_argument("--workers", type=int, default=1, help="local processes of a block [1]")
    asked = parser.parse_args()
    if asked.out.exists() and not asked.go_on:
        raise SystemExit(f"{asked.out} is there already; name another folder, or go on in it with --go-on")
    asked.out.mkdir(parents=True, exist_ok=True)
    result = asked.out / "whole.json"
    found: dict[str, Any] = json.loads(result.read_text(encoding="utf-8")) if result.is_file() else {}
    texture = {
        "texels_per_metre": asked.texels,
        "panorama_width": asked.panorama,
        "viewpoint_spacing": asked.spacing,
    }
    if not (asked.out / "input" / CITY).is_file():
        write_city(asked.out / "input", texture, asked.metres, asked.exemplars)
    how = CityOptions(workers=asked.workers, at_once=asked.at_once, until=asked.until)
    city, whole, other = asked.out / "input" / CITY, asked.out / "undisturbed", asked.out / "killed"

    def part(name: str, measure: Callable[[], dict[str, Any]]) -> None:
        if found.get(name, {}).get("code_version") != block_code_version():
            found[name] = measure() | {"code_version": block_code_version()}
            result.write_text(json.dumps(found), encoding="utf-8")
            print(
                json.dumps({name: {k: v for k, v in found[name].items() if k != "looks"}}), file=sys.stderr, flush=True
            )

    def fresh(folder: Path) -> Path:
        shutil.rmtree(folder, ignore_errors=True)
        return folder

    part("undisturbed", lambda: undisturbed(city, fresh(whole), how))
    lasted = found["undisturbed"]["seconds"]
    part("killed", lambda: killed(city, fresh(other), how, asked.kills, lasted, asked.seed))
    part("same", lambda: _compare(digests(whole), digests(other)))
    part("again", lambda: again(city, whole, how))
    part("one_photo", lambda: _one_photo(city, whole, how))
    looks = {name: [_look(one) for one in found[name].pop("looks")] for name in ("undisturbed", "killed")}
    plot(looks, asked.out / "whole.svg")
    settings = texture | {
        "metres": asked.metres,
        "exemplars": asked.exemplars,
        "workers": asked.workers,
        "at_once": asked.at_once,
    }
    print(json.dumps({"benchmark": "whole city", "cores": os.cpu_count(), "settings": settings} | found, indent=1))


def _compare(one: Mapping[str, str], two: Mapping[str, str]) -> dict[str, Any]:
    both = [name for name in one if name in two]
    return {"blocks": sum(one[name] == two[name] for name in both), "of": len(both), "in_all": len(one)}


def _look(held: Mapping[str, Any]) -> Look:
    return Look(**{**held, "workers": tuple(held["workers"])})


def _one_photo(city: Path, out: Path, asked: CityOptions) -> dict[str, Any]:
    """A photo of one facade of the smallest block that has a street."""
    summaries = {name: ended.summary for name, ended in read_city_log(out).blocks.items()}
    block = min((n for n in summaries if summaries[n].get("viewpoints")), key=lambda n: summaries[n]["facades_done"])
    facade = add_photo(city, out / BLOCKS_FOLDER / block)
    return {"facade": facade, "of": block} | again(city, out, asked)


if __name__ == "__main__":
    main()
