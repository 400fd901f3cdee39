"""A long wall cut into charts, seen with changing exposure from behind a kiosk: seams at chart borders, and bleed-through."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.provenance import Provenance
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, place_viewpoints
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.blend import blend_views
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.surfaces import FinishSettings, KnownTexture, finish_chart

TEXELS_PER_METRE, WIDTH = 20.0, 1024
LENGTH_M, HEIGHT_M, PIECE_M = 64.0, 14.0, 16.0
# Exposure of each panorama, as a factor.
EXPOSURE = (0.85, 1.15)
KIOSK_COLOUR = (255, 0, 0)
# Exposure of the panoramas beside photos.
DARKER = 0.8


def measure(images: Path) -> dict[str, Any]:
    """Steps of colour across chart borders over those beside them, and texels of the wall with the kiosk's colour."""
    scene, street = _scene()
    own = [Viewpoint(i, 0, p, f) for i, (p, f) in enumerate(zip(*place_viewpoints(street.line), strict=True))]
    pieces = _pieces(scene)
    truth = _truth(images)
    rng = np.random.default_rng(0)
    result: dict[str, Any] = {"charts_of_the_wall": len(pieces), "viewpoints": len(own)}
    for name, exposures in {"one exposure": np.ones(len(own)), "15 % apart": rng.uniform(*EXPOSURE, len(own))}.items():
        window = _window(scene)
        hidden = taken = 0
        for viewpoint, gain in zip(own, exposures, strict=True):
            rgb, seen = _look(scene, viewpoint, pieces, truth, float(gain))
            before = blend_views(window.state)[1].astype(int)
            propagate_panorama(scene, window, viewpoint, rgb, charts_seen=seen)
            if name == "one exposure":
                counted = _behind(scene, window, viewpoint, pieces, before)
                hidden, taken = hidden + counted[0], taken + counted[1]
        colours = [_raster(scene, window, piece) for piece in pieces]
        result[name] = {"across_borders_over_beside_them": round(_seam(colours), 2)}
        result[name]["bleed_through_texels"] = int(sum(_red(colour).sum() for colour in colours))
        if taken:
            result[name]["taken_within_a_pixel_behind_an_edge"] = round(hidden / taken, 5)
    result["beside_photos"] = _beside_photos(scene, own, pieces, truth)
    return result


def _beside_photos(
    scene: Scene, own: list[Viewpoint], pieces: list[int], truth: np.ndarray
) -> dict[str, dict[str, float]]:
    """One piece of the wall and half of another are photos in the truth's colours, the rest is translated from panoramas of
    another exposure: steps of colour over those beside them, at the charts' borders and at the photo's border within a chart,
    without levelling, with levelling within each chart, and across charts."""
    charts, placement = scene.charts, scene.placement
    rasters, write = TexelBuffer.plan_layout(placement, range(len(charts)), [])
    seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    for piece, share in ((pieces[1], 1.0), (pieces[3], 0.5)):
        shape = placement.shape(piece)
        left = round(float(charts.origin[piece, 0]) * TEXELS_PER_METRE)
        photo = np.zeros((*shape, 3), np.uint8)
        part = truth[: shape[0], left : left + shape[1]]
        photo[: part.shape[0], : part.shape[1]] = part
        known = np.zeros(shape, np.uint8)
        known[:, round((1 - share) * shape[1]) :] = Provenance.PHOTO
        texels = rasters.texel_slice(placement, piece)
        seed[texels], evidence[texels] = photo.reshape(-1, 3), known.reshape(-1)
    window = TexelBuffer.allocate(placement, rasters, write, seed, evidence)
    for viewpoint in own:
        rgb, seen = _look(scene, viewpoint, pieces, truth, DARKER)
        propagate_panorama(scene, window, viewpoint, rgb, charts_seen=seen)
    apart = replace(scene, charts=replace(charts, surface=np.arange(len(charts), dtype=np.int32)))

    def read(chart: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        texels, shape = (
            rasters.texel_slice(placement, chart),
            placement.shape(chart),
        )
        colour, provenance = window.colour[texels].reshape(*shape, 3), window.provenance[texels].reshape(shape)
        return colour[rows, columns], provenance[rows, columns]

    materials, around = MaterialField(scene, [_street()], seed=7), KnownTexture(read, pieces)
    result = {}
    for name, where, levelling in (
        ("without", scene, False),
        ("within each chart", apart, True),
        ("across charts", scene, True),
    ):
        settings = FinishSettings(levelling=levelling)
        colours = [finish_chart(where, materials, p, around, settings)[0] for p in pieces]
        middle = colours[3].shape[1] // 2
        result[name] = {
            "at_chart_borders": round(_seam(colours[:3]), 2),
            "within_a_chart": round(_seam([colours[3][:, :middle], colours[3][:, middle:]]), 2),
        }
    return result


def _street() -> Street:
    return Street("s", None, shapely.LineString([(0, -9), (LENGTH_M, -9)]))


def _scene() -> tuple[Scene, Street]:
    street = _street()
    houses = [
        Building("wall", shapely.box(0, 0, LENGTH_M, 10), HEIGHT_M, "height"),
        Building("kiosk", shapely.box(24, -4, 28, -2), 5.0, "height"),
    ]
    charts, mesh, _ = build_block_surfaces(
        houses, [street], terrain=build_terrain([], None), ground_margin=30, largest=PIECE_M + 0.1, grid=PIECE_M
    )
    placement = pack_charts(charts.size, TEXELS_PER_METRE, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, TEXELS_PER_METRE, page=1024)), street


