"""Defects of walls made from exemplars, above detectors: roofs, storeys, proportions, cut shops, one exemplar too often."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from benchmarks.look.outputs import Output, facade_items
from facade_core.core.labels import FacadeClass
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.walls import FLOOR_HEIGHT_M, WallRole
from facade_core.parsing.floor_structure import window_row_spans

# Metres of rows that show mostly roof from which a roof is painted on a wall; metres within which a roof begins at its top.
ROOF_M, ROOF_NEAR_M = 0.5, 1.0
# Between the middles of two rows of windows, with what a row's height may differ by; over a ground floor it may be more.
PITCH_SLACK_M, GROUND_PITCH_M = 0.15, 5.25
# Largest change of a window's height to its width, beside a texel of either.
PROPORTION = 1.1
# The same of a door or a shop, which is stretched in both directions; of one that is cut the change is greater. Lower ones are
# no whole element; pixels.
GROUND_PROPORTION, MIN_GROUND_ELEMENT_PX = 1.4, 8
GROUND_CLASSES = (FacadeClass.DOOR, FacadeClass.SHOP)
# A wall at least as wide has windows; metres.
MIN_WINDOWED_M = 4.0


class ExemplarWall(NamedTuple):
    """A street wall made from an exemplar, and its defects.

    roof: rows of roof under a roof of the model; storeys: heights out of range; windows: the proportions of half or more
    differ from those of all rows of the exemplar; ground: those of a door or a shop from all of the exemplar; blind: without
    windows.
    """

    id: str
    source: str
    square_metres: float
    roof: bool
    storeys: tuple[float, ...]
    windows: bool
    ground: bool = False
    blind: bool = False

    @property
    def defects(self) -> tuple[str, ...]:
        """The names of its defects."""
        found = [("roof", self.roof), ("storeys", bool(self.storeys)), ("windows", self.windows)]
        found += [("ground", self.ground), ("blind", self.blind)]
        return tuple(name for name, has in found if has)


def exemplar_walls(output: Output) -> dict[str, Any]:
    """Count the defects of a published block's street walls without pictures."""
    exemplars = output.exemplar_labels()
    proportions = {name: row_proportions(labels) for name, labels in exemplars.items()}
    grounds = {name: ground_proportions(labels) for name, labels in exemplars.items()}
    roles = dict(zip(map(str, output.group["facades/id"][:]), output.group["facades/role"][:].tolist(), strict=True))
    found = []
    for facade, row in facade_items(output):
        if row.photo == 0 and roles[facade.id] == WallRole.STREET and row.source in proportions:
            labels, density = output.labels(facade.chart), float(output.placement.texels_per_metre[facade.chart])
            has_roof = has_roof_at_top(output.charts, output.mesh, facade.chart)
            source = str(row.source)
            found.append(
                measure_wall(
                    facade.id, source, labels, density, proportions[source], grounds[source], has_roof=has_roof
                )
            )
    return count_defects(found)


def measure_wall(
    id: str,
    source: str,
    labels: np.ndarray,
    density: float,
    proportions: np.ndarray,
    ground: Mapping[int, np.ndarray],
    *,
    has_roof: bool,
) -> ExemplarWall:
    """Measure a wall.

    labels (h, w) class ids; density: texels a metre; proportions (n,) of the exemplar; ground: those of its
    doors and shops; has_roof: whether the model's begins
    at its top.
    """
    painted = float(((labels == FacadeClass.ROOF).mean(axis=1) > 0.5).sum() / density)
    return ExemplarWall(
        id,
        source,
        labels.size / density**2,
        has_roof and painted >= ROOF_M,
        odd_pitches(labels, density),
        are_stretched(labels, proportions),
        are_cut(labels, ground),
        labels.shape[1] >= MIN_WINDOWED_M * density and not (labels == FacadeClass.WINDOW).any(),
    )


def count_defects(walls: Sequence[ExemplarWall]) -> dict[str, Any]:
    """Count the walls by defect, and the share of the most used exemplar."""
    uses, area = Counter(wall.source for wall in walls), Counter[str]()
    for wall in walls:
        area[wall.source] += wall.square_metres  # type: ignore[assignment]
    counts = Counter(defect for wall in walls for defect in wall.defects)
    return {
        "walls": len(walls),
        "roof_under_a_roof": counts["roof"],
        "storeys_out_of_range": counts["storeys"],
        "window_proportions": counts["windows"],
        "cut_on_the_ground_floor": counts["ground"],
        "without_windows": counts["blind"],
        "without_these": sum(not wall.defects for wall in walls),
        "exemplars": len(uses),
        "largest_share_of_walls": round(max(uses.values(), default=0) / max(1, len(walls)), 3),
        "largest_share_of_area": round(max(area.values(), default=0) / max(1, sum(area.values())), 3),
    }


