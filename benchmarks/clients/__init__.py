"""Clients and formats: what programs of others make of each export of a run.

`streetloom bench clients OUT` exports a published run in every format that a program here opens and has each program open it:
CesiumJS and three.js (with 3d-tiles-renderer) in Chromium on a software renderer, Blender (CityJSON as cjio writes it as OBJ),
GDAL, val3dity and Khronos' validator (`make clients` installs most of them). A row tells of one of them:

- `opened`: the program took the whole of it without an error: every tile, every layer, every object valid;
- `pictures`: those that it shows; `attributes`: columns that it answers with of one facade;
- `seconds` that it took to open it; `mb`, the files that it read;
- `texture_mb`: what the pictures take of a graphics card by the program's own count, with their mipmaps; in Blender the pixels;
- `colour_difference`, `edges_shared`, `shown`: its picture beside Streetloom's own (`benchmarks.clients.blender.compared`).

A program that is not here has a row that says so.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from benchmarks.clients.table import COLUMNS, rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("out", type=Path, help="the folder of a published run")
    parser.add_argument("--only", action="append", help="a format or a program; may be given more than once")
    parser.add_argument("--val3dity", type=Path, default=Path("../shared/tools/val3dity/run"), help="the validator")
    parser.add_argument("--markdown", action="store_true", help="print a table for a document")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = rows(asked.out, Path(folder), asked.val3dity, frozenset(asked.only or ()))
    if asked.markdown:
        print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
        for row in found:
            print(f"| {' | '.join(_cell(row.get(name, '')) for name in COLUMNS)} |")
    else:
        print(json.dumps({"benchmark": "clients", "rows": found}, indent=1))


def _cell(value: object) -> str:
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)
