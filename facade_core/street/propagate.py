"""Texture propagation: a translated panorama into the texels that see it (street paper, 3 Texture propagation)."""

from __future__ import annotations

import numpy as np
from numba import njit

from facade_core.geometry.equirectangular import basis
from facade_core.geometry.streets import Viewpoint
from facade_core.street.blend import add_view
from facade_core.street.scene import Scene
from facade_core.street.window import Window

# Texels seen flatter than this hold no detail: a panorama pixel would cover metres of them.
GRAZING = 0.02
# A view is proper within this many viewpoint spacings along the street (ADR 0010).
GATE_SPACINGS = 1.5


def propagate(
    scene: Scene, atlas: Window, viewpoint: Viewpoint, rgb: np.ndarray, *, seen: np.ndarray | None = None
) -> None:
    """Blend a translated panorama `rgb` (h, w, 3) uint8 into the window's writable charts, in place.

    A texel takes the view when it faces the camera within the visibility range and the pixel it falls on shows its own
    surface: exact for planar surfaces up to one pixel, and never colour from an occluder. Its colour is bilinear over the
    pixels of its surface. d = |forward . (p - c)| in mm. `seen` (h, w) int32 is the panorama's chart image where it is at hand.
    """
    if seen is None:
        seen = scene.look(viewpoint, rgb.shape[1])[2]
    held = np.intersect1d(seen[seen >= 0], atlas.writable)
    if len(held) == 0:
        return
    charts, placement = scene.charts, scene.placement
    _propagate(
        atlas.state.arrays(),
        charts.origin[held] - viewpoint.position,
        charts.axis_u[held],
        charts.axis_v[held],
        charts.normal()[held],
        charts.surface[held],
        placement.width[held].astype(np.int64),
        placement.height[held].astype(np.int64),
        atlas.rasters.offset[held],
        1.0 / scene.spec.texels_per_metre,
        basis(viewpoint.forward),
        rgb,
        np.where(seen >= 0, charts.surface[seen], -1),
        scene.visibility_range,
        round(1000 * GATE_SPACINGS * scene.spacing),
        viewpoint.id,
    )
    atlas.refresh(placement, held)


@njit(cache=True, nogil=True)
def _propagate(
    state, origin, axis_u, axis_v, normal, own, width, height, offset, step, camera, rgb, surface, reach, gate, view
):
    rows, columns = surface.shape
    for c in range(len(origin)):
        facing = -(normal[c, 0] * origin[c, 0] + normal[c, 1] * origin[c, 1] + normal[c, 2] * origin[c, 2])
        if facing <= 0:
            continue
        for j in range(height[c]):
            for i in range(width[c]):
                x, y = (i + 0.5) * step, (j + 0.5) * step
                px = origin[c, 0] + x * axis_u[c, 0] + y * axis_v[c, 0]
                py = origin[c, 1] + x * axis_u[c, 1] + y * axis_v[c, 1]
                pz = origin[c, 2] + x * axis_u[c, 2] + y * axis_v[c, 2]
                distance = np.sqrt(px * px + py * py + pz * pz)
                if distance > reach or facing < GRAZING * distance:
                    continue
                right = camera[0, 0] * px + camera[0, 1] * py + camera[0, 2] * pz
                down = camera[1, 0] * px + camera[1, 1] * py + camera[1, 2] * pz
                ahead = camera[2, 0] * px + camera[2, 1] * py + camera[2, 2] * pz
                u = (np.arctan2(right, ahead) / (2 * np.pi) + 0.5) * columns
                v = (0.5 + np.arcsin(down / distance) / np.pi) * rows
                if surface[min(int(v), rows - 1), int(u) % columns] != own[c]:
                    continue
                u -= 0.5
                v -= 0.5
                u0, v0 = int(np.floor(u)), int(np.floor(v))
                total, red, green, blue = 0.0, 0.0, 0.0, 0.0
                for dv in range(2):
                    row = min(max(v0 + dv, 0), rows - 1)
                    for du in range(2):
                        column = (u0 + du) % columns
                        if surface[row, column] == own[c]:
                            weight = (1 - abs(u - u0 - du)) * (1 - abs(v - v0 - dv))
                            total += weight
                            red += weight * rgb[row, column, 0]
                            green += weight * rgb[row, column, 1]
                            blue += weight * rgb[row, column, 2]
                if total <= 0:
                    continue
                d = int(abs(ahead) * 1000 + 0.5)
                add_view(
                    state,
                    offset[c] + j * width[c] + i,
                    d,
                    d <= gate,
                    view,
                    int(red / total + 0.5),
                    int(green / total + 0.5),
                    int(blue / total + 0.5),
                )
