"""Half of the ground that a real panorama shows, foretold from the other half: `python -m benchmarks.halves --data DIR`.

The street panoramas of DIR/panoramas look along their street, with the ground assumed level CAMERA_HEIGHT_M below them. What a
run trusts of the ground before the camera is known, what it trusts behind it is asked, and the other way round. Of a
carriageway WIDTH_M wide, PSNR in dB of means over squares of .5 m, and of texels. By MADE: the material alone; after the
picture (docs/decisions/0167); continued by viewpoints (0168); and two methods of copying that no run uses: strips of the known
half laid one after the other along the street, each the one of usual look that fits its neighbour, with the cut of least
difference between them (Efros and Freeman 2001); and what runs along the street, which the known half shows at the same place
across it along most of its length. better: share of halves in which a method is nearer to the picture than `continued`.
All figures are means over halves.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely

from benchmarks.cameras import ground_points
from benchmarks.foretold import mean_squares
from benchmarks.street.truth import psnr
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, Pose, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, place_viewpoints
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.exposure import sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import mask_ground_occluders
from facade_core.street.continuation import blend_street_views, continue_street
from facade_core.street.materials.field import MaterialField
from tasks.stages.shared.images import read_panorama

MADE = ("material", "pictured", "continued", "strips", "lines")
CAMERA_HEIGHT_M, WIDTH_M, DENSITY = 2.3, 6.0, 16.0
# East and north of the camera, the middle of a square of ground.
MIDDLE_M = 16.0
# Of the strips, metres; the difference that a texel of a strip adds to its cost at most.
STRIP_M, OVERLAP_M, STEP_M, MOST_COST = 2.5, 0.5, 0.25, 3000.0
# What runs along a street is narrower than this, metres, is seen over so many, and has at least this contrast.
LINE_WIDTH_M, LINE_LENGTH_M, LINE_CONTRAST = 0.6, 5, 8.0
# Least texels of a half that say anything.
LEAST_TEXELS = 2000


def measure(data: Path, sheet: Path | None) -> dict[str, Any]:
    """Foretell the halves of all panoramas."""
    scene, field, line = _straight_street()
    chart = int(np.argmax(np.where(scene.charts.kind == ChartKind.GROUND, scene.charts.size.prod(axis=1), 0)))
    positions, forward = place_viewpoints(line)
    viewpoints = [Viewpoint(n, 0, *place) for n, place in enumerate(zip(positions, forward, strict=True))]
    points = ground_points(scene, chart, (int(scene.placement.height[chart]), int(scene.placement.width[chart])))
    east, road = points[..., 0] - MIDDLE_M, np.abs(points[..., 1] - MIDDLE_M) <= WIDTH_M / 2
    told: list[dict[str, tuple[float, float]]] = []
    rows = []
    warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
    for path in sorted((data / "panoramas").glob("*.jpg")):
        image, pose = read_panorama(path), Pose(MIDDLE_M, MIDDLE_M, CAMERA_HEIGHT_M, 90.0)
        colours = typical_ground_colour(sample_ground_colours(scene, image, pose).squares)
        camera = PanoramaCamera(image, pose, mask_ground_occluders(image, pose), np.ones(3), colours)
        view = fuse_ground_view(scene, chart, [camera])
        for side in (1, -1):
            known = np.zeros(road.shape, bool) if view is None else view.is_visible & road & (side * east > 0)
            asked = np.zeros(road.shape, bool) if view is None else view.is_visible & road & (side * east < 0)
            if view is None or min(known.sum(), asked.sum()) < LEAST_TEXELS:
                continue
            shown = {chart: (view.rgb, known)}
            pictured = field.with_pictured_ground(shown)
            views = continue_street(scene, pictured, viewpoints, [np.array([chart])] * len(viewpoints), shown)
            painted = pictured.chart_raster(chart)
            continued = painted.copy()
            if views:
                rest = np.nonzero(np.ones(road.shape, bool))
                differences = blend_street_views(scene, pictured, chart, list(views.values()))
                continued = differences.apply(painted.reshape(-1, 3), *rest).reshape(painted.shape)
            made = {"material": field.chart_raster(chart), "pictured": painted, "continued": continued}
            turned = slice(None, None, 1 if side > 0 else -1)
            strips = _copied_strips(view.rgb[:, turned], known[:, turned], continued[:, turned])[:, turned]
            made |= {"strips": strips, "lines": _with_lines(view.rgb, known, continued)}
            truth = view.rgb.astype(np.float64)
            told.append(
                {
                    name: (
                        psnr(mean_squares(one, asked, DENSITY), mean_squares(truth, asked, DENSITY), ...),
                        psnr(one[asked].astype(np.float64), truth[asked], ...),
                    )
                    for name, one in made.items()
                }
            )
            if side > 0:
                near = np.ix_(np.flatnonzero(road.any(axis=1)), np.flatnonzero(np.abs(east[0]) < 11.0))
                seen = np.where(view.is_visible[..., None], view.rgb, 0)
                half = [np.where((known | ~(east < 0))[..., None], seen, one) for one in made.values()]
                rows.append(np.concatenate([one[near] for one in (seen, *half)], axis=1))
    if sheet is not None:
        cv2.imwrite(str(sheet), np.concatenate(rows)[..., ::-1])
    means = {
        name: dict(
            zip(("squares", "texels"), np.mean([one[name] for one in told], axis=0).round(2).tolist(), strict=True)
        )
        for name in MADE
    }
    better = {
        name: round(float(np.mean([one[name][0] > one["continued"][0] for one in told])), 2)
        for name in MADE
        if name != "continued"
    }
    return {"benchmark": "halves", "halves": len(told), **means, "better": better}


def _straight_street() -> tuple[Scene, MaterialField, shapely.LineString]:
    """A street from west to east between two rows of houses, on one square of ground, and its material."""
    line = shapely.LineString([(0, MIDDLE_M), (2 * MIDDLE_M, MIDDLE_M)])
    rows = (0.5, 2 * MIDDLE_M - 2.5)
    houses = [Building(str(y), shapely.box(0.5, y, 2 * MIDDLE_M - 0.5, y + 2), 8.0, "height", base=0.0) for y in rows]
    streets = [Street("street", None, line)]
    charts, mesh, _ = build_block_surfaces(
        houses, streets, terrain=build_terrain(houses, None), ground_margin=0.4, largest=80.0
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=2048, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY))
    return scene, MaterialField(scene, streets, seed=1), line


def _copied_strips(rgb: np.ndarray, known: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Fill the western half with strips of the known eastern half; `plain` where a strip is unknown."""
    middle, long, over = rgb.shape[1] // 2, round(STRIP_M * DENSITY), round(OVERLAP_M * DENSITY)
    source, mask = rgb[:, middle:].astype(np.float32), known[:, middle:]
    typical = np.nan_to_num(np.nanmedian(np.where(mask[..., None], source, np.nan), axis=1, keepdims=True))
    unusual = np.where(mask, np.minimum(((source - typical) ** 2).mean(axis=2), MOST_COST), MOST_COST / 2)
    asked = np.asarray(known).any(axis=1, keepdims=True).repeat(mask.shape[1], axis=1)
    reach = int(np.flatnonzero(mask.any(axis=0))[-1]) + 1
    starts = np.arange(0, max(1, reach - long - over), round(STEP_M * DENSITY))
    usual = np.array([unusual[:, at : at + long + over][asked[:, at : at + long + over]].mean() for at in starts])
    out, used = plain.astype(np.float32), np.zeros(len(starts))
    last: np.ndarray | None = None
    for end in range(middle, over, -long):
        costs = usual + MOST_COST / 5 * used
        if last is not None:
            # the end of a strip lies over the start of the one before it, towards the camera
            fits = [((source[:, at + long : at + long + over] - last) ** 2).mean(axis=2) for at in starts]
            costs = costs + np.array([np.minimum(one, MOST_COST)[asked[:, 0]].mean() for one in fits])
        best = int(np.argmin(costs))
        used = used / 2 + np.exp(-(((starts - starts[best]) / (long / 2)) ** 2))
        at, begin = int(starts[best]), max(0, end - long)
        piece = slice(at + long - (end - begin), at + long + (over if last is not None else 0))
        target = slice(begin, end + (over if last is not None else 0))
        copied = mask[:, piece].copy()
        if last is not None:
            copied[:, -over:] &= _least_cut(np.minimum(fits[best], MOST_COST))
        out[:, target] = np.where(copied[..., None], source[:, piece], out[:, target])
        last = out[:, begin : begin + over].copy()
    return np.rint(out).astype(np.uint8)


