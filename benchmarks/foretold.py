"""Ground of a painted street foretold from one panorama of several: `python -m benchmarks.foretold` prints one JSON object.

A street whose ground is painted is seen by panoramas of known poses, darker than the paint. Of each in turn the ground is
taken as a run takes it, and the rest of the carriageway and its pavements is finished: from the material alone (`material`),
after the pictures (`pictured`, docs/decisions/0167), and with what viewpoints continue (`continued`, 0168). Over the texels
that another panorama shows and this one does not: PSNR in dB to the paint in the panorama's exposure, and with one factor a
channel aside; of means over squares of .5 m too, which the grain of the paint does not blur. decided: share of these texels
that a view decided; seconds of the street. Means over panoramas.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from typing import Any

import numpy as np
import shapely

from benchmarks.cameras import finer_ground, ground_points, photographed_street, psnr, shown_reader
from benchmarks.painter.street_paint import ground_pattern_painter
from benchmarks.painter.street_truth import SyntheticStreet, is_behind_cutout, synthetic_street
from benchmarks.street.truth import psnr as plain_psnr
from facade_core.core.types import Pose, Street
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, place_viewpoints
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.exposure import sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import mask_ground_occluders
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.street.continuation import blend_street_views, continue_street
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import FinishSettings, KnownTexture, finish_chart

MADE = ("material", "pictured", "continued")
# Side of the squares whose mean colours are compared, metres.
SQUARE_M = 0.5


def measure(*, seed: int = 3, buildings: int = 8, cameras: int = 4, width: int = 2048) -> dict[str, Any]:
    """Foretell a street from each of its panoramas."""
    street = synthetic_street(buildings, seed=seed)
    paint = ground_pattern_painter(street)
    poses, _, gains, images = photographed_street(street, cameras, width, seed, ground=paint)
    scene = finer_ground(street.scene)
    told = [_foretold(scene, street, images, poses, gains, number) for number in range(cameras)]
    means = {
        name: {key: round(statistics.mean(one[name][key] for one in told), 2) for key in told[0][name]}
        for name in told[0]
    }
    return {"benchmark": "foretold", "cameras": cameras, **means}


def _foretold(
    scene: Scene,
    street: SyntheticStreet,
    images: list[np.ndarray],
    poses: list[Pose],
    gains: list[float],
    number: int,
) -> dict[str, Any]:
    """Compare the street's ground as one panorama foretells it with the paint."""
    paint = ground_pattern_painter(street)
    image, pose = images[number], poses[number]
    seen_colours = sample_ground_colours(scene, image, pose).squares
    hidden = mask_ground_occluders(image, pose)
    camera = PanoramaCamera(image, pose, hidden, np.ones(3), typical_ground_colour(seen_colours))
    line = Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))
    plain = MaterialField(scene, (line,), seed=1)
    grounds = np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist()
    fused = {chart: fuse_ground_view(scene, chart, [camera]) for chart in grounds}
    shown = {chart: view for chart, view in fused.items() if view is not None}
    pictures = {chart: (view.rgb, view.is_visible) for chart, view in shown.items()}
    pictured = plain.with_pictured_ground(pictures)
    begun = time.process_time()
    positions, forward = place_viewpoints(line.line)
    viewpoints = [Viewpoint(n, 0, *place) for n, place in enumerate(zip(positions, forward, strict=True))]
    seen = [np.intersect1d(scene.visible_charts(viewpoint, 1024), grounds) for viewpoint in viewpoints]
    views = list(continue_street(scene, pictured, viewpoints, seen, pictures).values())
    seconds = time.process_time() - begun
    known = KnownTexture(shown_reader(scene, shown), shown)
    parts: dict[str, list[np.ndarray]] = {name: [] for name in (*MADE, "truth", "views")}
    squares: dict[str, list[np.ndarray]] = {name: [] for name in (*MADE, "truth")}
    for chart in grounds:
        size = scene.placement.shape(chart)
        points = ground_points(scene, chart, size)
        others = np.zeros(size, bool)
        for n, (other, at) in enumerate(zip(images, poses, strict=True)):
            rectified = rectify_chart_from_panorama(scene, chart, other, at, size)
            near = np.hypot(points[..., 0] - at.x, points[..., 1] - at.y) <= GROUND_REACH_M
            others |= rectified.seen & near & ~is_behind_cutout(street, points, at, assumed_pose=at) & (n != number)
        asked = others & (plain.ground_kinds(chart, 0) > 0)
        asked &= ~(shown[chart].is_visible if chart in shown else np.zeros(size, bool))
        if not asked.any():
            continue
        differences = blend_street_views(scene, pictured, chart, views) if views else None
        truth = gains[number] * paint(points.reshape(-1, 3)[:, :2]).reshape(points.shape)
        rasters: dict[str, np.ndarray] = {
            "material": finish_chart(scene, plain, chart, known)[0],
            "pictured": finish_chart(scene, pictured, chart, known)[0],
            "continued": finish_chart(scene, pictured, chart, known, FinishSettings(differences=differences))[0],
            "truth": truth,
        }
        for name, raster in rasters.items():
            parts[name].append(raster[asked])
            squares[name].append(mean_squares(raster, asked, float(scene.placement.texels_per_metre[chart])))
        parts["views"].append((differences.views if differences else np.zeros(size, np.uint16))[asked])
    whole = {name: np.concatenate(each) for name, each in parts.items()}
    coarse = {name: np.concatenate(each) for name, each in squares.items()}
    found: dict[str, Any] = {
        name: {
            "texels": plain_psnr(whole[name], whole["truth"], ...),
            "texels, a factor aside": psnr(whole[name].astype(np.float64), whole["truth"].astype(np.float64)),
            "squares": plain_psnr(coarse[name], coarse["truth"], ...),
            "squares, a factor aside": psnr(coarse[name], coarse["truth"]),
        }
        for name in MADE
    }
    return found | {"street": {"decided": float((whole["views"] > 0).mean()), "seconds": seconds}}


def mean_squares(raster: np.ndarray, asked: np.ndarray, density: float) -> np.ndarray:
    """Return the mean colour (k, 3) of each square, of those that lie in the mask `asked` as a whole."""
    side = round(SQUARE_M * density)
    rows, columns = (length // side * side for length in asked.shape)
    whole = asked[:rows, :columns].reshape(rows // side, side, -1, side).all(axis=(1, 3))
    means = raster[:rows, :columns].astype(np.float64).reshape(rows // side, side, -1, side, 3).mean(axis=(1, 3))
    return np.asarray(means[whole])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Ground of a painted street foretold from one panorama of several.")
    parser.add_argument("--seed", type=int, default=3, help="of the street, its paint and its cameras")
    parser.add_argument("--buildings", type=int, default=8, help="houses on the street, an even number")
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--width", type=int, default=2048, help="pixels of a panorama")
    print(json.dumps(measure(**vars(parser.parse_args())), indent=1))


if __name__ == "__main__":
    main()
