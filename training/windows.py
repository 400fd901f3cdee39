"""Training of the shipped metric of windows, from windows whose states were marked by eye and from painted ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.painter.facade import paint_facade
from benchmarks.painter.styles import STYLES
from catalogs.readers.pictures.decoding import open_picture
from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.variation.group_patches import cut_group_patches
from facade_core.facade.variation.variations import clip_to_image
from facade_core.facade.variation.window_features import compute_window_features
from facade_core.facade.variation.window_pairs import GroupAppearance, group_context, iterate_pair_features
from facade_core.facade.variation.window_types import (
    MADE_FOR,
    WINDOW_STATES,
    WindowMetric,
    describe_group,
)
from training.datasets.facades import ECP, read_dataset
from training.datasets.layouts import read_layouts
from training.datasets.window_states import Box, read_window_states
from training.model_files import write_json_model
from training.progress import track_progress

if TYPE_CHECKING:
    from sklearn.linear_model import LogisticRegression

# Painted facades have these seeds; the benchmark's are others.
_PAINTED_SEEDS = range(1000, 1004)
# Weight of a painted pair.
_PAINTED_WEIGHT = 0.1
# States that the pairs' regression sees are of models without the facade: folds by facade.
_FOLDS = 6
# Inverse strength of the regularisation.
_STRENGTH = 0.01
# Components of label maps below these sizes are no elements.
_MIN_AREA_PX = 40
_MIN_SIDE_PX = 4


class _Group(NamedTuple):
    """Windows of one size: facade, features, appearance, states ("" where unknown), and whether they are painted."""

    facade: str
    features: Float64Array
    appearance: GroupAppearance
    states: Sequence[str]
    painted: bool


def train_window_metric(data: Path, out: Path) -> Path:
    """Train on the marked windows of facades/ecp and facades/cmp and on painted facades, and write window_types.json.

    Parameters
    ----------
    data : data folder, with facades/ and layouts/.
    out : target folder.
    """
    from threadpoolctl import threadpool_limits

    marked = read_window_states()
    total = len(marked) + len(_PAINTED_SEEDS) * len(STYLES)
    with threadpool_limits(1, user_api="blas"):
        facades = track_progress("facades", _facades(data, marked), total)
        metric = _fit([group for facade in facades for group in _window_groups(*facade)])
    path = out / "window_types.json"
    save_window_metric(metric, path, facades=len(marked), windows=sum(len(windows) for windows in marked.values()))
    return path


def _facades(
    data: Path, marked: Mapping[str, Mapping[Box, str]]
) -> Iterator[tuple[str, UInt8Array, Sequence[Element], Mapping[Box, str], bool]]:
    for facade in read_dataset(ECP, data / "facades" / "ecp"):
        if (name := f"ecp/{facade.name}") in marked:
            yield name, facade.image, _component_elements(facade.labels), marked[name], False
    for record in read_layouts(data / "layouts" / "cmp.jsonl"):
        stem = Path(record.name.split("#")[0]).stem
        if (name := f"cmp/{stem}") in marked:
            with open_picture(data / "facades" / "cmp" / "images" / f"{stem}.jpg") as picture:
                yield name, np.asarray(picture.convert("RGB")), record.elements, marked[name], False
    for seed in _PAINTED_SEEDS:
        for style in STYLES:
            painted = paint_facade((18.0, 16.0), floors=5, columns=6, style=style, metres_per_pixel=0.04, seed=seed)
            states = zip(painted.elements, painted.element_states, strict=True)
            known = {_box(element): state for element, state in states if element.label == "window"}
            yield f"{style}/{seed}", painted.image, painted.elements, known, True


def _component_elements(labels: UInt8Array) -> list[Element]:
    """Return the boxes of the connected components of a label map."""
    import cv2

    found = []
    for name in ELEMENT_CLASSES:
        mask = (labels == CLASSES.index(name)).astype(np.uint8)
        for x, y, width, height, area in cv2.connectedComponentsWithStats(mask, connectivity=8)[2][1:].tolist():
            if area >= _MIN_AREA_PX and min(width, height) >= _MIN_SIDE_PX:
                found.append(Element(name, x, y, x + width, y + height))
    return found


def _box(element: Element) -> Box:
    return round(element.x0), round(element.y0), round(element.x1), round(element.y1)


def _window_groups(
    name: str, image: UInt8Array, elements: Sequence[Element], states: Mapping[Box, str], painted: bool
) -> Iterator[_Group]:
    kept = clip_to_image(elements, image.shape[:2])
    for group in cut_group_patches(image, kept):
        if kept[group.members[0]].label == "window":
            features = compute_window_features(group.patches, group.wall)
            appearance = describe_group(group, features, np.ones(features.shape[1]))
            known = [states.get(_box(kept[i]), "") for i in group.members]
            yield _Group(name, features, appearance, known, painted)


def _fit(groups: Sequence[_Group]) -> WindowMetric:
    """Fit the states, and the pairs on states of models that have not seen their facade."""
    photos = [group for group in groups if not group.painted]
    values = np.concatenate([group.features for group in photos])
    mean, scale = values.mean(axis=0), values.std(axis=0) + 1e-6
    metric = WindowMetric(mean, scale, _fit_states(photos, mean, scale), np.zeros((3, 0)), np.zeros(3))
    names = sorted({group.facade for group in photos})
    fold = {name: number % _FOLDS for number, name in enumerate(np.random.default_rng(0).permutation(names).tolist())}
    held_out = [
        metric._replace(state_weights=_fit_states([g for g in photos if fold[g.facade] != k], mean, scale))
        for k in range(_FOLDS)
    ]
    rows, same, weights = [], [], []
    for group in groups:
        states = (metric if group.painted else held_out[fold[group.facade]]).predict_states(group.features)
        known = [i for i, state in enumerate(group.states) if state]
        one, other = (np.array(known, int)[k] for k in np.tril_indices(len(known), -1))
        rows.append(_pair_rows(_scaled(group, scale, states))[one, other])
        same += [group.states[i] == group.states[j] for i, j in zip(one, other, strict=True)]
        weights += [_PAINTED_WEIGHT if group.painted else 1.0] * len(one)
    weight, bias = _fit_logistic(np.concatenate(rows), np.array(same), np.array(weights))
    features = weight[:, 0]
    pairs = (len(features) - 2) // 3
    return metric._replace(
        pair_weights=features[2:].reshape(3, pairs), pair_bias=np.array([bias[0], features[0], features[1]])
    )


def _scaled(group: _Group, scale: Float64Array, states: Float64Array) -> GroupAppearance:
    absolute = group.appearance.features
    return group.appearance._replace(features=absolute / scale[: absolute.shape[1]], states=states)


def _pair_rows(appearance: GroupAppearance) -> Float64Array:
    """Return the (N, N, 2 + 3 F) context, and each pair's features times 1 and the context."""
    features = np.stack(list(iterate_pair_features(appearance)), axis=2)
    context = group_context(appearance)
    parts = [np.broadcast_to(context[1:], (*features.shape[:2], 2)), *(features * value for value in context)]
    return np.concatenate(parts, axis=2)


