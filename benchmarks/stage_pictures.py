"""The pictures of docs/stages: what each stage takes and what it gives.

    python -m benchmarks.stage_pictures out/demo

writes those of a run that is published, and those that need none: painted walls and streets whose truth is known. --only NAME
makes some of them; --facade is the photographed facade that is shown, by its id.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import shapely

from benchmarks.cameras import POSE_NOISE_DEG, POSE_NOISE_M, photographed_street, refined, shown_reader
from benchmarks.painter.exemplars import paint_exemplar
from benchmarks.painter.street_paint import ground_pattern_painter, side_pattern_painter
from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from benchmarks.photographs import camera as photographer
from benchmarks.photographs import photograph
from facade_core.atlas.rasters import read_chart_raster
from facade_core.core.types import Pose, Street
from facade_core.export.pictures.rendering import encode_image, render_perspective
from facade_core.export.pictures.stage_pictures import StoredFacade, iterate_stage_pictures
from facade_core.export.pictures.views import choose_cameras, view_names
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.walls import WallRole, main_surface_mask
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.exposure import estimate_common_exposure, sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders, mask_ground_occluders, mask_model_edges
from facade_core.imagery.cameras.walls import fuse_wall_view
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.imagery.rectify.photo import rectify
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart
from tasks.publish.published_run import PublishedBlock, open_published_run

PAPER, GAP = 255, 8
# What a place of the atlas is drawn in where its colour is shown by where it comes from: unseen, material, translated,
# synthesised, inpainted, photo.
SOURCES = np.array(
    [(0, 0, 0), (196, 186, 168), (150, 170, 90), (92, 140, 200), (232, 120, 40), (70, 160, 80)], np.uint8
)
ROLES = {WallRole.STREET: (200, 60, 40), WallRole.SIDE: (230, 160, 60), WallRole.BACK: (120, 120, 120)}
SEED, WIDTH = 3, 2048
# Pixels of a map.
ACROSS = 900


def beside(pictures: Sequence[np.ndarray], height: int) -> np.ndarray:
    """Pictures (h, w, 3) uint8 beside each other on white, all of one height in pixels."""
    import cv2

    parts = []
    for picture in pictures:
        width = max(1, round(picture.shape[1] * height / picture.shape[0]))
        how = cv2.INTER_AREA if picture.shape[0] > height else cv2.INTER_NEAREST
        parts += [cv2.resize(picture, (width, height), interpolation=how), np.full((height, GAP, 3), PAPER, np.uint8)]
    return np.concatenate(parts[:-1], axis=1)


def ingest(found: PublishedBlock) -> np.ndarray:
    """A block from above: walls by what they are to the streets, and viewpoints."""
    plan = found.plan
    every = list(range(len(plan.viewpoints)))
    return from_above(plan, np.ones(len(plan.facades), bool), ((every, (40, 90, 170), 4),))


def from_above(
    plan: Plan, walls: np.ndarray, dots: Sequence[tuple[Sequence[int], tuple[int, int, int], int]]
) -> np.ndarray:
    """Facades (n,) bool of a plan in the colours of ROLES, and viewpoints as dots: which, their colour, their radius."""
    from PIL import Image, ImageDraw

    facades, charts = plan.facades, plan.scene.charts
    start = charts.origin[facades.chart][:, :2]
    lines = np.stack([start, start + charts.axis_u[facades.chart][:, :2] * facades.width[:, None]], axis=1)
    low, high = lines.min(axis=(0, 1)) - 5, lines.max(axis=(0, 1)) + 5
    scale = ACROSS / float((high - low)[0])

    def on(points: np.ndarray) -> list[tuple[float, float]]:
        return [(float(x), float(y)) for x, y in (points - low) * (scale, -scale) + (0, (high - low)[1] * scale)]

    drawn = Image.new("RGB", (ACROSS, int(np.ceil((high - low)[1] * scale))), (246, 244, 240))
    pen = ImageDraw.Draw(drawn)
    for line, role in zip(lines[walls], facades.role[walls].tolist(), strict=True):
        pen.line(on(line), fill=ROLES[role], width=6 if role == WallRole.STREET else 3)
    for which, colour, radius in dots:
        for x, y in on(np.array([plan.viewpoints[number].position[:2] for number in which]).reshape(-1, 2)):
            pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)
    return np.asarray(drawn)


def imagery(found: PublishedBlock) -> np.ndarray:
    """A block's facades on streets, panoramas every few metres, and the fewest that show what all of them show."""
    from facade_core.plan.panorama_choice import choose_panoramas

    plan = found.plan
    poses = [Pose(x, y, z, 0.0) for x, y, z in (view.position.tolist() for view in plan.viewpoints)]
    chosen = set(choose_panoramas(plan.scene, plan.facades, poses, [(4096, 8192)] * len(poses)).chosen)
    on_street = plan.facades.role == WallRole.STREET
    rest = [number for number in range(len(poses)) if number not in chosen]
    return from_above(plan, on_street, ((rest, (150, 150, 150), 4), (sorted(chosen), (40, 90, 170), 9)))


