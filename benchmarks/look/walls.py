"""What a published block's walls are made of: sources, windows, doors, storeys, and which neighbours are twins."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely

from benchmarks.look.outputs import Facade, Output, facade_items
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS

# Metres between the places on walls that are asked; how far off a wall something stands that leaves it no sight.
STEP_M, FREE_M = 0.5, 1.0
WINDOW_M = 4.0
# Neighbours are this near, and a facade is a street's front within this of its centreline.
NEAR_M, FRONT_M = 60.0, 20.0
STOREY_M = (2.6, 4.5)
# Facades are compared at so many pixels a metre by patches of this side; of twins half of the patches correlate by this much
# with a place in the other.
_PIXELS, _PATCH_M, _ALIKE = 10.0, 5.0, 0.8
# A texel that is darker than this in all bands is black.
_BLACK = 8


def walls(output: Output) -> dict[str, Any]:
    """Shares of the area of walls that others leave free: by source, and windowless."""
    boxes = _windows(output)
    by_source: dict[str, float] = defaultdict(float)
    free, windowless, total = 0.0, 0.0, 0.0
    for chart in output.walls.tolist():
        points, row, column, cell = _places(output, chart)
        total += cell * len(points)
        normal = output.charts.normals()[chart]
        depth, hit = output.caster.cast(points + 0.05 * normal, np.broadcast_to(normal, points.shape))
        behind = (hit != MISS) & (output.charts.normals()[hit] @ normal > 0)  # inside of a neighbour
        open_air = (hit == MISS) | ((depth > FREE_M) & ~behind)
        if not open_air.any():
            continue
        source = output.provenance(chart)[row[open_air], column[open_air]]
        for value, count in zip(*np.unique(source, return_counts=True), strict=True):
            by_source[output.sources[value]] += cell * int(count)
        free += cell * int(open_air.sum())
        near = boxes.get(int(output.charts.building[chart]), np.empty((0, 2, 3)))
        windowless += cell * int((_to_boxes(points[open_air], near) > WINDOW_M).sum())
    return {
        "walls_m2": round(total),
        "free_m2": round(free),
        "free_by_source": {name: round(area / free, 4) for name, area in sorted(by_source.items())},
        "windowless_beyond_4_m": round(windowless / free, 4),
    }


def _places(output: Output, chart: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """A grid of world points (k, 3) on a chart where its mesh is, their texels' rows and columns, and the area of a cell."""
    width, height = output.charts.size[chart]
    nx, ny = max(1, round(width / STEP_M)), max(1, round(height / STEP_M))
    x, y = np.meshgrid((np.arange(nx) + 0.5) * width / nx, (np.arange(ny) + 0.5) * height / ny)
    flat = np.column_stack([x.ravel(), y.ravel()])
    corners = output.charts.coordinates(
        np.full(3 * int((output.mesh.chart == chart).sum()), chart),
        output.mesh.vertices[output.mesh.triangles[output.mesh.chart == chart]].reshape(-1, 3),
    ).reshape(-1, 3, 2)
    inside = np.zeros(len(flat), bool)
    for triangle in corners:
        inside |= _in_triangle(flat, triangle)
    flat = flat[inside]
    row = np.clip(flat[:, 1] * output.placement.texels_per_metre[chart], 0, output.placement.height[chart] - 1).astype(
        int
    )
    column = np.clip(
        flat[:, 0] * output.placement.texels_per_metre[chart], 0, output.placement.width[chart] - 1
    ).astype(int)
    points = output.charts.points(np.full(len(flat), chart), flat[:, 0], flat[:, 1])
    return points, row, column, width * height / (nx * ny)