def _fit_states(groups: Sequence[_Group], mean: Float64Array, scale: Float64Array) -> Float64Array:
    rows = [
        (feature, WINDOW_STATES.index(state))
        for group in groups
        for feature, state in zip((group.features - mean) / scale, group.states, strict=True)
        if state in WINDOW_STATES
    ]
    model = _logistic().fit(np.array([row for row, _ in rows]), [state for _, state in rows])
    return np.concatenate([model.coef_.T, model.intercept_[None]])


def _fit_logistic(rows: Float64Array, same: UInt8Array, weights: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return weights (F, 1) and bias (1,) of standardised features, in the features' own units."""
    mean, scale = rows.mean(axis=0), rows.std(axis=0) + 1e-9
    model = _logistic().fit((rows - mean) / scale, same, sample_weight=weights)
    weight: Float64Array = model.coef_.T / scale[:, None]
    return weight, model.intercept_ - mean @ weight


def _logistic() -> LogisticRegression:
    from sklearn.linear_model import LogisticRegression

    return LogisticRegression(C=_STRENGTH, max_iter=400)


def save_window_metric(metric: WindowMetric, path: Path, **details: object) -> None:
    """Write a metric of windows with its checksum; equal metrics give equal bytes."""
    content = {
        field: np.array([float(f"{v:.6g}") for v in values.ravel()]).reshape(values.shape).tolist()
        for field, values in zip(metric._fields, metric, strict=True)
    }
    write_json_model(path, content, MADE_FOR, **details)
