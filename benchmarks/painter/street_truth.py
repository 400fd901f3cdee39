"""Short synthetic street with known textures, and panoramas of it by exact ray casting: truth for posed imagery."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numba import njit

from benchmarks.painter.exemplars import paint_exemplar_set
from benchmarks.painter.facade import PaintedFacade
from benchmarks.painter.occluders import paint_occluders
from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, FloatArray, Int64Array, IntArray, UInt8Array
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import LayoutError
from facade_core.core.lens_projection import picture_rays
from facade_core.core.types import Building, Pose, Roof, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_from_world, camera_position

# Distance from the axis of the street to its facades.
STREET_HALF_WIDTH_M = 9.0
# Distance from the occluders to the facades.
CUTOUT_DISTANCE_M = 3.0
BUILDING_DEPTH_M = 10.0
# Gap between the second and third building of a row.
BUILDING_GAP_M = 4.0
# Grid coordinates of the start, and direction from the east: no axis of the grid is special.
STREET_ORIGIN_M = np.array([4200.0, 7300.0])
TURN_DEG = 23.0
# World places (n, 2) -> colours (n, 3).
GroundPaint = Callable[[Float64Array], Float32Array]
# Charts (n,) and metres right and down on each (n,) -> colours (n, 3).
SidePaint = Callable[[IntArray, Float64Array, Float64Array], Float32Array]
# Roofs of a row in turn, with their height over the eaves; the street sees all of them.
ROOFS: tuple[Roof | None, ...] = (Roof("gabled", 7.0), Roof("mansard", 5.0, pitch=68.0), None)
# Rows of pixels rendered at once, which bounds memory.
ROWS_PER_BAND = 128


@dataclass(frozen=True, eq=False)
class SyntheticStreet:
    """Synthetic street with its ground truth.

    Attributes
    ----------
    scene : geometry and charts.
    charts : chart of each facade.
    facades : painted truth of each facade.
    cutouts : per facade the RGBA picture (H, W, 4) uint8 of its occluders, of the facade's size, on an upright plane
        CUTOUT_DISTANCE_M before it.
    axis : (2,) unit direction of the street.
    length : metres.
    houses : the buildings.
    """

    scene: Scene
    charts: tuple[int, ...]
    facades: tuple[PaintedFacade, ...]
    cutouts: tuple[UInt8Array, ...]
    axis: Float64Array
    length: float
    houses: tuple[Building, ...]

    def world_point(self, along: float, across: float) -> Float64Array:
        """Return world x, y of a point `along` metres down the street and `across` metres to its left."""
        return STREET_ORIGIN_M + along * self.axis + across * np.array([-self.axis[1], self.axis[0]])


def synthetic_street(
    buildings: int = 8, *, seed: int, occluders: int = 2, texels_per_metre: float = 25.0, with_roofs: bool = False
) -> SyntheticStreet:
    """Build two rows of terraced houses with painted facades and occluders as cut-outs before each.

    Parameters
    ----------
    buildings : number of houses in both rows.
    seed : random seed.
    occluders : number of occluders before each facade.
    texels_per_metre : resolution of the facades.
    with_roofs : add ROOFS; flat roofs without.

    Raises
    ------
    LayoutError
        `buildings` is less than two or odd.
    """
    if buildings < 2 or buildings % 2:
        raise LayoutError(f"a street of {buildings!r} buildings; use an even number of at least 2")
    painted = paint_exemplar_set(buildings, seed=seed, metres_per_pixel=1 / texels_per_metre)
    turn = np.radians(TURN_DEG)
    axis = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-axis[1], axis[0]])
    houses, ends = [], []
    for row, side in enumerate((1.0, -1.0)):
        along = 0.0
        for number, facade in enumerate(painted[row::2]):
            height, width = (n / texels_per_metre for n in facade.image.shape[:2])
            along += BUILDING_GAP_M if number == 2 else 0.0
            corners = [(a, side * b) for a, b in ((along, STREET_HALF_WIDTH_M), (along + width, STREET_HALF_WIDTH_M))]
            corners += [
                (along + width, side * (STREET_HALF_WIDTH_M + BUILDING_DEPTH_M)),
                (along, side * (STREET_HALF_WIDTH_M + BUILDING_DEPTH_M)),
            ]
            outline = shapely.Polygon([STREET_ORIGIN_M + a * axis + b * across for a, b in corners])
            roof = ROOFS[(row + number) % len(ROOFS)] if with_roofs else None
            houses.append(Building(f"{row}-{number}", outline, height, "height", base=0.0, roof=roof))
            along += width
        ends.append(along)
    scene = street_scene(houses, axis, max(ends), texels_per_metre)
    charts = scene.charts
    walls, normal = charts.kind == ChartKind.WALL, charts.normals()
    fronts = []
    for index in range(buildings):
        side = 1.0 if index < buildings // 2 else -1.0
        front = walls & (charts.building == index) & (normal[:, :2] @ across * side < -0.99)
        fronts.append(int(np.flatnonzero(front)[0]))
    ordered = tuple([*painted[0::2], *painted[1::2]])
    cutouts = tuple(_paint_cutout(f, occluders, np.random.default_rng([seed, i])) for i, f in enumerate(ordered))
    return SyntheticStreet(scene, tuple(fronts), ordered, cutouts, axis, max(ends), tuple(houses))


def street_scene(houses: Sequence[Building], axis: Float64Array, length: float, texels_per_metre: float) -> Scene:
    """Build the scene of houses along a street."""
    line = shapely.LineString([STREET_ORIGIN_M, STREET_ORIGIN_M + length * axis])
    charts, mesh, _ = build_block_surfaces(
        houses, [Street("street", None, line)], terrain=build_terrain(houses, None), ground_margin=40.0, largest=80.0
    )
    placement = pack_charts(charts.size, texels_per_metre, charts.building, page=2048, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, texels_per_metre))


def render_street_panorama(
    street: SyntheticStreet,
    pose: Pose,
    width: int,
    *,
    gain: float = 1.0,
    seed: int = 0,
    ground: GroundPaint | None = None,
    sides: SidePaint | None = None,
) -> UInt8Array:
    """Render the picture of a camera: facades, cut-outs, plain other surfaces and a bright sky.

    Parameters
    ----------
    street : the street.
    pose : pose of the camera.
    width : pixels; the height of a panorama is half of it, of a picture of a lens as the lens has it.
    gain : exposure.
    seed : seed of the sensor noise, 1 % of full scale.
    ground : colours of the ground; mottled grey if None.
    sides : colours of walls other than the facades and of roofs; mottled grey if None.

    Returns
    -------
    image : (height, width, 3) uint8.
    """
    lens = pose.lens
    height = width // 2 if lens is None else round(width * lens.size[1] / lens.size[0])
    rotation = camera_from_world(pose)
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    lens_rays = None if lens is None else picture_rays(lens, (height, width))
    image = np.empty((height, width, 3), np.float32)
    sheet, left = _facade_sheet(street)
    for top in range(0, height, ROWS_PER_BAND):
        rows = min(ROWS_PER_BAND, height - top)
        latitude = (0.5 - (np.arange(top, top + rows) + 0.5) / height) * np.pi
        camera = np.empty((rows, width, 3), np.float32)
        if lens_rays is not None:
            camera[:] = lens_rays[top : top + rows]
        else:
            camera[..., 0] = np.cos(latitude)[:, None] * np.sin(longitude)
            camera[..., 1] = -np.sin(latitude)[:, None]
            camera[..., 2] = np.cos(latitude)[:, None] * np.cos(longitude)
        rays = camera @ rotation.astype(np.float32)
        image[top : top + rows] = _trace_colours(street, camera_position(pose), rays, sheet, left, ground, sides)
    image = gain * image + np.random.default_rng(seed).normal(0, 2.55, image.shape).astype(np.float32)
    return np.round(np.clip(image, 0, 255)).astype(np.uint8)


def cutout_mask(
    street: SyntheticStreet, facade: int, pose: Pose, size: tuple[int, int], *, assumed_pose: Pose
) -> BoolArray:
    """Return the pixels of a facade's raster that show a cut-out.

    The raster was resampled from a panorama under a wrong pose.

    Parameters
    ----------
    street : the street.
    facade : number of the facade.
    pose : true pose of the panorama.
    size : rows and columns of the raster.
    assumed_pose : pose that the resampling used.

    Returns
    -------
    mask : (h, w) bool.
    """
    charts, chart = street.scene.charts, street.charts[facade]
    rows, columns = size
    extent = np.array([street.facades[facade].image.shape[i] for i in (1, 0)]) / street.scene.spec.texels_per_metre
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns * extent[0], (np.arange(rows) + 0.5) / rows * extent[1])
    return is_behind_cutout(street, charts.points(chart, x, y), pose, assumed_pose=assumed_pose)


def is_behind_cutout(street: SyntheticStreet, points: Float64Array, pose: Pose, *, assumed_pose: Pose) -> BoolArray:
    """Return for world points whether they show a cut-out, as `cutout_mask` does.

    Parameters
    ----------
    street : the street.
    points : (..., 3) world metres.
    pose : true pose of the panorama.
    assumed_pose : pose that the resampling used.

    Returns
    -------
    mask : (...,) bool.
    """
    rays = (points - camera_position(assumed_pose)) @ camera_from_world(assumed_pose).T @ camera_from_world(pose)
    nearest, colour = np.ones(points.shape[:-1], np.float32), np.zeros(points.shape, np.float32)
    return _blend_cutouts(street, camera_position(pose), rays, nearest, colour) > 0.02


def _paint_cutout(facade: PaintedFacade, count: int, rng: np.random.Generator) -> UInt8Array:
    """Return the occluders alone, (H, W, 4) uint8, of the facade's size."""
    image, mask = paint_occluders(facade.image, facade.metres_per_pixel, count, rng)
    return np.dstack([image, np.where(mask, 255, 0).astype(np.uint8)])


