"""Start of a walk through the block: position and heading with the best view of facades."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.export.pictures.views import photo_share
from tasks.viewing.run_view import RunView

# Minimum cosine between heading and direction of a facade ahead; minimum distance of a facade, metres.
MIN_AHEAD_COSINE, MIN_DISTANCE_M = 0.35, 6.0


@dataclass(frozen=True)
class StartView:
    """Start of a walk through the block: position and heading.

    Attributes
    ----------
    position : [east, north, up] of a viewpoint, world metres.
    heading : heading along its street, degrees clockwise from north.
    """

    position: list[float]
    heading: float


def choose_start_view(view: RunView) -> StartView | None:
    """Choose the viewpoint with the largest facades ahead on both sides; photos count more.

    None without a viewpoint that sees a facade.
    """
    tables = view.tables
    facade = np.full(len(tables.placement.page), -1)
    facade[tables.facades.chart] = np.arange(len(tables.facades.id))
    viewpoint, seen = tables.views[:, 0], facade[tables.views[:, 1]]
    viewpoint, seen = viewpoint[seen >= 0], seen[seen >= 0]
    if not len(seen):
        return None
    photos = np.array([photo_share(record) for record in view.records])
    worth = (1 + BLOCK_VIEWS.photo_worth * photos) * tables.facades.width * tables.facades.height
    away = tables.line.mean(axis=1)[seen] - tables.position[viewpoint, :2]
    far = np.maximum(np.linalg.norm(away, axis=1), MIN_DISTANCE_M)
    forward = tables.forward[viewpoint]
    ahead = np.einsum("ij,ij->i", away, forward) / far
    left = forward[:, 0] * away[:, 1] > forward[:, 1] * away[:, 0]
    best, found = 0.0, StartView([], 0.0)
    for sense in (1.0, -1.0):
        # the sum of square roots prefers streets with facades on both sides
        sides = [
            np.bincount(
                viewpoint, np.where(side & (sense * ahead > MIN_AHEAD_COSINE), worth[seen], 0), len(tables.street)
            )
            for side in (left, ~left)
        ]
        score = np.sqrt(sides[0]) + np.sqrt(sides[1])
        chosen = int(np.argmax(score))
        if score[chosen] > best:
            best = float(score[chosen])
            east, north = sense * tables.forward[chosen]
            heading = float(np.degrees(np.arctan2(east, north))) % 360
            found = StartView([float(value) for value in tables.position[chosen]], round(heading, 3))
    return found if best > 0 else None
