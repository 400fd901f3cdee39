"""The model by which `streetloom plan` estimates a city: fitted on blocks of several sizes, densities and panoramas, checked on
blocks that it was not fitted on. Seconds are those of the processor, so other work on the machine counts little.

    python -m benchmarks.city.cost [--blocks ...] [--command ...] [--check ...] [--keep FILE] [--write]

A block is so many tiles of a town (`benchmarks.city.reading`), or one of those into which packaged Helsinki is cut, at so many
texels a metre, with panoramas so many pixels wide: 3x1@8:256, x966y16682@16:512. Stages of those that the model is fitted on
run one after the other in this process (`benchmarks.processor`), after one that compiles; what the command takes beside, to
start, report and end, is that of those of `--command`, which it runs too. Those of `--check` are run by the command alone, as
`streetloom city` does: by what the model is off there, it may be off of a city.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmarks.city.laying import COMMAND, COURSE, EXPORT, OF_BYTES, OF_SECONDS, Ran, errors, fit, of_it
from benchmarks.city.reading import write_town
from benchmarks.city.whole import write_city
from benchmarks.processor import measured
from benchmarks.timing import bytes_in
from catalogs.block.reader import read_block
from facade_core.atlas.store import BRANCH, open_repository
from facade_core.plan.plan_tables import read_plan
from tasks.city.block_counts import BlockCounts, block_counts_from_map
from tasks.city.block_process import run_block
from tasks.city.blocks import partition_city_file
from tasks.city.city_log import BLOCKS_FOLDER, BlockResult
from tasks.city.cost import COEFFICIENTS
from tasks.engine.store.commits import read_newest_journal
from tasks.export.formats import export_run

FITTED = (
    "1x1@3:128",
    "3x1@3:128",
    "3x3@3:128",
    "1x1@8:256",
    "1x1@16:512",
    "1x1@32:1024",
    "x966y16681@3:128",
    "x966y16682@16:512",
)
COMMANDS = ("1x1@3:128", "3x3@3:128", "1x1@32:1024")
CHECKED = ("2x1@12:384", "x966y16681@8:256", "x966y16682@32:1024")
# Exemplars of Helsinki's blocks: few, as each block prepares them.
EXEMPLARS, METRES = 6, 400.0
NAME = re.compile(r"(?:(\d+)x(\d+)|(x\d+y\d+))@([\d.]+):(\d+)")


def write_named(folder: Path, name: str) -> tuple[Path, float]:
    """Write a block by its name; returns its block file and its texels a metre."""
    found = NAME.fullmatch(name)
    if found is None:
        raise SystemExit(f"{name}: is no block; write it such as 3x1@8:256 or x966y16682@16:512")
    columns, rows, of_city, density, panorama = found.groups()
    if of_city is None:
        write_town(folder, int(columns), int(rows), texels=float(density), panorama=int(panorama))
        return folder / "block.yaml", float(density)
    texture = {"texels_per_metre": float(density), "panorama_width": int(panorama), "viewpoint_spacing": 9.0}
    partition_city_file(write_city(folder, texture, METRES, EXEMPLARS), folder / "cut")
    return folder / "cut" / "input" / f"{of_city}.yaml", float(density)


def by_stages(folder: Path, name: str) -> Ran:
    """Run a block's stages in this process."""
    block_file, density = write_named(folder, name)
    with _commits(folder / "out" / "store") as commits:
        took = measured(folder / "out", block_file, None, 1, [])["seconds"]
    begun = time.process_time()
    export_run(folder / "out", "3dtiles")
    seconds = dict.fromkeys((*OF_SECONDS, EXPORT), 0.0) | {EXPORT: time.process_time() - begun}
    del seconds[COMMAND]
    for named, of in took.items():
        if named.partition(" ")[0] not in ("imports", "compile"):
            stage = named.partition(":")[0] if ":" in named else COURSE
            seconds[_STAGES.get(stage, stage) if stage in _STAGES or stage in seconds else COURSE] += of["total"]
    return _ran(name, density, block_file, folder / "out", seconds, max(commits))


# Stages whose seconds are laid to the same.
_STAGES = {"streets": "viewpoints"}


def by_command(folder: Path, name: str) -> Ran:
    """Run a block as `streetloom city` does, with one worker."""
    block_file, density = write_named(folder, name)
    out = folder / BLOCKS_FOLDER / "one"
    out.parent.mkdir(parents=True)
    with _commits(out / "store") as commits:
        ended = run_block.fn(folder, "one", block_file, ["--workers", "1"], BlockResult(), "", "", None, tiles=True)
    if ended.code:
        raise SystemExit(f"{name}: {ended.reason}")
    return _ran(name, density, block_file, out, {COMMAND: ended.processor}, max(commits))


