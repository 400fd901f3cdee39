"""Sheet of the walls that panoramas show, to be judged by eye.

    python -m benchmarks.pictured_walls OUT... --panoramas DIR --sheet FILE

A row of three pictures for each facade that is textured from panoramas and is at least MIN_WIDTH_M wide: the view of its first
panorama by the stated pose, the evidence of the run (hidden parts are dark), and the texture. Prints the ids of the walls, from
the upper left to the lower right.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.stage_pictures import beside
from facade_core.atlas.rasters import read_chart_raster
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from tasks.publish.published_run import PublishedBlock, open_published_run
from tasks.stages.shared.images import max_picture_pixels, read_panorama

MIN_WIDTH_M, MIN_SHOWN_SHARE = 4.0, 0.2
HEIGHT, WIDTH = 260, 1600
# Mean grey that pictures are brought to, so that dark ones can be judged.
GREY = 105


def wall_rows(block: PublishedBlock, panoramas: Path) -> dict[str, np.ndarray]:
    """Pictures of each wall beside each other, by its id."""
    plan, placement = block.plan, block.plan.scene.placement
    taken = {record["unit"]: number for number, record in enumerate(block.refined_poses) if record}
    found = {}
    for index, record in enumerate(block.records):
        name = "" if record is None else str(record.get("source") or "").split(", ")[0]
        if name not in taken or plan.facades.width[index] < MIN_WIDTH_M:
            continue
        chart, pose = int(plan.facades.chart[index]), plan.poses[taken[name]]
        image = read_panorama(panoramas / name, max_picture_pixels(pose))
        stated = rectify_chart_from_panorama(plan.scene, chart, image, pose, placement.shape(chart)).rgb
        if stated.any(axis=2).mean() < MIN_SHOWN_SHARE:  # in the style of a wall that it shows
            continue
        evidence, hidden, texture = (
            read_chart_raster(block.group, placement, chart, array)
            for array in ("facade_maps/evidence", "facade_maps/occluded", "atlas/colour")
        )
        evidence = np.where(hidden[..., None], evidence // 3, evidence).astype(np.uint8)
        found[str(block.group["facades/id"][index])] = beside(
            [_lit(one) for one in (stated, evidence, texture)], HEIGHT
        )
    return found


def _lit(picture: np.ndarray) -> np.ndarray:
    seen = picture[picture.any(axis=2)]
    return np.clip(picture * (GREY / max(30.0, float(seen.mean()))), 0, 255).astype(np.uint8) if len(seen) else picture


def main() -> None:
    """Write the sheet and print the walls."""
    parser = argparse.ArgumentParser(description="Sheet of the walls that panoramas show.")
    parser.add_argument("runs", nargs="+", type=Path, help="folders of published runs")
    parser.add_argument("--panoramas", required=True, type=Path, help="folder of the panoramas")
    parser.add_argument("--sheet", required=True, type=Path)
    args = parser.parse_args()
    found: dict[str, np.ndarray] = {}
    for run in args.runs:
        with open_published_run(run) as block:
            found |= wall_rows(block, args.panoramas)
    if not found:
        parser.error("no panorama shows a wall of these runs")
    lines: list[list[np.ndarray]] = [[]]
    for row in found.values():
        if lines[-1] and sum(one.shape[1] + 24 for one in lines[-1]) + row.shape[1] > WIDTH:
            lines.append([])
        lines[-1].append(row)
    sheet = [
        np.hstack([np.pad(one, ((0, 12), (0, 24), (0, 0)), constant_values=255) for one in line]) for line in lines
    ]
    width = max(line.shape[1] for line in sheet)
    whole = np.vstack(
        [np.pad(line, ((0, 0), (0, width - line.shape[1]), (0, 0)), constant_values=255) for line in sheet]
    )
    Image.fromarray(whole).save(args.sheet)
    print(json.dumps({"benchmark": "pictured_walls", "walls": list(found)}, indent=1))


if __name__ == "__main__":
    main()
