"""Perspective cameras for pictures of a block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.export.pictures.settings import VIEW_CAMERAS
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint


@dataclass(frozen=True)
class PerspectiveCamera:
    """Pinhole camera.

    Attributes
    ----------
    position, target : (3,) world metres.
    field_of_view : horizontal, degrees.
    size : height and width, pixels.
    """

    position: Float64Array
    target: Float64Array
    field_of_view: float
    size: tuple[int, int]

    @classmethod
    def from_heading(
        cls, position: Float64Array, *, heading: float, pitch: float, field_of_view: float, size: tuple[int, int]
    ) -> PerspectiveCamera:
        """Build a camera that looks along a heading.

        Parameters
        ----------
        position : (3,) world metres.
        heading : degrees clockwise from grid north.
        pitch : degrees up.
        field_of_view : horizontal, degrees.
        size : height and width, pixels.
        """
        turn, rise = np.radians(heading), np.radians(pitch)
        ahead = np.array([np.sin(turn) * np.cos(rise), np.cos(turn) * np.cos(rise), np.sin(rise)])
        return cls(np.asarray(position, float), position + ahead, field_of_view, size)

    def rays(self, rows: slice = slice(None)) -> Float64Array:
        """Return world unit directions (h, w, 3) through the pixel centres of some rows."""
        height, width = self.size
        forward, right, down, focal = self.axes()
        x = (np.arange(width) + 0.5 - width / 2) / focal
        y = (np.arange(height)[rows] + 0.5 - height / 2) / focal
        rays = forward + x[None, :, None] * right + y[:, None, None] * down
        directions: Float64Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return directions

    def rays_through(self, pixel: Int64Array) -> Float64Array:
        """Return world unit directions (k, 3) through the centres of some pixels (k,), by their flat indices."""
        height, width = self.size
        forward, right, down, focal = self.axes()
        row, column = np.divmod(pixel, width)
        x, y = (column + 0.5 - width / 2) / focal, (row + 0.5 - height / 2) / focal
        rays = forward + x[:, None] * right + y[:, None] * down
        directions: Float64Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return directions

    def may_show(self, corners: Float64Array) -> BoolArray:
        """Return which polygons may be visible, a superset of the visible ones.

        Parameters
        ----------
        corners : (n, k, 3) corners of each polygon, world metres.

        Returns
        -------
        (n,) bool.
        """
        height, width = self.size
        forward, right, down, focal = self.axes()
        ahead, across, along = ((corners - self.position) @ axis for axis in (forward, right, down))
        outside: BoolArray = np.asarray((ahead <= 0).all(axis=1))
        for sideways, half in ((across, width / 2 / focal), (along, height / 2 / focal)):
            outside |= (sideways > ahead * half).all(axis=1) | (-sideways > ahead * half).all(axis=1)
        return ~outside

    def axes(self) -> tuple[Float64Array, Float64Array, Float64Array, float]:
        """Return unit vectors ahead, right and down, (3,) each, and the focal length in pixels."""
        forward = self.target - self.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        focal = self.size[1] / 2 / np.tan(np.radians(self.field_of_view) / 2)
        return forward, right, np.cross(forward, right), float(focal)


def aerial_camera(scene: Scene, size: tuple[int, int], worth: Float64Array | None = None) -> PerspectiveCamera:
    """Build an oblique aerial camera with all buildings in view.

    Parameters
    ----------
    scene : scene of the block.
    size : height and width, pixels.
    worth : (charts,) worth per area; the side with most of it is chosen, by default the south-west.
    """
    built = scene.charts.building[scene.mesh.vertex_chart] >= 0
    points = scene.mesh.vertices[built] if built.any() else scene.mesh.vertices
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    sides = [np.array([*(turn @ (-0.45, -0.62)), 0.64]) for turn in map(_rotation, range(8))]
    seen = [0.0 if worth is None else _visible_worth(scene, side, worth) for side in sides]
    away = sides[int(np.argmax(seen))]
    away /= np.linalg.norm(away)
    right = np.cross(-away, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(away, right)
    field_of_view = 38.0
    half_width = np.tan(np.radians(field_of_view) / 2) / VIEW_CAMERAS.aerial_margin
    half_height = half_width * size[0] / size[1]
    for _ in range(8):  # the nearer side spreads more, so the middle of the picture is found by steps
        relative = points - target
        across, along, nearer = relative @ right, relative @ up, relative @ away
        distance = float((np.maximum(np.abs(across) / half_width, np.abs(along) / half_height) + nearer).max())
        depth = distance - nearer
        middle = [(np.ptp(s) / 2 + s.min()) * distance for s in (across / depth, along / depth)]
        target = target + middle[0] * right + middle[1] * up
    return PerspectiveCamera(target + away * distance, target, field_of_view, size)


def _rotation(eighth: int) -> Float64Array:
    """Return the rotation (2, 2) by eighths of a full turn."""
    angle = eighth * np.pi / 4
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _visible_worth(scene: Scene, side: Float64Array, worth: Float64Array) -> float:
    charts = scene.charts
    return float((worth * charts.size.prod(axis=1) * np.clip(charts.normals() @ side, 0, None)).sum())


def street_camera(
    scene: Scene, viewpoints: Sequence[Viewpoint], size: tuple[int, int], worth: Float64Array
) -> PerspectiveCamera:
    """Build the camera of a pedestrian who looks at one side of a street.

    Parameters
    ----------
    scene : scene of the block.
    viewpoints : candidate positions.
    size : height and width, pixels.
    worth : (charts,) worth; the viewpoint and direction with most of it are chosen.
    """
    rows, columns = (
        slice(VIEW_CAMERAS.search_width_px // 8, VIEW_CAMERAS.search_width_px // 4),
        slice(VIEW_CAMERAS.search_width_px * 3 // 8, VIEW_CAMERAS.search_width_px * 5 // 8),
    )
    best, found = -1.0, (viewpoints[0], 0.0)
    for viewpoint in viewpoints:
        _, depth, chart = scene.cast_panorama(viewpoint, VIEW_CAMERAS.search_width_px)
        value = np.where(chart >= 0, worth[chart] * np.clip(depth / VIEW_CAMERAS.full_worth_distance_m, 0.0, 1.0), 0.0)
        for along in (0, 180):
            middle = VIEW_CAMERAS.search_width_px // 2 - round(along / 360 * VIEW_CAMERAS.search_width_px)
            end = depth[VIEW_CAMERAS.search_width_px // 4 - 1, (middle - 1, middle)].min()
            for turn in (along - VIEW_CAMERAS.street_yaw_deg, along + VIEW_CAMERAS.street_yaw_deg):
                shown = np.roll(value, -round(turn / 360 * VIEW_CAMERAS.search_width_px), axis=1)
                if (score := float(shown[rows, columns].mean() * min(1.0, end / VIEW_CAMERAS.open_street_m))) > best:
                    best, found = score, (viewpoint, turn)
    viewpoint, turn = found
    heading = float(np.degrees(np.arctan2(*viewpoint.forward))) + turn
    return PerspectiveCamera.from_heading(
        lower_to_eye_height(scene, viewpoint.position),
        heading=heading,
        pitch=VIEW_CAMERAS.street_pitch_deg,
        field_of_view=75.0,
        size=size,
    )


def close_up_camera(scene: Scene, facades: Int32Array, size: tuple[int, int], worth: Float64Array) -> PerspectiveCamera:
    """Build an oblique camera at the foot of the facade with the highest worth and no occluder.

    Parameters
    ----------
    scene : scene of the block.
    facades : (n,) charts, at least one.
    size : height and width, pixels.
    worth : (charts,) worth per area.
    """
    charts = scene.charts
    order = facades[np.argsort(-worth[facades] * charts.size[facades].prod(axis=1), kind="stable")][
        : VIEW_CAMERAS.max_close_ups_tried
    ]
    found = None
    for chart in order.tolist():
        width, height = charts.size[chart]
        foot = charts.points(chart, np.array([width / 2]), np.array([height]))[0]
        looked_at = foot + np.array([0.0, 0.0, min(VIEW_CAMERAS.close_up_target_m, height / 2)])
        for aside in (VIEW_CAMERAS.close_up_offset_m, -VIEW_CAMERAS.close_up_offset_m):
            place = (
                foot
                + VIEW_CAMERAS.close_up_distance_m * charts.normals()[chart]
                + aside * charts.axis_u[chart]
                + [0.0, 0.0, 3.0]
            )
            camera = PerspectiveCamera(lower_to_eye_height(scene, place), looked_at, 62.0, size)
            found = found or camera
            _, hit = scene.caster.cast(camera.position, (looked_at - camera.position)[None])
            if hit[0] == chart:
                return camera
    assert found is not None
    return found


def lower_to_eye_height(scene: Scene, place: Float64Array) -> Float64Array:
    """Lower a position (3,) to the height of a pedestrian's eyes above the ground below; unchanged without ground."""
    depth, chart = scene.caster.cast(place, np.array([[0.0, 0.0, -1.0]]))
    return place if chart[0] == MISS else place - [0.0, 0.0, float(depth[0]) - VIEW_CAMERAS.eye_height_m]