def _least_cut(cost: np.ndarray) -> np.ndarray:
    """Mask what lies before the path of least cost (h, w) from the first row to the last."""
    total = cost.astype(np.float64)
    for row in range(1, len(total)):
        before = np.pad(total[row - 1], 1, constant_values=np.inf)
        total[row] += np.minimum(np.minimum(before[:-2], before[1:-1]), before[2:])
    path = [int(total[-1].argmin())]
    for row in range(len(total) - 2, -1, -1):
        low = max(0, path[-1] - 1)
        path.append(low + int(total[row, low : path[-1] + 2].argmin()))
    return np.arange(cost.shape[1])[None] < np.array(path[::-1])[:, None]


def _with_lines(rgb: np.ndarray, known: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Add lines along the street that the known half shows along most of its length."""
    side = round(DENSITY)
    columns = rgb.shape[1] // side * side
    cells = np.where(known[..., None], rgb, np.nan)[:, :columns].reshape(len(rgb), -1, side, 3)
    empty: np.ndarray = np.asarray(np.isnan(cells).all(axis=2))
    means = np.where(empty, np.nan, np.nansum(cells, axis=2) / np.maximum((~np.isnan(cells)).sum(axis=2), 1))
    reach = round(LINE_WIDTH_M * DENSITY)
    wide = np.pad(means, ((reach, reach), (0, 0), (0, 0)), constant_values=np.nan)
    around = np.nanmedian(np.stack([wide[at : at + len(means)] for at in range(2 * reach + 1)]), axis=0)
    contrast = means - around
    line = np.nanmedian(contrast, axis=1)
    noise = np.nanmedian(np.abs(contrast - line[:, None]), axis=1).max(axis=1)
    is_long = empty[..., 0].sum(axis=1) <= empty.shape[1] - LINE_LENGTH_M
    is_clear = np.nan_to_num(np.abs(line).max(axis=1)) > np.maximum(LINE_CONTRAST, np.nan_to_num(noise, nan=np.inf))
    added = plain + np.where((is_long & is_clear).reshape(-1, 1), np.nan_to_num(line), 0)[:, None]
    return np.clip(np.rint(added), 0, 255).astype(np.uint8)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder of real data, with `panoramas`")
    parser.add_argument("--sheet", type=Path, help="picture of known and foretold ground, a row for each panorama")
    options = parser.parse_args()
    print(json.dumps(measure(options.data, options.sheet), indent=1))


if __name__ == "__main__":
    main()
