"""Whether a change of the code changed any result: a small block through this checkout and through another revision.

Both run as a user runs them, on the same input files: all stages, the published table, and every export. What may differ is
named: when something was done, how long that took, which code did it.

    python -m benchmarks.same_bytes --before HEAD~1
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
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import pyogrio

from facade_core.export.models.glb import read_glb_header
from tests.pipeline import stages
from tests.pipeline.runs import environment

ROOT = Path(__file__).resolve().parent.parent
FORMATS = ("glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "citygml", "coco", "labelme", "gpkg", "cog")
# Columns that say when something was done, how long that took, where, and by which code.
VOLATILE = ["updated", "seconds", "run", "config_digest"]
VOLATILE_PROPERTIES = {*VOLATILE, "code_version"}
# What an export says of its own files, which are compared themselves.
CONTENTS = ("export.json", ".export.json")
# Likewise in the text of exports: times, the version with its digest of code, names of snapshots.
VOLATILE_TEXT = re.compile(rb"\d{4}-\d\d-\d\d(T[\d:.]+(Z|\+00:00)?)?|0\.1\.0\+[0-9a-f]{12}|[0-9A-Z]{20}")


def measure(before: str) -> dict[str, Any]:
    """The results of both revisions, and in which of them they differ."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        stages.write_photo(folder / "in", "a-0", 1)
        block = stages.write_block(folder / "in")
        check_out(before, folder / "before")
        results = {
            side: _results(checkout, block, folder / f"out-{side}")
            for side, checkout in (("before", folder / "before"), ("after", ROOT))
        }
    names = sorted(results["before"].keys() | results["after"].keys())
    differ = [one for one in names if results["before"].get(one) != results["after"].get(one)]
    return {"before": before, "compared": len(names), "differ": differ, "results": results["after"]}


def check_out(revision: str, folder: Path) -> None:
    """Extract a revision of this repository into a folder."""
    archive = subprocess.run(["git", "archive", revision], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=BytesIO(archive)) as tar:
        tar.extraction_filter = getattr(tarfile, "data_filter", None)  # the first Pythons of 3.11 have none
        tar.extractall(folder)


def _results(checkout: Path, block: Path, out: Path) -> dict[str, str]:
    """Digests of what a checkout makes of a block, by name."""
    settings = environment(out.parent) | {"PYTHONPATH": str(checkout)}

    def command(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "flows", *words], cwd=checkout, env=settings, capture_output=True, text=True
        )
        if done.returncode:
            raise SystemExit(f"{checkout}: {' '.join(words)}: {done.stderr[-2000:]}")
        return done.stdout

    summary = json.loads(command("run", str(block), "--out", str(out), "--json").strip().splitlines()[-1])
    rows = pd.read_parquet(summary["outputs"]["items"]).drop(columns=VOLATILE, errors="ignore")
    found = {"atlas_digest": summary["atlas_digest"]}
    found |= {f"items/{name}": _digest(column.to_csv(index=False).encode()) for name, column in rows.items()}
    for model in summary["outputs"]["glb"]:
        found[f"published/{Path(model).name}"] = _digest_file(Path(model))
    for form in FORMATS:
        folder = out.with_name(f"{out.name}-{form}{'.gpkg' if form == 'gpkg' else ''}")
        command("export", str(out), "--format", form, "--to", str(folder))
        if folder.is_dir():
            files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in CONTENTS]
            found |= {f"{form}/{path.relative_to(folder).as_posix()}": _digest_file(path) for path in files}
        else:
            found |= {f"{form}/{layer}": _digest(_layer(folder, layer)) for layer, _ in pyogrio.list_layers(folder)}
    return found


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
    parser.add_argument("--json", action="store_true", help="(what is printed is JSON in any case)")
    found = measure(parser.parse_args().before)
    print(json.dumps(found, indent=2))
    sys.exit(bool(found["differ"]))


if __name__ == "__main__":
    os.environ.setdefault("NO_COLOR", "1")
    main()