def _facade_sheet(street: SyntheticStreet) -> tuple[UInt8Array, Int64Array]:
    """Return all facades in one row followed by a tile of mottled grey, and the first column of each."""
    images = [facade.image for facade in street.facades]
    rng = np.random.default_rng(len(images))
    height = max(512, *(image.shape[0] for image in images))
    grain = rng.normal(128, 9, (512, 512)) + rng.normal(0, 10, (64, 64)).repeat(8, 0).repeat(8, 1)
    tile = np.clip(grain, 0, 255).astype(np.uint8)[..., None].repeat(3, 2)
    padded = [np.pad(image, ((0, height - len(image)), (0, 0), (0, 0)), mode="edge") for image in (*images, tile)]
    return np.concatenate(padded, axis=1), np.cumsum([0, *(image.shape[1] for image in images)])


def _trace_colours(
    street: SyntheticStreet,
    origin: Float64Array,
    rays: Float32Array,
    sheet: UInt8Array,
    left: Int64Array,
    ground: GroundPaint | None,
    sides: SidePaint | None,
) -> Float32Array:
    """Return colours (h, w, 3) float32 along rays (h, w, 3)."""
    import cv2

    scene, charts = street.scene, street.scene.charts
    distance, chart = scene.caster.cast(origin, rays)
    front = np.full(len(charts) + 1, len(street.charts), np.int32)
    front[list(street.charts)] = np.arange(len(street.charts))
    facade = front[chart]
    offset = np.where(np.isfinite(distance), distance, 0)[..., None] * rays + (origin - charts.origin[chart])
    density = scene.spec.texels_per_metre
    x = np.einsum("...i,...i", offset, charts.axis_u[chart]) * density
    y = np.einsum("...i,...i", offset, charts.axis_v[chart]) * density
    widths = np.array([f.image.shape[1] for f in street.facades] + [512])
    heights = np.array([f.image.shape[0] for f in street.facades] + [512])
    plain = facade == len(street.charts)
    column = left[facade] + np.where(plain, np.minimum(x % 512, 511), np.clip(x - 0.5, 0, widths[facade] - 1))
    row = np.where(plain, np.minimum(y % 512, 511), np.clip(y - 0.5, 0, heights[facade] - 1))
    colour = cv2.remap(sheet, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR).astype(np.float32)
    tint = np.random.default_rng(0).uniform(0.5, 1.2, (len(charts) + 1, 3)).astype(np.float32)
    tint[:-1][charts.kind == ChartKind.GROUND] = [0.75, 0.74, 0.72]
    tint[list(street.charts)] = 1
    colour *= tint[chart]
    if ground is not None:
        on_ground = np.isfinite(distance) & (charts.kind[chart] == ChartKind.GROUND)
        colour[on_ground] = ground((origin + distance[on_ground, None] * rays[on_ground])[:, :2])
    if sides is not None:
        on_side = np.isfinite(distance) & plain & (charts.kind[chart] != ChartKind.GROUND)
        colour[on_side] = sides(chart[on_side], x[on_side] / density, y[on_side] / density)
    rise = np.clip(rays[..., 2:], 0, 1)
    sky = np.array([225, 232, 240], np.float32) - rise * np.array([70, 45, 10], np.float32)
    colour = np.where(np.isfinite(distance)[..., None], colour, sky)
    colour = np.ascontiguousarray(colour, np.float32)
    _blend_cutouts(street, origin, rays, distance, colour)
    return colour