def _ran(name: str, density: float, block_file: Path, out: Path, seconds: Mapping[str, float], commits: int) -> Ran:
    told = block_counts_from_map(read_block(block_file))

    def count(stage: str, start: str = "") -> int:
        return sum(
            one is not None and one["unit"].startswith(start) for one in read_newest_journal(out / "store", stage)
        )

    plan = read_plan(open_repository(out / "store").readonly_session(BRANCH))
    placement = plan.scene.placement
    texels = float((placement.width.astype(float) * placement.height)[plan.in_core].sum())
    had = BlockCounts(
        facades=count("facades"),
        viewpoints=count("viewpoints"),
        ground=count("surfaces", "ground-"),
        exemplars=count("exemplars"),
        megatexels=texels / 1e6,
        photos=told.photos,
        panoramas=told.panoramas,
        exemplar_megapixels=told.exemplar_megapixels,
        photo_megapixels=told.photo_megapixels,
    )
    had = replace(had, megapixels=told.megapixels * had.viewpoints / max(told.viewpoints, 1.0))
    sizes = {part: float(bytes_in(out / part)) for part in OF_BYTES}
    return Ran(name, density, told, had, seconds, sizes, {"commits": float(commits)})


@contextmanager
def _commits(store: Path) -> Iterator[list[int]]:
    """How many snapshots there are of a store, looked at until the end: publishing expires those before."""
    seen, over = [0], threading.Event()

    def look() -> None:
        while not over.wait(0.1):
            if (store / "snapshots").is_dir():
                seen.append(sum(1 for _ in os.scandir(store / "snapshots")))

    watcher = threading.Thread(target=look)
    watcher.start()
    try:
        yield seen
    finally:
        over.set()
        watcher.join()


def main() -> None:
    """Run the blocks, fit the model, check it, print all of that as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--blocks", nargs="+", default=FITTED, help=f"to fit on [{' '.join(FITTED)}]")
    parser.add_argument(
        "--command", nargs="+", default=COMMANDS, help=f"of these, by the command too [{' '.join(COMMANDS)}]"
    )
    parser.add_argument("--check", nargs="*", default=CHECKED, help=f"to check on [{' '.join(CHECKED)}]")
    machine = f"{os.cpu_count()} cores, {platform.machine()}"
    parser.add_argument("--machine", default=machine, help=f"on which they are run, in words [{machine}]")
    parser.add_argument("--keep", type=Path, help="a file of blocks that were run, which are not run again")
    parser.add_argument("--write", action="store_true", help="keep the model in the project")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        ran = _run(Path(name), asked)
    fitted_on = [ran[f"stages {block}"] for block in asked.blocks]
    for one in (ran[f"command {block}"] for block in asked.command):
        alone = ran[f"stages {one.name}"].all_of("seconds")
        fitted_on.append(replace(one, seconds={COMMAND: max(one.seconds[COMMAND] - alone, 0.0)}, bytes={}, commits={}))
    held = {block: of_it(fit(fitted_on), ran[f"command {block}"]) for block in asked.check}
    planned = {block: of_it(fit(fitted_on), ran[f"command {block}"], planned=True) for block in asked.check}
    off = [errors(list(one.values())) if one else None for one in (held, planned)]
    cost = fit(fitted_on, asked.machine, *off)
    on_itself = {block: of_it(cost, ran[f"command {block}"]) for block in asked.command}
    print(
        json.dumps({"model": asdict(cost), "fitted_on": on_itself, "check": held, "check_planned": planned}, indent=1)
    )
    if asked.write:
        COEFFICIENTS.write_text(json.dumps(asdict(cost), indent=1) + "\n", encoding="utf-8")


def _run(folder: Path, asked: argparse.Namespace) -> dict[str, Ran]:
    """Each block that is not kept, as it is wanted."""
    kept: dict[str, Any] = json.loads(asked.keep.read_text("utf-8")) if asked.keep and asked.keep.is_file() else {}
    ran = {key: Ran(**one | {w: BlockCounts(**one[w]) for w in ("told", "had")}) for key, one in kept.items()}
    wanted = [f"stages {one}" for one in asked.blocks]
    wanted += [f"command {one}" for one in (*asked.command, *asked.check)]
    for number, key in enumerate(one for one in wanted if one not in ran):
        how, _, name = key.partition(" ")
        act = by_stages if how == "stages" else by_command
        if number == 0:
            by_stages(folder / "compiles", asked.blocks[0])
        ran[key] = act(folder / str(number), name)
        print(json.dumps({key: asdict(ran[key])}), file=sys.stderr, flush=True)
        if asked.keep:
            asked.keep.write_text(json.dumps({key: asdict(one) for key, one in ran.items()}), encoding="utf-8")
    return ran


if __name__ == "__main__":
    main()
