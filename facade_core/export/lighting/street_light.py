"""Light of street lamps and lit windows on ground and walls at night."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.core.street_objects import OBJECT_KIND_NAMES, PlacedObjects, heading_axes
from facade_core.export.lighting.settings import STREET_LIGHT
from facade_core.export.models.pages import downscale
from facade_core.geometry.charts import Charts
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import DAYLIGHT
from facade_core.street.lighting.light import interpolate_axis


class Emitters(NamedTuple):
    """Small surfaces that give light, a row each.

    Attributes
    ----------
    position : (n, 3) world metres.
    normal : (n, 3) direction in which they shine most.
    power : (n, 3) linear light times area, square metres.
    """

    position: Float64Array
    normal: Float64Array
    power: Float64Array


NO_EMITTERS = Emitters(*np.zeros((3, 0, 3)))


def lamp_emitters(objects: PlacedObjects) -> Emitters:
    """Return the lanterns of street lamps, which shine down."""
    lamps = np.flatnonzero(objects.kind == OBJECT_KIND_NAMES.index("street_lamp"))
    size, ahead = objects.size[lamps], heading_axes(objects.heading[lamps])[:, 1]
    position = objects.position[lamps] + ahead * (size[:, 1:2] - STREET_LIGHT.lantern_m) + [0, 0, 1] * size[:, 2:]
    shape = position.shape
    return Emitters(position, np.broadcast_to([0.0, 0, -1], shape), np.broadcast_to(STREET_LIGHT.lamp_power, shape))


def window_emitters(charts: Charts, chart: int, light: Float32Array) -> Emitters:
    """Return the lit windows near the foot of a wall, by cells, from its light (h, w, 3) at night."""
    wide, high = charts.size[chart].tolist()
    columns, rows = (max(1, round(side / STREET_LIGHT.cell_m)) for side in (wide, high))
    cells = downscale(light, (columns, rows))
    x, y = (np.arange(columns) + 0.5) * wide / columns, (np.arange(rows) + 0.5) * high / rows
    low = y > high - STREET_LIGHT.window_height_m
    power = cells[low].reshape(-1, 3).astype(np.float64) * wide * high / (columns * rows)
    points = charts.points(chart, x[None], y[low][:, None]).reshape(-1, 3)
    lit = power.sum(axis=1) > 0
    return Emitters(points[lit], np.broadcast_to(charts.normals()[chart], points.shape)[lit], power[lit])


def join_emitters(parts: Iterable[Emitters]) -> Emitters:
    """Join emitters into one table."""
    return Emitters(*(np.concatenate(column) for column in zip(NO_EMITTERS, *parts, strict=True)))


def street_light(scene: Scene, chart: int, emitters: Emitters, shape: tuple[int, int]) -> Float32Array | None:
    """Compute the light (h, w, 3) that reaches a chart from emitters that it sees; None where all is dark.

    Parameters
    ----------
    scene : scene of the block.
    chart : row of the chart.
    emitters : lamps and windows near it.
    shape : texels.
    """
    charts, normal = scene.charts, scene.charts.normals()[chart]
    columns, rows = (np.maximum(np.ceil(charts.size[chart] / STREET_LIGHT.cell_m), 1).astype(int) + 1).tolist()
    x, y = (np.linspace(0, side, count) for side, count in zip(charts.size[chart], (columns, rows), strict=True))
    points = charts.points(chart, x[None], y[:, None]).reshape(-1, 3) + DAYLIGHT.ray_lift_m * normal
    light, reach = np.zeros(points.shape), STREET_LIGHT.reach_m
    near = ((emitters.position > points.min(axis=0) - reach) & (emitters.position < points.max(axis=0) + reach)).all(
        axis=1
    )
    emitters = Emitters(*(column[near] for column in emitters))
    for position, shining, power in zip(*emitters, strict=True):
        way = position - points
        distance = np.linalg.norm(way, axis=1)
        way /= np.maximum(distance, DAYLIGHT.ray_lift_m)[:, None]
        share = np.maximum(way @ normal, 0) * np.maximum(-way @ shining, 0) * (distance < reach)
        lit = np.flatnonzero(share > 0)
        if len(lit):
            free, _ = scene.caster.cast(points[lit], way[lit].astype(np.float32))
            share[lit[free < distance[lit] - STREET_LIGHT.cell_m]] = 0
            light += (share / (np.pi * np.maximum(distance, STREET_LIGHT.cell_m) ** 2))[:, None] * power
    if not light.any():
        return None
    grid = light.reshape(rows, columns, 3).astype(np.float32)
    for axis in (0, 1):
        grid = interpolate_axis(grid, axis, shape[axis]).astype(np.float32)
    return grid