def _blend_cutouts(
    street: SyntheticStreet, origin: Float64Array, rays: FloatArray, nearest: Float32Array, colour: Float32Array
) -> Float32Array:
    """Blend the cut-outs nearer than `nearest` (in ray lengths) along rays (..., 3) over `colour`, in place.

    Returns the share of each ray that they stop (...,).
    """
    charts, fronts = street.scene.charts, list(street.charts)
    normal = charts.normals()[fronts]
    corner = charts.origin[fronts] + CUTOUT_DISTANCE_M * normal - origin
    middle = corner + charts.size[fronts, :1] / 2 * charts.axis_u[fronts]
    order = np.argsort(-np.linalg.norm(middle[:, :2], axis=1), kind="stable")  # the nearest is painted last
    height = max(len(cutout) for cutout in street.cutouts)
    sheet = np.concatenate([np.pad(c, ((0, height - len(c)), (0, 0), (0, 0))) for c in street.cutouts], axis=1)
    sizes = np.array([c.shape[:2] for c in street.cutouts])
    left = np.cumsum([0, *sizes[:-1, 1]])
    density = street.scene.spec.texels_per_metre
    planes = _CutoutPlanes(
        corner, normal, charts.axis_u[fronts], charts.axis_v[fronts], density, order, left, sizes, sheet
    )
    stopped = np.zeros(rays.shape[:-1], np.float32)
    flat = (np.ascontiguousarray(rays).reshape(-1, 3), np.ascontiguousarray(nearest).reshape(-1))
    _blend_cutout_texels(*flat, planes, colour.reshape(-1, 3), stopped.reshape(-1))
    return stopped