def staged(found: PublishedBlock, facade: str, titles: Sequence[str], height: int = 420) -> np.ndarray:
    """Some of the stages of a facade, by the names that the viewer or the report has for them."""
    number = found.plan.facades.id.index(facade)
    chart, record = int(found.plan.facades.chart[number]), found.records[number]
    exemplars = {made["unit"]: made["folder"] for made in found.journals["exemplars"] if made and "folder" in made}
    stored = StoredFacade(found.group, found.plan.scene.placement, chart, record, exemplars)
    named = {stage.viewer.name: stage.draw for stage in iterate_stage_pictures(stored) if stage.viewer is not None}
    return beside([named[title]() for title in titles], height)


def first_made(found: PublishedBlock) -> str:
    """The first facade on a street whose texture is an exemplar's."""
    facades = found.plan.facades
    exemplars = {Path(made["unit"]).stem for made in found.journals["exemplars"] if made}
    for name, role, record in zip(facades.id, facades.role.tolist(), found.records, strict=True):
        if role == WallRole.STREET and record and Path(record["source"] or "").stem in exemplars:
            return name
    raise SystemExit(f"{found.block}: no facade on a street is made from an exemplar; name one with --made")


def surfaces(found: PublishedBlock) -> np.ndarray:
    """A street as it is textured, and by where each texel comes from."""
    views = dict(zip(view_names(found.plan), choose_cameras(found.plan, found.records), strict=True))
    scene, camera = found.plan.scene, views["street-0"]

    def source(chart: int) -> np.ndarray:
        return SOURCES[read_chart_raster(found.group, scene.placement, chart, "atlas/provenance")]

    drawn = [render_perspective(scene, camera, raster) for raster in (found.textured_mesh.raster, source)]
    return beside(drawn, 380)


def publish(found: PublishedBlock) -> np.ndarray:
    """A page of the atlas, and the block from afar."""
    above = dict(zip(view_names(found.plan), choose_cameras(found.plan, found.records), strict=True))["above"]
    return beside([found.page(0), render_perspective(found.plan.scene, above, found.textured_mesh.raster)], 520)


def rectified() -> np.ndarray:
    """A painted facade, as a known camera takes it, and as it is rectified without its focal length."""
    chance = np.random.default_rng(SEED)
    facade = paint_exemplar(0, seed=SEED).image
    height = 18.0
    width = height * facade.shape[1] / facade.shape[0]
    taken = photograph(facade, photographer(chance, width, height), width, height, chance)
    made = rectify(taken)
    return beside([taken, made.image], 420)


def _street() -> tuple[SyntheticStreet, list[Pose], list[Pose], list[np.ndarray]]:
    """A painted street, the true poses of its cameras, those that are stated, and the panoramas."""
    street = synthetic_street(4, seed=SEED)
    chance = np.random.default_rng(SEED)
    true, given, images = [], [], []
    for number in range(3):
        x, y = street.world_point((number + 0.5) / 3 * street.length, (-1) ** number * 1.5)
        true.append(Pose(float(x), float(y), 2.5, float(chance.uniform(0, 360))))
        angle = chance.uniform(0, 2 * np.pi)
        given.append(
            Pose(
                true[-1].x + POSE_NOISE_M * float(np.cos(angle)),
                true[-1].y + POSE_NOISE_M * float(np.sin(angle)),
                2.5,
                true[-1].heading + POSE_NOISE_DEG,
            )
        )
        gain = float(chance.uniform(0.7, 1.0))
        images.append(
            render_street_panorama(
                street, true[-1], WIDTH, gain=gain, seed=number, ground=ground_pattern_painter(street)
            )
        )
    return street, true, given, images


def poses() -> np.ndarray:
    """A wall out of a panorama by the pose that was stated, by the refined one, and by the true one."""
    street, true, given, images = _street()
    scene, chart = street.scene, street.charts[0]
    refined = refine_pose(scene, images[0], given[0]).pose
    size = scene.placement.shape(chart)
    views = [rectify_chart_from_panorama(scene, chart, images[0], pose, size) for pose in (given[0], refined, true[0])]
    return beside([view.rgb for view in views], 420)


