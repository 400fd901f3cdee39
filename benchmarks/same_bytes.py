"""Compare the results of this checkout with those of another revision, byte by byte.

This checkout writes the input files of each case. Both revisions then run as a user runs them: all stages, the published
tables and models, and exports. Excepted is what may differ: times, durations, and the digest of the code.

    python -m benchmarks.same_bytes --before HEAD~1
    python -m benchmarks.same_bytes --before HEAD~1 --cases photos,panoramas,cameras,city_part,demo
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import pyogrio

from facade_core.export.models.glb import read_glb_header
from tasks.examples.demo import write_demo
from tests.pipeline.painted_panoramas import FAR, write_panorama_block, write_panoramas
from tests.pipeline.perspective_pictures import write_picture_block
from tests.pipeline.runs import environment
from tests.pipeline.small_city import write_city
from tests.pipeline.stages import write_block, write_photo

ROOT = Path(__file__).resolve().parent.parent
# Columns that say when something was done, how long that took, where, and by which code.
VOLATILE = ["updated", "seconds", "run", "config_digest", "update_time"]
VOLATILE_PROPERTIES = {*VOLATILE, "code_version"}
# What an export says of its own files, which are compared themselves.
CONTENTS = ("export.json", ".export.json")
# Likewise in the text of exports: times, the version with its digest of code, names of snapshots.
VOLATILE_TEXT = re.compile(rb"\d{4}-\d\d-\d\d(T[\d:.]+(Z|\+00:00)?)?|0\.1\.0\+[0-9a-f]{12}|[0-9A-Z]{20}")


@dataclass(frozen=True)
class Case:
    """Inputs that both revisions get.

    Attributes
    ----------
    write : writes the inputs into a folder and returns the block's or the city's file.
    formats : exports that are compared beside the published files.
    command : command of the program, and its options.
    """

    write: Callable[[Path], Path]
    formats: tuple[str, ...] = ()
    command: tuple[str, ...] = ("run",)


def _write_photo_block(folder: Path) -> Path:
    write_photo(folder, "a-0", 1)
    return write_block(folder)


def _write_panorama_block(folder: Path) -> Path:
    write_panoramas(folder, {"a-1": (8.0, -1.0, 2.5), "a-2": (12.5, 0.5, 3.0), "c-1": (9.0, FAR - 1, 2.5)})
    return write_panorama_block(folder)


CASES = {
    "photos": Case(
        _write_photo_block,
        ("glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "citygml", "coco", "labelme", "gpkg", "cog"),
    ),
    "panoramas": Case(_write_panorama_block),
    "cameras": Case(write_picture_block),
    "city_part": Case(write_city, ("cityjsonseq", "gpkg"), ("city", "--no-tiles")),
    "demo": Case(write_demo, ("3dtiles",)),
}
SMALL_CASES = ("photos", "panoramas", "cameras")


def measure(before: str, cases: tuple[str, ...] = SMALL_CASES) -> dict[str, Any]:
    """Compute the results of both revisions and list those that differ.

    Parameters
    ----------
    before : the other revision.
    cases : names of CASES.
    """
    results: dict[str, dict[str, str]] = {"before": {}, "after": {}}
    with TemporaryDirectory() as name:
        folder = Path(name)
        other = _kept_checkout(before)
        for case in cases:
            inputs = CASES[case].write(folder / case)
            for side, checkout in (("before", other), ("after", ROOT)):
                found = _results(checkout, CASES[case], inputs, folder / f"{case}-{side}")
                results[side] |= {f"{case}/{result}": digest for result, digest in found.items()}
    names = sorted(results["before"].keys() | results["after"].keys())
    differ = [one for one in names if results["before"].get(one) != results["after"].get(one)]
    return {"before": before, "compared": len(names), "differ": differ, "results": results["after"]}


def _kept_checkout(revision: str) -> Path:
    """Return a checkout of a revision that later calls use again, so that its kernels are compiled once."""
    name = ["git", "rev-parse", "--verify", f"{revision}^{{commit}}"]
    commit = subprocess.run(name, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    folder = Path.home() / ".cache" / "streetloom" / "checkouts" / commit[:12]
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder.parent) as scratch:
            check_out(commit, Path(scratch) / "checkout")
            with suppress(OSError):  # another process was first
                (Path(scratch) / "checkout").rename(folder)
    return folder


def check_out(revision: str, folder: Path) -> None:
    """Extract a revision of this repository into a folder."""
    archive = subprocess.run(["git", "archive", revision], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=BytesIO(archive)) as tar:
        tar.extraction_filter = getattr(tarfile, "data_filter", None)  # the first Pythons of 3.11 have none
        tar.extractall(folder)


def _results(checkout: Path, case: Case, inputs: Path, out: Path) -> dict[str, str]:
    """Compute the digests of what a checkout makes of a case's inputs, by name."""
    settings = environment(out.parent) | {"PYTHONPATH": str(checkout)}

    def command(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "flows", *words], cwd=checkout, env=settings, capture_output=True, text=True
        )
        if done.returncode:
            raise SystemExit(f"{checkout}: {' '.join(words)}: {done.stderr[-2000:]}")
        return done.stdout

    name, *options = case.command
    printed = command(name, str(inputs), "--out", str(out), "--json", *options)
    found = {"atlas_digest": json.loads(printed.strip().splitlines()[-1])["atlas_digest"]}
    for path, label in _published_files(out):
        if path.suffix == ".parquet":
            rows = pd.read_parquet(path).drop(columns=VOLATILE, errors="ignore")
            found |= {
                f"{label}/{column}": _digest(values.to_csv(index=False).encode()) for column, values in rows.items()
            }
        else:
            found[label] = _digest_file(path)
    for form in case.formats:
        folder = out.with_name(f"{out.name}-{form}{'.gpkg' if form == 'gpkg' else ''}")
        command("export", str(out), "--format", form, "--to", str(folder))
        if folder.is_dir():
            files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in CONTENTS]
            found |= {f"{form}/{path.relative_to(folder).as_posix()}": _digest_file(path) for path in files}
        else:
            found |= {f"{form}/{layer}": _digest(_layer(folder, layer)) for layer, _ in pyogrio.list_layers(folder)}
    return found