def _pieces(scene: Scene) -> list[int]:
    """The charts of the long wall's front, from west to east."""
    charts = scene.charts
    front = (charts.building == 0) & (charts.kind == ChartKind.WALL) & (charts.normals()[:, 1] < -0.9)
    return sorted(np.flatnonzero(front).tolist(), key=lambda c: float(charts.origin[c, 0]))


def _truth(images: Path) -> np.ndarray:
    """Photos side by side over the whole wall, without red: what is red came from the kiosk."""
    import cv2
    from PIL import Image

    files = sorted(images.iterdir())[:3]  # their borders are not the charts'
    size = (round(LENGTH_M * TEXELS_PER_METRE / len(files)), round(HEIGHT_M * TEXELS_PER_METRE))
    photos = [np.asarray(Image.open(f).convert("RGB")) for f in files]
    truth = np.concatenate([cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in photos], axis=1)
    truth[..., 0] = 0
    return truth


def _look(
    scene: Scene, viewpoint: Viewpoint, pieces: list[int], truth: np.ndarray, gain: float
) -> tuple[np.ndarray, np.ndarray]:
    """The panorama of a viewpoint: the wall's photos, all else in the kiosk's colour."""
    import cv2

    rays, depth, seen = scene.cast_panorama(viewpoint, WIDTH)
    rgb = np.empty((WIDTH // 2, WIDTH, 3), np.uint8)
    rgb[:] = KIOSK_COLOUR
    wall = np.isin(seen, pieces)
    points = viewpoint.position + rays[wall] * depth[wall][:, None]
    x = np.clip(points[:, 0] * TEXELS_PER_METRE - 0.5, 0, truth.shape[1] - 1).astype(np.float32)
    y = np.clip((HEIGHT_M - points[:, 2]) * TEXELS_PER_METRE - 0.5, 0, truth.shape[0] - 1).astype(np.float32)
    colour = np.concatenate(
        [cv2.remap(truth, u[None], v[None], cv2.INTER_LINEAR)[0] for u, v in zip(_parts(x), _parts(y), strict=True)]
    )
    rgb[wall] = np.clip(gain * colour, 0, 255)
    return rgb, seen


def _parts(values: np.ndarray) -> list[np.ndarray]:
    """In parts short enough for a row of OpenCV's remap."""
    return np.array_split(values, max(1, -(-len(values) // 30_000)))


def _window(scene: Scene) -> TexelBuffer:
    rasters, write = TexelBuffer.plan_layout(scene.placement, range(len(scene.charts)), [])
    seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    return TexelBuffer.allocate(scene.placement, rasters, write, seed, evidence)


def _raster(scene: Scene, window: TexelBuffer, chart: int) -> np.ndarray:
    shape = (*scene.placement.shape(chart), 3)
    return window.colour[window.layout.texel_slice(scene.placement, chart)].reshape(shape)


def _red(colour: np.ndarray) -> np.ndarray:
    return colour[..., 0] > 0


def _seam(colours: list[np.ndarray]) -> float:
    """Mean step of colour between the charts' facing columns over that between columns beside them; seen texels only."""
    across, beside = [], []
    for left, right in zip(colours[:-1], colours[1:], strict=True):
        both = (left[:, -3:].max(axis=2).min(axis=1) > 0) & (right[:, :3].max(axis=2).min(axis=1) > 0)
        a, b = left[both].astype(int), right[both].astype(int)
        across.append(np.abs(a[:, -1] - b[:, 0]))
        beside += [np.abs(a[:, -2] - a[:, -1]), np.abs(b[:, 0] - b[:, 1])]
    return float(np.concatenate(across).mean() / np.concatenate(beside).mean())


def _behind(
    scene: Scene, window: TexelBuffer, viewpoint: Viewpoint, pieces: list[int], before: np.ndarray
) -> tuple[int, int]:
    """Of the wall's texels that took this view, those that a ray to them says are hidden, and all."""
    hidden = taken = 0
    charts, placement = scene.charts, scene.placement
    fresh = blend_views(window.state)[1].astype(int) > before
    for chart in pieces:
        flags = fresh[window.layout.texel_slice(placement, chart)]
        row, column = np.divmod(np.flatnonzero(flags), int(placement.width[chart]))
        place = (np.column_stack([column, row]) + 0.5) / scene.spec.texels_per_metre
        points = charts.points(chart, *place.T)
        distance = scene.caster.cast(viewpoint.position, points - viewpoint.position)[0]
        hidden += int((distance < 0.999).sum())
        taken += len(points)
    return hidden, taken
