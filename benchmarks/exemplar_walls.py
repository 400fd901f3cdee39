"""Sheet of street walls that are made from a block's exemplars, to be judged by eye.

    python -m benchmarks.exemplar_walls BLOCK.yaml --prepared FOLDER --sheet FILE [--pick N]

Shows walls at one scale: at most SHEET_WALLS, at least MIN_WIDTH_M wide, spread evenly over the block, and none that a
neighbour covers by more than half. Parts behind a neighbour, and below a wall that stands over a lower roof, are grey.
Exemplars follow, as prepared. Nothing of the block but these walls is made. --prepared keeps the prepared exemplars for a
next time. --pick takes N of the block's exemplars evenly, without every fifth, as ECP and CMP are held out of training.
Prints each wall with its exemplar and the exemplar whose ground floor it shows.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from PIL import Image

from catalogs.block.reader import Block, read_block
from facade_core.core.errors import ImageError
from facade_core.core.resizing import resize_image
from facade_core.facade.exemplar_facade import BuildingPaint, ScaledStyle, build_facade_from_exemplar
from facade_core.facade.texture.retargeting import analyse_exemplar
from facade_core.facade.texture.roof_removal import cut_off_roof
from facade_core.geometry.walls import WallRole, wall_outline_and_free_part
from facade_core.plan.facade_walls import facade_wall
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.seeds import BUILDING_SEED, FACADE_SEED, unit_seed
from tasks.engine.unit import Unit
from tasks.stages.exemplars.shared import PreparedExemplar, read_shared_exemplar, write_shared_exemplar
from tasks.stages.exemplars.stage import exemplar_inputs
from tasks.stages.exemplars.worker import prepare_picture
from tasks.stages.facades.exemplar_choices import choose_building_exemplars, exemplar_choice_walls, facade_shops
from tasks.stages.facades.exemplar_facades import read_with_ground_floor
from tasks.stages.facades.imagery import ChosenExemplar
from tasks.stages.ingest.planning import make_plan
from training.datasets.facades import split_facades_for_training

SHEET_WALLS, MIN_WIDTH_M, MIN_FREE_SHARE, COVERED_MARGIN_M, GREY = 40, 4.0, 0.5, 0.25, 225
PIXELS_PER_METRE, SHEET_PX, GAP_PX = 16, 1900, 12


def pick_exemplars(block: Block, count: int) -> Block:
    """Return a block with some of its exemplars, evenly, and none of a held-out fold."""
    known, _ = split_facades_for_training(block.exemplars)
    places = np.linspace(0, len(known) - 1, count).round().astype(int).tolist()
    return replace(block, exemplars=tuple(known[place] for place in places))


def prepare_exemplars(run: Run, block: Block) -> dict[int, PreparedExemplar]:
    """Prepare the exemplars of a block, or read those that are; without those that cannot be."""
    found = {}
    for number, path in enumerate(block.exemplars):
        unit = Unit(number, path.stem, exemplar_inputs(run, path))
        try:
            found[number] = read_shared_exemplar(run, unit) or prepare_picture(unit.inputs)
        except ImageError as error:
            print(f"{path.name}: {error}")
            continue
        write_shared_exemplar(run, unit, found[number])
    return found


def make_walls(
    run: Run, block: Block, plan: Plan, prepared: dict[int, PreparedExemplar]
) -> list[tuple[str, str, np.ndarray]]:
    """Make the street walls of a plan: id, names of the exemplars, and picture at PIXELS_PER_METRE."""
    facades = plan.facades
    records: list[Any] = [
        {"unit": path.stem, "key": "", "status": "done", **prepared[i].facts} if i in prepared else None
        for i, path in enumerate(block.exemplars)
    ]
    walls = exemplar_choice_walls(plan, block, facade_shops(plan, block))
    chosen, _ = choose_building_exemplars(walls, records, [], seed=run.seed)

    def read(index: int) -> tuple[np.ndarray, np.ndarray, float]:
        one = prepared[index]
        return one.image, one.labels, one.facts["metres_per_texel"]

    @cache
    def style(exemplar: ChosenExemplar, has_roof: bool) -> ScaledStyle:
        image, labels, scale = read_with_ground_floor(read, exemplar)
        return ScaledStyle(analyse_exemplar(*((image, labels) if has_roof else cut_off_roof(image, labels))), scale)

    wide = np.flatnonzero((facades.role == WallRole.STREET) & (facades.width >= MIN_WIDTH_M))
    charts, of = plan.scene.charts, facades.chart[wide]
    free = [wall_outline_and_free_part(charts, plan.scene.mesh, int(one))[1].area for one in of]
    wide = wide[np.array(free) >= MIN_FREE_SHARE * charts.size[of].prod(axis=1)]
    picked = wide[np.unique(np.linspace(0, len(wide) - 1, SHEET_WALLS).astype(int))]
    found = []
    for facade in picked.tolist():
        exemplar, along = chosen[int(facades.house[facade])], float(facades.along[facade])
        wall, span = facade_wall(plan.scene, facades, facade), (along, along + float(facades.width[facade]))
        made = build_facade_from_exemplar(
            style(exemplar, not facades.roofed[facade]),
            wall,
            plan.scene.placement.shape(int(facades.chart[facade])),
            span=span,
            paint=BuildingPaint(unit_seed(run, str(facades.house[facade]), BUILDING_SEED)),
            seed=unit_seed(run, facades.id[int(facades.run[facade])], FACADE_SEED),
        )
        size = round(wall.height * PIXELS_PER_METRE), round((span[1] - span[0]) * PIXELS_PER_METRE)
        down, across = ((np.arange(side) + 0.5) / PIXELS_PER_METRE for side in size)
        seen = shapely.contains_xy(wall.free.buffer(COVERED_MARGIN_M), *np.meshgrid(across + along, down))
        image = np.where(seen[..., None], resize_image(made.image, size), GREY).astype(np.uint8)
        if wall.is_raised:
            below = round(wall.foot * PIXELS_PER_METRE)
            image = np.pad(image, ((0, below), (0, 0), (0, 0)), constant_values=GREY)
        ground = exemplar.ground_floor
        names = exemplar.names if ground != "plain" else f"{exemplar.name}, plain"
        found.append((facades.id[facade], names, image))
    return found


def draw_sheet(pictures: list[np.ndarray]) -> np.ndarray:
    """Draw pictures in lines, on one foot."""
    lines: list[list[np.ndarray]] = [[]]
    for one in pictures:
        if lines[-1] and sum(other.shape[1] + GAP_PX for other in lines[-1]) + one.shape[1] > SHEET_PX:
            lines.append([])
        lines[-1].append(one)
    drawn = []
    for line in lines:
        high = max(one.shape[0] for one in line)
        padded = [
            np.pad(one, ((high - one.shape[0], GAP_PX), (0, GAP_PX), (0, 0)), constant_values=255) for one in line
        ]
        whole = np.hstack(padded)
        drawn.append(np.pad(whole, ((0, 0), (0, SHEET_PX + GAP_PX - whole.shape[1]), (0, 0)), constant_values=255))
    return np.vstack(drawn)


def main() -> None:
    """Write the sheet and print the walls."""
    parser = argparse.ArgumentParser(description="Sheet of street walls that are made from exemplars.")
    parser.add_argument("block", type=Path, help="block file with exemplars")
    parser.add_argument("--prepared", type=Path, required=True, help="folder that keeps prepared exemplars")
    parser.add_argument("--sheet", type=Path, required=True)
    parser.add_argument("--pick", type=int, help="number of exemplars; all by default")
    args = parser.parse_args()
    block = read_block(args.block)
    block = block if args.pick is None else pick_exemplars(block, args.pick)
    run = replace(create_run(block, args.prepared / "run"), shared=str(args.prepared))
    prepared = prepare_exemplars(run, block)
    walls = make_walls(run, block, make_plan(block), prepared)
    exemplars = [
        resize_image(
            one.image,
            tuple(round(side * one.facts["metres_per_texel"] * PIXELS_PER_METRE) for side in one.labels.shape),
        )
        for one in prepared.values()
    ]
    Image.fromarray(draw_sheet([*(image for *_, image in walls), *exemplars])).save(args.sheet, quality=80)
    print(json.dumps({"benchmark": "exemplar_walls", "walls": {name: names for name, names, _ in walls}}, indent=1))


if __name__ == "__main__":
    main()
