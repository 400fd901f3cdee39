"""Features of a proposed element: support of the variants, position, and observed elements on its floor and column."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, NumericArray
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import ColumnsAndFloors, Rectangle
from facade_core.facade.layout.grids import Grid, box_array
from facade_core.facade.layout.proposals import EXTENSION_VARIANTS, Proposals
from facade_core.facade.layout.rectangles import SHOP, pairwise_iou

_FEATURE_CAP = 20.0
FEATURES_VERSION = 1


def compute_features(
    proposals: Proposals,
    seen: Sequence[Element],
    fitted: Sequence[Grid],
    facade: ColumnsAndFloors,
    domain: Rectangle,
    region: Float64Array,
) -> Float32Array:
    """Compute the features of all proposals; none depends on the unit or the facade's place.

    Parameters
    ----------
    proposals : N proposals.
    seen : observed elements.
    fitted : their grids.
    facade : their columns and floors.
    domain : (x0, y0, x1, y1) of the facade.
    region : (M, 4) visible boxes.

    Returns
    -------
    (N, features) float32.
    """
    box, label = proposals.box, proposals.label.astype(int)
    if not len(box):
        return np.zeros((0, 0), np.float32)
    extent = np.array([domain[2] - domain[0], domain[3] - domain[1]])
    middle = (domain[0] + domain[2]) / 2
    observed = box_array(seen)
    observed_label = np.array([ELEMENT_CLASSES.index(e.label) if e.label in ELEMENT_CLASSES else -1 for e in seen], int)
    same = label[:, None] == observed_label
    side, centre = box[:, 2:] - box[:, :2], (box[:, :2] + box[:, 2:]) / 2
    unit = facade.size
    pitch = np.array([_median_pitch(facade.columns), _median_pitch(facade.floors)])
    mirrored = observed.copy()
    mirrored[:, [0, 2]] = 2 * middle - observed[:, [2, 0]]

    columns: list[NumericArray] = [(label == k).astype(float) for k in range(len(ELEMENT_CLASSES))]
    columns += _support_features(proposals.support)
    columns.append(_row_max(pairwise_iou(box, mirrored) * same))
    low, high = box[:, :2] - domain[:2], np.array(domain[2:]) - box[:, 2:]
    margin_seen = _min_margin(observed, domain)
    for axis in (0, 1):
        columns += [
            np.minimum(low[:, axis] / unit[axis], _FEATURE_CAP),
            np.minimum(high[:, axis] / unit[axis], _FEATURE_CAP),
        ]
        columns += [
            side[:, axis] / unit[axis],
            side[:, axis] / extent[axis],
            (centre[:, axis] - domain[axis]) / extent[axis],
        ]
        columns.append(_capped_ratio(side[:, axis], pitch[axis]))
        columns.append(np.full(len(box), extent[axis] / unit[axis]))
    columns += [np.abs(centre[:, 0] - middle) / unit[0], np.log(side[:, 0] / side[:, 1])]
    columns += [np.abs(low[:, 0] - margin_seen) / unit[0], np.abs(high[:, 0] - margin_seen) / unit[0]]
    columns.append(_capped_ratio(facade.ground - box[:, 3], unit[1]))
    columns.append(_capped_ratio(facade.ground - centre[:, 1], pitch[1]))
    columns += _alignment_features(box, centre, side, observed, same)
    columns += _alignment_features(box, centre, side, observed, observed_label[None] == 0)
    columns += _rival_features(proposals, centre, side)
    floor = _visible_share(box, domain, region, vertical=False)
    column = _visible_share(box, domain, region, vertical=True)
    columns += [floor, column]
    counts = np.array([(observed_label == k).sum() for k in range(len(ELEMENT_CLASSES))], float)
    columns += [np.full(len(box), c) for c in counts]
    covered = sum(_box_area(np.clip(r, (*domain[:2], *domain[:2]), (*domain[2:], *domain[2:]))) for r in region)
    bottom = np.full((1, 4), (domain[0], domain[3] - 0.08 * extent[1], domain[2], domain[3]))
    facts = [
        covered / extent.prod(),
        float(_visible_share(bottom, domain, region, vertical=False)[0]),
        len(facade.columns),
        len(facade.floors),
        *_regularity(facade.columns),
        *_regularity(facade.floors),
        max((g.completeness * (g.cells >= 0).sum() for g in fitted), default=0.0) / max(1, len(seen)),
        extent[0] / extent[1],
        counts[1] / max(1.0, counts[0]),
    ]
    columns += [np.full(len(box), float(f)) for f in facts]
    columns.append(_capped_ratio(_nearest_distance(centre[:, 0], facade.columns), unit[0]))
    columns.append(_capped_ratio(_nearest_distance(centre[:, 0], 2 * middle - facade.columns), unit[0]))
    columns.append(_capped_ratio(_nearest_distance(centre[:, 1], facade.floors), unit[1]))
    shops = observed[observed_label == SHOP]
    columns.append(np.full(len(box), (np.median(shops[:, 3] - shops[:, 1]) / unit[1]) if len(shops) else 0.0))
    return np.nan_to_num(np.column_stack(columns), nan=-1.0, posinf=_FEATURE_CAP, neginf=-_FEATURE_CAP).astype(
        np.float32
    )


def _support_features(support: Float32Array) -> list[NumericArray]:
    """Return how many variants agree, and how well."""
    n = len(EXTENSION_VARIANTS)
    held = support[:, :n] >= 0.5
    columns = [held.mean(axis=1), support[:, :n].mean(axis=1)]
    columns += [support[:, v] for v in range(support.shape[1])]
    columns.append((support >= 0.5).sum(axis=1))
    return columns


def _alignment_features(
    box: Float64Array, centre: Float64Array, side: Float64Array, observed: Float64Array, same: BoolArray
) -> list[Float64Array]:
    """Return count, alignment, distance and size difference of observed elements on the floor and the column."""
    if not len(observed):
        return [np.full(len(box), v) for v in (0.0, 0.0, 1.0, 1.0, _FEATURE_CAP, _FEATURE_CAP, 1.0, 1.0)]
    middle, extent = (observed[:, :2] + observed[:, 2:]) / 2, observed[:, 2:] - observed[:, :2]
    away = np.abs(centre[:, None] - middle) / side[:, None]
    in_floor, in_column = same & (away[..., 1] < 0.3), same & (away[..., 0] < 0.3)
    unlike = np.abs(np.log(extent[None] / side[:, None]))
    found = [in_floor.sum(axis=1), in_column.sum(axis=1)]
    found += [_masked_min(away[..., 1], same, 1.0), _masked_min(away[..., 0], same, 1.0)]
    found += [_masked_min(away[..., 0], in_floor, _FEATURE_CAP), _masked_min(away[..., 1], in_column, _FEATURE_CAP)]
    found += [_masked_min(unlike[..., 0], in_column, 1.0), _masked_min(unlike[..., 1], in_floor, 1.0)]
    return [f.astype(float) for f in found]


def _rival_features(proposals: Proposals, centre: Float64Array, side: Float64Array) -> list[Float64Array]:
    """Return the support of overlapping guesses of the same and of other labels, and the rank among them."""
    agreed = (proposals.support >= 0.5).mean(axis=1)
    shared = pairwise_iou(proposals.box, proposals.box)
    np.fill_diagonal(shared, 0)
    same = proposals.label[:, None] == proposals.label
    rival, other = (shared * same * agreed).max(axis=1), (shared * ~same * agreed).max(axis=1)
    better = ((shared > 0.1) & same & (agreed > agreed[:, None])).sum(axis=1)
    return [rival, other, better.astype(float), ((shared > 0) & same).sum(axis=1).astype(float)]


def _visible_share(box: Float64Array, domain: Rectangle, region: Float64Array, *, vertical: bool) -> Float64Array:
    """Return the (N,) visible share of each element's floor, or column, over the whole domain."""
    band = box.copy()
    a = 1 if vertical else 0
    band[:, a], band[:, a + 2] = domain[a], domain[a + 2]
    if not len(region):
        return np.zeros(len(box))
    low = np.maximum(band[:, None, :2], region[:, :2])
    sides = np.clip(np.minimum(band[:, None, 2:], region[:, 2:]) - low, 0, None)
    area = ((band[:, 2:] - band[:, :2]).prod(axis=1)).clip(1e-12)
    share: Float64Array = np.minimum(sides.prod(axis=2).sum(axis=1) / area, 1.0)
    return share


