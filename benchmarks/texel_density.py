"""Density of facades by their pictures: `python -m benchmarks.texel_density --data DIR` prints one JSON object.

Facades that a picture raises, textured at the density by the streets and at that of their picture: of walls of both Amsterdam
blocks, and of single facades from photos: CMP facades that are as high as wide, rectified with PIXELS_PER_METRE, and taken by
a camera to the left of the front that looks up, with TAKEN_PER_METRE on average (`pixels_per_metre`: the true and the estimated
ones). Pairs are before and after; the facade of before is enlarged to the finer raster. gradient, laplacian: means of grey
over photographed texels, third the picture. psnr (dB), ssim: against the picture itself, rectified directly to the fine raster,
after a factor for each channel; detail that the picture lacks lowers both. seconds: of a processor. megatexels: of the atlas.
refused: raised facades whose photo cannot be used, with the reason. --sheets FOLDER keeps before, after and picture of each,
side by side.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import yaml

from catalogs.block.reader import Block, read_block
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import ImageError
from facade_core.core.provenance import Provenance
from facade_core.core.resizing import resize_image
from facade_core.facade.evidence import Evidence
from facade_core.facade.sharpening import enlarge_classes, enlarge_image
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.plan.plan import FacadeSightings, Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.plan.posed_pictures import place_pictured_facades
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.fan_out import process_batch
from tasks.engine.pending import find_pending_units
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.unit import Unit
from tasks.stages.facades.evidence import read_evidence, read_sharp_panorama
from tasks.stages.facades.picture_detail import working_size
from tasks.stages.facades.stage import list_facade_units
from tasks.stages.facades.worker import texture_from_pictures
from tasks.stages.ingest.photo_resolution import photo_resolution
from tasks.stages.ingest.task import ingest_block
from tasks.stages.order import STAGES_IN_ORDER
from tasks.stages.shared.images import read_bounded_picture

BLOCKS = ("amsterdam-dam", "amsterdam-ij")
# Stages that a block's facades from panoramas depend on.
POSE_STAGES = ("poses", "bundles")
# Photos of single facades: how many of each kind, pixels per metre of wall, and texels per metre of their block.
PHOTOS, PIXELS_PER_METRE, TEXELS_PER_METRE = 3, 35.0, 20.0
# Corners of a facade in a photo as taken, clockwise from the upper left, as shares of the facade's width and height.
TAKEN_CORNERS = ((0.17, 0.12), (0.95, 0.2), (0.93, 0.92), (0.08, 1.02))
TAKEN_SIZE = 1.1
TAKEN_PER_METRE = PIXELS_PER_METRE * cv2.contourArea(np.array(TAKEN_CORNERS, np.float32)) ** 0.5
STREET_OFFSET_M, HOUSE_DEPTH_M, GAP_M = 8.0, 10.0, 60.0
MEASURES = ("gradient", "laplacian", "psnr", "ssim")
SHEET_HEIGHT = 700


class Prepared(NamedTuple):
    """A block whose panoramas have their poses, with the units of its facades, and pixels per metre of their photos."""

    run: Run
    plan: Plan
    units: list[Unit]
    resolution: np.ndarray


def prepare(block: Block, out: Path) -> Prepared:
    """Ingest a block and refine the poses of its panoramas."""
    run = create_run(block, out)
    run = replace(run, ingested=ingest_block.fn(run, block).ingested)
    for kind in STAGES_IN_ORDER:
        if kind.stage in POSE_STAGES:
            pending = find_pending_units(run, block, kind)
            if pending.pieces and kind.function is not None:
                process_batch.fn(run, kind.stage, "1", kind.function, pending.pieces, SerialCompute())
    session = open_repository(run.store).readonly_session(BRANCH)
    plan, group = read_plan(session), open_root(session)
    return Prepared(run, plan, list_facade_units(run, block, plan, group), photo_resolution(block, plan))


def measure_block(block: Block, out: Path, sheets: Path | None) -> dict[str, Any]:
    """Measure the raised facades of a block, before and after."""
    run, plan, units, resolution = prepare(block, out)
    before = place_pictured_facades(replace(plan, sightings=FacadeSightings.empty()))
    densities = [one.scene.placement.texels_per_metre for one in (before, plan)]
    walls: dict[str, Any] = {}
    refused: dict[str, str] = {}
    for unit in units:
        chart = int(plan.facades.chart[unit.index])
        texels_per_metre = [float(density[chart]) for density in densities]
        if texels_per_metre[0] != texels_per_metre[1]:
            try:
                found = _measure_facade(run, (before, plan), unit, sheets)
            except ImageError as error:
                refused[unit.name] = str(error)
                continue
            if found is not None:
                walls[unit.name] = {"texels_per_metre": texels_per_metre} | found
                if block.photos:
                    true = PIXELS_PER_METRE if block.photos_rectified else TAKEN_PER_METRE
                    estimated = float(resolution[unit.index])
                    walls[unit.name]["pixels_per_metre"] = [round(true, 1), round(estimated, 1)]
    return {
        "megatexels": [round(float(one.texel_counts().sum()) / 1e6, 2) for one in (before, plan)],
        "by_facade": walls,
        "refused": refused,
    }


def _measure_facade(run: Run, plans: tuple[Plan, Plan], unit: Unit, sheets: Path | None) -> dict[str, Any] | None:
    """Texture a facade with the plans of before and after, and compare both with its picture; None without a picture."""
    plan, chart, imagery = plans[1], int(plans[1].facades.chart[unit.index]), unit.arguments[0]
    source = imagery.sources()[0]
    coarse = working_size(plan, chart, source)
    evidence = read_evidence(source, plan, chart, coarse, imagery, (), [])
    if evidence is None:
        return None
    size = (int(plan.scene.placement.height[chart]), int(plan.scene.placement.width[chart]))
    scale = float(plan.scene.placement.texels_per_metre[chart] / plan.street_density[chart])
    picture, shown = _rectify_picture(plan, chart, evidence, coarse, size, scale)
    facades, seconds = [], []
    for one in plans:
        begun = time.process_time()
        textured = texture_from_pictures(run, one, unit, [])
        seconds.append(round(time.process_time() - begun, 2))
        if textured is None or textured.facade is None:
            return None
        facades.append(textured.facade)
    images = [enlarge_image(facades[0].image, size, scale), facades[1].image]
    mask = shown & (facades[1].provenance == Provenance.PHOTO)
    if sheets is not None:
        _write_sheet(sheets / f"{unit.name}.png", [*images, picture])
    return {**_compare(images, picture, mask), "photographed": round(float(mask.mean()), 3), "seconds": seconds}


def _rectify_picture(
    plan: Plan, chart: int, evidence: Evidence, coarse: tuple[int, int], size: tuple[int, int], scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rectify the picture of each texel directly to a size (height, width): (h, w, 3) uint8, and where it shows the wall."""
    if evidence.photo is not None:
        rows, columns = (round(side * scale) for side in coarse)
        whole = resize_image(evidence.photo.image, (rows, columns))
        pad = [(0, max(0, size[0] - rows)), (0, max(0, size[1] - columns)), (0, 0)]
        return np.pad(whole, pad, mode="edge")[: size[0], : size[1]], np.ones(size, bool)
    picture, shown = np.zeros((*size, 3), np.uint8), np.zeros(size, bool)
    if evidence.picture is None:
        return picture, shown
    source = enlarge_classes(evidence.picture + 1, size, scale)
    for number, (path, pose) in enumerate(evidence.pictures, 1):
        view = rectify_chart_from_panorama(plan.scene, chart, read_sharp_panorama(path, pose), pose, size)
        own = (source == number) & view.seen
        picture[own], shown = view.rgb[own], shown | own
    return picture, shown