def _in_triangle(points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    edges = np.roll(triangle, -1, axis=0) - triangle
    offset = points[:, None] - triangle[None]
    side = edges[None, :, 0] * offset[..., 1] - edges[None, :, 1] * offset[..., 0]
    return (side >= -1e-9).all(axis=1) | (side <= 1e-9).all(axis=1)


def _windows(output: Output) -> dict[int, np.ndarray]:
    """By building, two opposite corners (k, 2, 3) of each window in the world."""
    found: dict[int, list[np.ndarray]] = defaultdict(list)
    for facade in output.facades:
        chart = np.full(len(facade.windows), facade.chart)
        corners = [output.charts.points(chart, facade.windows[:, i], facade.windows[:, i + 1]) for i in (0, 2)]
        found[facade.building].append(np.stack(corners, axis=1))
    return {building: np.concatenate(parts) for building, parts in found.items()}


def _to_boxes(points: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Metres (k,) from points to the nearest upright rectangle of two opposite corners; inf where there are none."""
    nearest = np.full(len(points), np.inf)
    for low, high in boxes:
        along = high - low
        flat = np.array([along[0], along[1], 0.0])
        length = np.linalg.norm(flat)
        unit = flat / max(length, 1e-9)
        offset = points - low
        across = offset @ unit
        beside = np.maximum(np.maximum(-across, across - length), 0)
        z = points[:, 2]
        outside = np.maximum(np.maximum(min(low[2], high[2]) - z, z - max(low[2], high[2])), 0)
        off = np.linalg.norm(offset[:, :2] - np.outer(across, unit[:2]), axis=1)
        np.minimum(nearest, np.sqrt(beside**2 + outside**2 + off**2), out=nearest)
    return nearest


def fronts(output: Output) -> dict[str, Any]:
    """Storeys, doors at street fronts, windows at the walls' edges, and the exemplars that facades are made of."""
    found = facade_items(output)
    heights = [row.height_m / row.floors for _, row in found if row.floors and row.floors > 0]
    doors: dict[tuple[int, int], int] = defaultdict(int)
    cut, windows = 0, 0
    for facade, row in found:
        street = _front_of(output, facade)
        if street is not None:
            doors[facade.building, street] += int(row.doors or 0)
        width = output.charts.size[facade.chart, 0]
        edge = 1.5 / output.placement.texels_per_metre[facade.chart]
        boxes = facade.windows
        windows += len(boxes)
        cut += int(((boxes[:, 0] < edge) | (boxes[:, 2] > width - edge) | (boxes[:, 1] < edge)).sum())
    made = [str(row.source) for _, row in found if row.photo == 0]
    return {
        "facades": len(found),
        "storeys_between_2.6_and_4.5_m": _share([STOREY_M[0] <= h <= STOREY_M[1] for h in heights]),
        "street_fronts": len(doors),
        "fronts_with_a_door": _share([count > 0 for count in doors.values()]),
        "doors_per_front": round(float(np.mean(list(doors.values()))), 2) if doors else None,
        "windows": windows,
        "windows_cut": cut,
        "facades_with_shops": _share([bool((row.shops or 0) > 0) for _, row in found]),
        "exemplars_used": len(set(made)),
        "most_used_exemplar": _share([name == max(set(made), key=made.count) for name in made]) if made else None,
    }


def twins(output: Output) -> dict[str, Any]:
    """Pairs of neighbours' facades that look alike: of different buildings, within 60 m, both seen from streets. Parts of a
    building are one: they take its exemplar."""
    known = {facade.id: row for facade, row in facade_items(output)}
    houses = {name: _house_of(row) for name, row in known.items()}
    facades = [facade for facade in output.facades if facade.id in known and _front_of(output, facade) is not None]
    pictures: dict[int, np.ndarray] = {}
    for page in sorted({int(output.placement.page[facade.chart]) for facade in facades}):
        pixels = output.pixels(page)
        for number, facade in enumerate(facades):
            if output.placement.page[facade.chart] == page:
                pictures[number] = _detail(
                    output.raster(pixels, facade.chart), output.placement.texels_per_metre[facade.chart]
                )
    pairs, same, alike, scores = 0, 0, 0, []
    for a in range(len(facades)):
        for b in range(a + 1, len(facades)):
            apart = np.linalg.norm(_middle(output, facades[a]) - _middle(output, facades[b]))
            if houses[facades[a].id] == houses[facades[b].id] or apart > NEAR_M:
                continue
            pairs += 1
            same += known[facades[a].id].source == known[facades[b].id].source
            scores.append(max(_likeness(pictures[a], pictures[b]), _likeness(pictures[b], pictures[a])))
            alike += scores[-1] >= _ALIKE
    return {
        "neighbours_within_60_m": pairs,
        "of_one_exemplar": same,
        "twins": alike,
        "likeness": [round(float(np.quantile(scores, q)), 3) for q in (0.5, 0.9, 1.0)] if scores else None,
    }


def _house_of(row: Any) -> str:
    """The building of which a facade is, or of which its building is a part."""
    whole = getattr(row, "part_of", None)  # an earlier version knew no parts
    return whole if isinstance(whole, str) and whole else str(row.building)


def _detail(raster: np.ndarray, density: float) -> np.ndarray:
    """Brightness (h, w) float32 of a facade at _PIXELS a metre without its slow changes."""
    import cv2

    share = _PIXELS / density
    whole = cv2.cvtColor(np.ascontiguousarray(raster), cv2.COLOR_RGB2GRAY).astype(np.float32)
    size = (max(1, round(whole.shape[1] * share)), max(1, round(whole.shape[0] * share)))
    grey = cv2.resize(whole, size, interpolation=cv2.INTER_AREA)
    return grey - cv2.GaussianBlur(grey, (0, 0), _PIXELS)


def _likeness(one: np.ndarray, other: np.ndarray) -> float:
    """The median, over patches of a facade, of the highest correlation with any place of another."""
    import cv2

    side = round(_PATCH_M * _PIXELS)
    if min(one.shape) < side or min(other.shape) < side:
        return 0.0
    found = []
    for top in np.linspace(0, one.shape[0] - side, 3).astype(int).tolist():
        for left in np.linspace(0, one.shape[1] - side, 3).astype(int).tolist():
            patch = one[top : top + side, left : left + side]
            if patch.std() > 2:
                found.append(float(cv2.matchTemplate(other, patch, cv2.TM_CCOEFF_NORMED).max()))
    return float(np.median(found)) if found else 0.0


def _middle(output: Output, facade: Facade) -> np.ndarray:
    """The middle of a facade's foot, seen from above, (2,)."""
    return output.charts.points_at_shares(np.array([facade.chart]), np.array([[0.5, 1.0]]))[0, 0, :2]


def _front_of(output: Output, facade: Facade) -> int | None:
    """The street that a facade faces from near by; None where there is none."""
    middle = _middle(output, facade)
    normal = output.charts.normals()[facade.chart][:2]
    lines = [line.distance(shapely.Point(middle + 2 * normal)) for line in output.streets]
    nearest = int(np.argmin(lines))
    back = output.streets[nearest].distance(shapely.Point(middle))
    return nearest if back <= FRONT_M and lines[nearest] < back - 1.0 else None


def shapes(output: Output) -> dict[str, Any]:
    """How many heights and shapes of roof the buildings have."""
    built = np.unique(output.charts.building[output.charts.building >= 0])
    heights = output.buildings["height"][built]
    area = output.charts.size.prod(axis=1)
    normal = output.charts.normals()
    kinds: dict[str, int] = defaultdict(int)
    for building in built.tolist():
        own = np.flatnonzero((output.charts.building == building) & (output.charts.kind == ChartKind.ROOF))
        kinds[_roof_shape(normal[own], area[own])] += 1
    return {
        "buildings": len(built),
        "distinct_heights": len(set(np.round(heights, 1).tolist())),
        "most_common_height": _share(list(np.round(heights, 1) == _mode(np.round(heights, 1)))),
        "roofs": dict(sorted(kinds.items())),
        "triangles": len(output.mesh.triangles),
    }


def _roof_shape(normal: np.ndarray, area: np.ndarray) -> str:
    """What the planes of a roof (k, 3) are, by those that take a twentieth of it: flat, or on how many sides it slopes."""
    keep = area > 0.05 * area.sum() if len(area) else np.zeros(0, bool)
    steep = normal[keep & (normal[:, 2] < 0.985)]
    if not len(steep):
        return "flat" if len(area) else "none"
    turns = np.unique(np.round(np.arctan2(steep[:, 1], steep[:, 0]) / (np.pi / 8)) % 16)
    slopes = len(np.unique(np.round(steep[:, 2], 1)))
    return f"{len(turns)} sides" + (", broken slopes" if slopes > 1 else "")


def texels(output: Output) -> dict[str, Any]:
    """Texels of charts that are black, or of the magenta that stands for a missing picture."""
    counted, black, magenta = 0, 0, 0
    for page in np.unique(output.placement.page).tolist():
        pixels = output.pixels(page)
        for chart in np.flatnonzero(output.placement.page == page).tolist():
            raster = output.raster(pixels, chart).astype(np.int16)
            counted += raster[..., 0].size
            black += int((raster.max(axis=2) < _BLACK).sum())
            magenta += int(((raster[..., 0] > 200) & (raster[..., 2] > 200) & (raster[..., 1] < 60)).sum())
    return {"texels": counted, "black": black, "magenta": magenta, "pages": len(np.unique(output.placement.page))}


def _mode(values: np.ndarray) -> float:
    unique, counts = np.unique(values, return_counts=True)
    return float(unique[counts.argmax()])


def _share(told: list[Any]) -> float | None:
    return round(float(np.mean(told)), 4) if told else None


def measure_walls(output: Output) -> Mapping[str, Any]:
    """All of this module's figures of an output."""
    return {
        "walls": walls(output),
        "fronts": fronts(output),
        "twins": twins(output),
        "shapes": shapes(output),
        "texels": texels(output),
    }