def _min_margin(observed: Float64Array, domain: Rectangle) -> float:
    return float(min((observed[:, 0] - domain[0]).min(), (domain[2] - observed[:, 2]).min())) if len(observed) else 0.0


def _median_pitch(lines: Float64Array) -> float:
    return float(np.median(np.diff(lines))) if len(lines) > 1 else np.nan


def _regularity(lines: Float64Array) -> tuple[float, float]:
    gaps = np.diff(lines)
    return (float(gaps.std() / gaps.mean()), float(gaps.min() / gaps.mean())) if len(gaps) > 1 else (-1.0, -1.0)


def _capped_ratio(values: Float64Array, unit: float) -> Float64Array:
    return np.minimum(values / unit, _FEATURE_CAP)


def _nearest_distance(values: Float64Array, lines: Float64Array) -> Float64Array:
    return np.abs(values[:, None] - lines).min(axis=1) if len(lines) else np.full(len(values), np.inf)


def _row_max(values: Float64Array) -> Float64Array:
    return values.max(axis=1) if values.shape[1] else np.zeros(len(values))


def _masked_min(values: Float64Array, where: BoolArray, otherwise: float) -> Float64Array:
    lowest: Float64Array = np.where(where, values, otherwise).min(axis=1)
    return lowest


def _box_area(box: Float64Array) -> float:
    return float(max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1]))