def has_roof_at_top(charts: Charts, mesh: Mesh, chart: int) -> bool:
    """Whether a roof of the building begins at the top of a wall."""
    left, right = charts.points_at_shares(np.array([chart]), np.array([[0.0, 0.0], [1.0, 0.0]]))[0]
    width = float(np.linalg.norm(right - left))
    along = (right - left)[:2] / width
    roofs = np.flatnonzero((charts.kind == ChartKind.ROOF) & (charts.building == charts.building[chart]))
    for roof in roofs.tolist():
        offset = mesh.vertices[np.unique(mesh.triangles[mesh.chart == roof])] - left
        beside, away = offset[:, :2] @ along, np.abs(offset[:, :2] @ [-along[1], along[0]])
        near = (away < ROOF_NEAR_M) & (np.abs(offset[:, 2]) < ROOF_NEAR_M)
        if (near & (beside > -ROOF_NEAR_M) & (beside < width + ROOF_NEAR_M)).any():
            return True
    return False


def odd_pitches(labels: np.ndarray, density: float) -> tuple[float, ...]:
    """Metres between rows of windows that are not of a storey."""
    middles = np.array([(a + b) / 2 for a, b in window_row_spans(labels == FacadeClass.WINDOW)]) / density
    pitches = np.diff(middles)
    most = np.full(len(pitches), FLOOR_HEIGHT_M[1] + PITCH_SLACK_M)
    most[-1:] = GROUND_PITCH_M + PITCH_SLACK_M
    odd = pitches[(pitches < FLOOR_HEIGHT_M[0] - PITCH_SLACK_M) | (pitches > most)]
    return tuple(np.round(odd, 2).tolist())


def row_proportions(labels: np.ndarray) -> np.ndarray:
    """The median height to width (n,) of the windows of each row."""
    size, middle = _boxes(labels, FacadeClass.WINDOW)
    rows = [
        size[(middle > a) & (middle < b), 1] / size[(middle > a) & (middle < b), 0]
        for a, b in window_row_spans(labels == FacadeClass.WINDOW)
    ]
    return np.array([np.median(row) for row in rows if len(row)])


def are_stretched(labels: np.ndarray, proportions: np.ndarray) -> bool:
    """Whether half of the windows have proportions that no row (n,) of the exemplar has."""
    size, _ = _boxes(labels, FacadeClass.WINDOW)
    if not len(size) or not len(proportions):
        return False
    off = np.abs(np.log((size[:, 1] / size[:, 0])[:, None] / proportions[None])).min(axis=1)
    return bool((off > np.log(PROPORTION) + (1 / size).sum(axis=1)).mean() >= 0.5)


def ground_proportions(labels: np.ndarray) -> dict[int, np.ndarray]:
    """The height to width (n,) of the doors and of the shops of an exemplar, by class."""
    sizes = {one: _ground_sizes(labels, one) for one in GROUND_CLASSES}
    return {int(one): size[:, 1] / size[:, 0] for one, size in sizes.items()}


def are_cut(labels: np.ndarray, proportions: Mapping[int, np.ndarray]) -> bool:
    """Whether a door or a shop has proportions that none of the exemplar has."""
    for one in GROUND_CLASSES:
        size = _ground_sizes(labels, one)
        if len(size):
            off = np.abs(np.log((size[:, 1] / size[:, 0])[:, None] / proportions[int(one)][None]))
            if (off.min(axis=1, initial=np.inf) > np.log(GROUND_PROPORTION) + (1 / size).sum(axis=1)).any():
                return True
    return False


def _ground_sizes(labels: np.ndarray, label: FacadeClass) -> np.ndarray:
    """Width and height (n, 2) of the elements of a class that are no specks."""
    size, _ = _boxes(labels, label)
    return size[size[:, 1] >= MIN_GROUND_ELEMENT_PX]


def _boxes(labels: np.ndarray, label: FacadeClass) -> tuple[np.ndarray, np.ndarray]:
    """Width and height (n, 2) of the elements of a class, and their middles (n,) from the top."""
    count, _, boxes, _ = cv2.connectedComponentsWithStats((labels == label).astype(np.uint8), connectivity=4)
    boxes = boxes[1:count].astype(float)
    return boxes[:, 2:4], boxes[:, 1] + boxes[:, 3] / 2