def _compare(images: list[np.ndarray], picture: np.ndarray, mask: np.ndarray) -> dict[str, list[float]]:
    """Compare images (h, w, 3) with a picture where the mask (h, w) is True."""
    from skimage.metrics import structural_similarity

    found: dict[str, list[float]] = {name: [] for name in MEASURES}
    truth = picture.astype(np.float64)
    for image in (*images, picture):
        values = image.astype(np.float64)
        values *= (values[mask] * truth[mask]).sum(axis=0) / (values[mask] ** 2).sum(axis=0)
        grey, true_grey = (one.mean(axis=-1) for one in (values, truth))
        found["gradient"].append(float(np.hypot(*np.gradient(grey))[mask].mean()))
        found["laplacian"].append(float(np.abs(cv2.Laplacian(grey, cv2.CV_64F))[mask].mean()))
        if image is not picture:
            error = ((values - truth)[mask] ** 2).mean()
            found["psnr"].append(float(10 * np.log10(255**2 / error)))
            every = structural_similarity(grey, true_grey, data_range=255, full=True)[1]
            found["ssim"].append(float(every[mask].mean()))
    return {name: [round(value, 3) for value in values] for name, values in found.items()}


def _write_sheet(path: Path, images: list[np.ndarray]) -> None:
    """Write the lower left of images (h, w, 3) of one size side by side."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = min(images[0].shape[0], SHEET_HEIGHT)
    cut = [image[image.shape[0] - rows :, :SHEET_HEIGHT] for image in images]
    cv2.imwrite(str(path), np.concatenate([np.pad(one, ((0, 0), (0, 8), (0, 0))) for one in cut], axis=1)[..., ::-1])


def write_photo_block(data: Path, folder: Path, *, rectified: bool) -> Path:
    """Write a block of houses along a street, each with a photo of its front."""
    photos, houses, x = folder / "photos", [], 0.0
    photos.mkdir(parents=True)
    for number, image in enumerate(_read_facades(data)):
        height, width = image.shape[:2]
        wide, high = width / PIXELS_PER_METRE, height / PIXELS_PER_METRE
        low, back = STREET_OFFSET_M, STREET_OFFSET_M + HOUSE_DEPTH_M
        ring = [(x, low), (x + wide, low), (x + wide, back), (x, back), (x, low)]
        houses.append(_feature("Polygon", [ring], id=f"h{number}", height=high, **{"roof:shape": "flat"}))
        if not rectified:
            image = _take_photo(image)
        cv2.imwrite(str(photos / f"h{number}-0.png"), image[..., ::-1])
        x += wide + GAP_M
    streets = [_feature("LineString", [(-10.0, 0.0), (x, 0.0)], id="1")]
    for name, features in (("buildings", houses), ("streets", streets)):
        (folder / f"{name}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    stated = {
        "name": "photos",
        "crs": "EPSG:32635",
        "buildings": {"path": "buildings.geojson", "crs": "EPSG:32635"},
        "streets": {"path": "streets.geojson", "crs": "EPSG:32635"},
        "imagery": {
            "photos": {"path": "photos", "rectified": rectified},
            "exemplars": {"path": str(data.resolve() / "facades" / "ecp" / "images")},
        },
        "texture": {"texels_per_metre": TEXELS_PER_METRE, "panorama_width": 256},
    }
    (folder / "block.yaml").write_text(yaml.safe_dump(stated))
    return folder / "block.yaml"


def _read_facades(data: Path) -> Iterator[np.ndarray]:
    """Yield rectified facades (h, w, 3) uint8 that are about as high as wide, spread over the set."""
    paths = sorted((data / "facades" / "cmp").rglob("*.jpg"))
    images = (read_bounded_picture(path).rgb for path in paths)
    fitting = [image for image in images if 0.8 <= image.shape[1] / image.shape[0] <= 1.25]
    yield from fitting[:: max(1, len(fitting) // PHOTOS)][:PHOTOS]


def _take_photo(image: np.ndarray) -> np.ndarray:
    """Return a facade as a camera to the left of its middle sees it that looks up, before a sky."""
    height, width = image.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    seen = (np.array(TAKEN_CORNERS) * (width, height)).astype(np.float32)
    size = (round(TAKEN_SIZE * width), round(TAKEN_SIZE * height))
    sky = np.full((*size[::-1], 3), (170, 190, 215), np.uint8)
    turned = cv2.getPerspectiveTransform(corners, seen)
    return cv2.warpPerspective(image, turned, size, sky, flags=cv2.INTER_AREA, borderMode=cv2.BORDER_TRANSPARENT)


def _feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    east, north = 385_000.0, 6_671_000.0
    if kind == "Polygon":
        moved: Any = [[(east + x, north + y) for x, y in ring] for ring in coordinates]
    else:
        moved = [(east + x, north + y) for x, y in coordinates]
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": moved}}


def average(facades: list[dict[str, Any]]) -> dict[str, Any]:
    """Average the measures of facades, and add up their seconds."""
    if not facades:
        return {"facades": 0}
    means = {
        name: [round(statistics.mean(values), 3) for values in zip(*(one[name] for one in facades), strict=True)]
        for name in MEASURES
    }
    seconds = [round(sum(values), 1) for values in zip(*(one["seconds"] for one in facades), strict=True)]
    return {"facades": len(facades), **means, "seconds": seconds}


def main() -> None:
    """Measure both kinds and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "--data", type=Path, required=True, help="folder with city/amsterdam, facades/cmp and facades/ecp"
    )
    parser.add_argument("--sheets", type=Path, help="folder for the compared pictures")
    options = parser.parse_args()
    data = options.data.resolve()
    os.environ["STREETLOOM_DATA"] = str(data)
    result: dict[str, Any] = {"benchmark": "texel_density"}
    with tempfile.TemporaryDirectory(prefix="texel-density-") as name:
        folder = Path(name)
        files = {block: EXAMPLE_BLOCKS_FOLDER / f"{block}.yaml" for block in BLOCKS}
        for kind in ("rectified", "taken"):
            files[kind] = write_photo_block(data, folder / kind, rectified=kind == "rectified")
        for block, file in files.items():
            sheets = None if options.sheets is None else options.sheets / block
            result[block] = measure_block(read_block(file), folder / f"{block}-run", sheets)
    result["walls"] = average([one for block in BLOCKS for one in result[block]["by_facade"].values()])
    result["photos"] = average([one for kind in ("rectified", "taken") for one in result[kind]["by_facade"].values()])
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