def ground() -> np.ndarray:
    """The ground between two rows of houses: of material, as cameras show it, and finished, where that goes on by example."""
    street, _, given, images = _street()
    scene = street.scene
    seen = [refine_pose(scene, image, pose).pose for image, pose in zip(images, given, strict=True)]
    squares = [sample_ground_colours(scene, image, pose).squares for image, pose in zip(images, seen, strict=True)]
    found = [
        PanoramaCamera(image, pose, mask_ground_occluders(image, pose), factor, typical_ground_colour(own))
        for image, pose, factor, own in zip(
            images, seen, estimate_common_exposure(squares).factors, squares, strict=True
        )
    ]
    shown = {
        c: fuse_ground_view(scene, c, found) for c in np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist()
    }
    chart = max(shown, key=lambda c: float(part.is_visible.sum()) if (part := shown[c]) else 0.0)
    size = scene.placement.shape(chart)
    line = Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))
    materials = MaterialField(scene, (line,), seed=1)
    material = materials.chart_raster(chart).reshape(*size, 3)
    pictured = {c: part for c, part in shown.items() if part is not None}
    taken = np.where(pictured[chart].is_visible[..., None], pictured[chart].rgb, material)
    known = KnownTexture(shown_reader(scene, pictured), pictured)
    return beside([material, taken, finish_chart(scene, materials, chart, known)[0]], 420)


def walls() -> np.ndarray:
    """A side wall beside a gap: of material, as cameras show it, finished, and as it is."""
    street = synthetic_street(6, seed=SEED, with_roofs=True)
    scene, paint = street.scene, side_pattern_painter(street)
    _, given, _, images = photographed_street(
        street, 3, WIDTH, SEED, ground=ground_pattern_painter(street), sides=paint
    )
    poses = refined(scene, images, given)
    squares = [sample_ground_colours(scene, image, pose).squares for image, pose in zip(images, poses, strict=True)]
    seen = [
        PanoramaCamera(
            image,
            pose,
            mask_building_occluders(image, pose) | mask_model_edges(scene, pose, (image.shape[0], image.shape[1])),
            factor,
            typical_ground_colour(own),
        )
        for image, pose, factor, own in zip(
            images, poses, estimate_common_exposure(squares).factors, squares, strict=True
        )
    ]
    plain = [c for c in np.flatnonzero(main_surface_mask(scene.charts)).tolist() if c not in street.charts]
    shown = {c: part for c in plain if (part := fuse_wall_view(scene, c, seen)) is not None}
    chart = max(shown, key=lambda c: float(shown[c].is_visible.sum()))
    size = scene.placement.shape(chart)
    line = Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))
    materials = MaterialField(scene, (line,), seed=1)
    without, known = (
        KnownTexture(shown_reader(scene, {}), ()),
        KnownTexture(shown_reader(scene, shown), shown, shown),
    )
    material, finished = (finish_chart(scene, materials, chart, one)[0] for one in (without, known))
    taken = np.where(shown[chart].is_visible[..., None], shown[chart].rgb, 255)
    x, y = np.meshgrid(*((np.arange(n) + 0.5) / scene.placement.texels_per_metre[chart] for n in size[::-1]))
    truth = paint(np.full(x.size, chart), x.ravel(), y.ravel()).reshape(*size, 3).astype(np.uint8)
    return beside([material, taken, finished, truth], 420)


def of_run(found: PublishedBlock, facade: str, made: str) -> dict[str, Callable[[], np.ndarray]]:
    """The pictures of a run: `facade` is one of which there is a photo, `made` one that an exemplar textures."""
    return {
        "imagery": lambda: imagery(found),
        "ingest": lambda: ingest(found),
        "parse": lambda: staged(found, facade, ["rectified", "parse", "lattice"]),
        "completion": lambda: staged(found, facade, ["hidden", "layout"]),
        "inpainting": lambda: staged(found, facade, ["rectified", "hidden", "texture"]),
        "variation": lambda: staged(found, facade, ["level-0", "sample"]),
        "retargeting": lambda: staged(found, made, ["source", "texture"]),
        "surfaces": lambda: surfaces(found),
        "publish": lambda: publish(found),
    }


OF_NOTHING: dict[str, Callable[[], np.ndarray]] = {
    "rectify": rectified,
    "poses": poses,
    "ground": ground,
    "walls": walls,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="the folder of a run that is published")
    parser.add_argument("--facade", default="r168305-2", help="a facade of which there is a photo")
    parser.add_argument("--made", default="", help="one that is made from an exemplar; by itself the first on a street")
    parser.add_argument("--only", nargs="+", default=[], help="the names of pictures")
    parser.add_argument("--to", type=Path, default=Path("docs/stages"), help="folder of the files")
    asked = parser.parse_args()
    with open_published_run(asked.out) as found:
        drawn = {**of_run(found, asked.facade, asked.made or first_made(found)), **OF_NOTHING}
        for name in asked.only or drawn:
            (asked.to / f"{name}.jpg").write_bytes(encode_image(drawn[name](), "JPEG", quality=82))


if __name__ == "__main__":
    main()
