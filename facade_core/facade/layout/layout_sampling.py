"""Sample whole layouts for walls without any observation, in the styles of database facades."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle

# Columns of LayoutModel.styles: width to height of the facade; columns and floors of windows; a window's width to the column
# pitch and height to the floor pitch; the first column's margin and the top margin in pitches; the ground floor's height
# in floor pitches; doors; shops; balconies a window.
(
    PROPORTION,
    COLUMNS,
    FLOORS,
    WINDOW_WIDTH,
    WINDOW_HEIGHT,
    SIDE_MARGIN,
    TOP_MARGIN,
    GROUND_HEIGHT,
    DOORS,
    SHOPS,
    BALCONIES,
) = range(11)
# Domains up to this height are in metres; in pixels no facade is so low.
_MAX_METRIC_HEIGHT = 60.0


def sample_layouts(
    domain: Rectangle, styles: Float64Array, metric: Mapping[str, float], count: int, rng: np.random.Generator
) -> Iterator[list[Element]]:
    """Yield layouts in the styles whose proportions are nearest to the domain's.

    The numbers of columns and floors are scaled to the domain. A domain at most 60 units high is assumed to be in
    metres: its floors and columns then follow the metric priors.

    Parameters
    ----------
    domain : (x0, y0, x1, y1) of the facade, y down.
    styles : (S, 11) styles of the database.
    metric : median pitches in metres, keys "floor pitch" and "column pitch".
    count : number of layouts, at most one for each style.
    """
    width, height = domain[2] - domain[0], domain[3] - domain[1]
    distance = np.abs(np.log(styles[:, PROPORTION] * height / width)) + 0.2 * rng.uniform(size=len(styles))
    for k in np.argsort(distance, kind="stable")[:count]:
        style = styles[k]
        floors = style[FLOORS]
        # A narrower wall has fewer columns of the same proportions.
        columns = style[COLUMNS] * (width / height) / style[PROPORTION]
        if height <= _MAX_METRIC_HEIGHT:
            floors = height / metric["floor pitch"] - 1 + 0.5 * rng.uniform()
            columns = width / (metric["column pitch"] * rng.uniform(0.85, 1.25))
        yield _draw_layout(domain, style, max(1, round(columns)), max(1, round(floors)))


def _draw_layout(domain: Rectangle, style: Float64Array, columns: int, floors: int) -> list[Element]:
    x0, y0, x1, y1 = domain
    side = float(np.clip(style[SIDE_MARGIN], 0.45, 1.2))
    pitch_x = (x1 - x0) / (columns - 1 + 2 * side)
    top, ground = float(np.clip(style[TOP_MARGIN], 0.55, 1.5)), float(np.clip(style[GROUND_HEIGHT], 0.7, 2.2))
    pitch_y = (y1 - y0) / (floors - 1 + top + ground)
    xs = x0 + pitch_x * (side + np.arange(columns))
    ys = y0 + pitch_y * (top + np.arange(floors))
    w, h = style[WINDOW_WIDTH] * pitch_x / 2, style[WINDOW_HEIGHT] * pitch_y / 2
    rail = min(1.2 * w, 0.48 * pitch_x)
    elements = [Element("window", x - w, y - h, x + w, y + h) for y in ys.tolist() for x in xs.tolist()]
    if style[BALCONIES] > 0.5:
        elements += [
            Element("balcony", x - rail, y + 0.5 * h, x + rail, y + 1.1 * h)
            for y in ys[ys < ys[-1]].tolist()
            for x in xs.tolist()
        ]
    space, door = y1 - float(ys[-1]) - h, columns // 2 if style[DOORS] else -1
    if space < 3 * h:  # the ground floor has windows, and the door replaces one
        if door >= 0:
            window = elements.pop((floors - 1) * columns + door)
            elements.append(Element("door", window.x0, window.y0 + 0.2 * h, window.x1, y1))
        return elements
    tall = min(2.6 * h, 0.85 * space)
    for k, x in enumerate(xs.tolist()):
        if k == door:
            elements.append(Element("door", x - 1.1 * w, y1 - tall, x + 1.1 * w, y1))
        elif style[SHOPS] >= 2:
            elements.append(Element("shop", x - 0.42 * pitch_x, y1 - tall, x + 0.42 * pitch_x, y1 - 0.05 * tall))
    return elements