def _published_files(out: Path) -> Iterator[tuple[Path, str]]:
    """Yield the tables of facades and the models of a run or of a city's blocks, with labels that runs share."""
    for folder in sorted(out.glob("**/published/*/")):
        block = folder.parent.parent.relative_to(out).as_posix()
        for path in sorted((folder / "items.parquet", *folder.rglob("*.glb"))):
            yield path, f"{block}/{path.relative_to(folder).as_posix()}"


def _digest_file(path: Path) -> str:
    return _digest(_model_content(path.read_bytes()) if path.suffix == ".glb" else path.read_bytes())


def _model_content(glb: bytes) -> bytes:
    """Return a model without the volatile properties of its metadata, such as the seconds of each facade."""
    document, data = read_glb_header(BytesIO(glb))
    tables = document.get("extensions", {}).get("EXT_structural_metadata", {}).get("propertyTables", [])
    volatile = {
        view
        for table in tables
        for name in VOLATILE_PROPERTIES & table["properties"].keys()
        for view in table["properties"][name].values()
    }
    rest = {name: value for name, value in document.items() if name not in ("buffers", "bufferViews")}
    content = [json.dumps(rest).encode()]
    for index, view in enumerate(document.get("bufferViews", [])):
        if index not in volatile:
            start = data + view["byteOffset"]
            shape = {name: value for name, value in view.items() if name != "byteOffset"}
            content += [json.dumps(shape).encode(), glb[start : start + view["byteLength"]]]
    return b"".join(content)


def _layer(file: Path, layer: str) -> bytes:
    rows = pyogrio.read_dataframe(file, layer=layer)
    return rows.drop(columns=VOLATILE, errors="ignore").to_csv(index=False).encode()


def _digest(content: bytes) -> str:
    return hashlib.sha256(VOLATILE_TEXT.sub(b"", content)).hexdigest()[:16]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", default="HEAD", help="the revision to compare this checkout with")
    parser.add_argument(
        "--cases", default=",".join(SMALL_CASES), help=f"of {', '.join(CASES)}, with commas between (%(default)s)"
    )
    parser.add_argument("--json", action="store_true", help="(what is printed is JSON in any case)")
    options = parser.parse_args()
    cases = tuple(options.cases.split(","))
    if unknown := set(cases) - CASES.keys():
        parser.error(f"--cases: {', '.join(sorted(unknown))} is unknown; there is {', '.join(CASES)}")
    found = measure(options.before, cases)
    print(json.dumps(found, indent=2))
    sys.exit(bool(found["differ"]))


if __name__ == "__main__":
    os.environ.setdefault("NO_COLOR", "1")
    main()