class _CutoutPlanes(NamedTuple):
    """Planes with the occluders before k facades.

    Attributes
    ----------
    corner : (k, 3) upper left corner, relative to the camera.
    normal, axis_u, axis_v : (k, 3) axes of the plane.
    density : texels per metre.
    order : (k,) order of painting, the nearest last.
    left : (k,) first column in the sheet.
    sizes : (k, 2) height and width in the sheet.
    sheet : (h, w, 4) all cut-outs in one row.
    """

    corner: Float64Array
    normal: Float64Array
    axis_u: Float64Array
    axis_v: Float64Array
    density: float
    order: Int64Array
    left: Int64Array
    sizes: Int64Array
    sheet: UInt8Array


@njit(cache=True, nogil=True)
def _blend_cutout_texels(
    rays: Float32Array, nearest: Float32Array, cutouts: _CutoutPlanes, colour: Float32Array, stopped: Float32Array
) -> None:
    corner, normal, axis_u, axis_v = cutouts.corner, cutouts.normal, cutouts.axis_u, cutouts.axis_v
    density, order, left, sizes, sheet = cutouts.density, cutouts.order, cutouts.left, cutouts.sizes, cutouts.sheet
    for k in range(len(rays)):
        for b in order:
            ahead, depth = 0.0, 0.0
            for i in range(3):
                ahead += rays[k, i] * normal[b, i]
                depth += corner[b, i] * normal[b, i]
            if ahead * depth <= 0 or depth / ahead >= nearest[k]:
                continue
            t = depth / ahead
            x, y = 0.0, 0.0
            for i in range(3):
                off = t * rays[k, i] - corner[b, i]
                x += off * axis_u[b, i]
                y += off * axis_v[b, i]
            column, row = int(np.floor(x * density)), int(np.floor(y * density))
            if column < 0 or row < 0 or row >= sizes[b, 0] or column >= sizes[b, 1]:
                continue
            alpha = sheet[row, left[b] + column, 3] / 255.0
            for i in range(3):
                colour[k, i] += alpha * (sheet[row, left[b] + column, i] - colour[k, i])
            stopped[k] += alpha * (1.0 - stopped[k])
