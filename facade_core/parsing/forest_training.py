"""Training of the two forests, and the files they are shipped in.

Needs the `train` extra (onnx, skl2onnx). The second forest sees the first one's votes (auto-context); it learns from
votes on facades that the voting forest was not trained on, as it will meet them later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.core.labels import CLASSES, UNKNOWN
from facade_core.core.model_file import write_model
from facade_core.parsing import forest_features
from facade_core.parsing.forest import FIRST, SECOND, load

if TYPE_CHECKING:
    from sklearn.ensemble import RandomForestClassifier

Sample = tuple[np.ndarray, np.ndarray]
Progress = Callable[[str, int, int], None]

_TREES = 40
_LEAVES = 1000
_FOLDS = 3
_FOLD_TREES = 14
_VIEWS = 5
_CELLS = 1250
_ROWS_PER_TREE = 100_000


def train(samples: Iterable[Sample], *, seed: int, progress: Progress | None = None) -> bytes:
    """Train the parser: (image, labels) pairs -> ONNX file content.

    images are (H, W, 3) uint8, labels (H, W) uint8 with the ids of `facade_core.core.labels` (UNKNOWN is left out).
    progress is called with the name of the step, the units done and their number. Equal samples in equal order and
    an equal seed give an equal model. Raises ImageError for samples that cannot be used.
    """
    report = progress or (lambda step, done, total: None)
    samples = _checked(samples)
    rng = np.random.default_rng(seed)
    views = [view for sample in samples for view in _views(sample, rng)]
    origin = np.repeat(np.arange(len(samples)), _VIEWS)
    picks = [_pick(labels, rng) for _, labels in views]
    target = np.concatenate([_cell_labels(labels)[pick] for (_, labels), pick in zip(views, picks, strict=True)])
    group = np.concatenate([np.full(len(pick), name) for pick, name in zip(picks, origin, strict=True)])

    rows = []
    for done, ((image, _), pick) in enumerate(zip(views, picks, strict=True)):
        report("features", done, len(views))
        rows.append(_flat(forest_features.appearance(image))[pick])
    first_rows = np.concatenate(rows)
    report("first forest", 0, 1)
    first = _fit(first_rows, target, _TREES, rng)

    fold = rng.permutation(len(samples)) % min(_FOLDS, len(samples))
    rows = [np.empty(0)] * len(views)
    for number in range(int(fold.max()) + 1):
        report("held-out votes", number, int(fold.max()) + 1)
        others = fold[group] != number
        voter = _fit(first_rows[others], target[others], _FOLD_TREES, rng) if others.any() else first
        for index in np.flatnonzero(fold[origin] == number):
            seen = forest_features.appearance(views[index][0])
            vote = _vote(voter, _flat(seen)).reshape(*seen.shape[:2], len(CLASSES))
            rows[index] = _flat(forest_features.context(vote, seen))[picks[index]]
    report("second forest", 0, 1)
    second = _fit(np.concatenate(rows), target, _TREES, rng)
    return _to_onnx(first, second)


def save(
    model: bytes, path: Path, *, training_set: Sequence[str], seed: int, figures: dict[str, Any] | None = None
) -> None:
    """Write a trained model and, beside it, the .json that `parse` checks it against.

    training_set names the facades trained on; figures are the scores measured on facades that were not.
    """
    record = {
        "feature_version": forest_features.FEATURE_VERSION,
        "seed": seed,
        "training_set": list(training_set),
        "figures": figures or {},
    }
    write_model(model, Path(path), record)
    load(path)


def _checked(samples: Iterable[Sample]) -> list[Sample]:
    checked = []
    for number, (image, labels) in enumerate(samples):
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
            raise ImageError(f"training sample {number}: image must be uint8 RGB (H, W, 3), not {image.shape}")
        if labels.shape != image.shape[:2]:
            raise ImageError(f"training sample {number}: labels {labels.shape} must have the image's size")
        known = labels[labels != UNKNOWN]
        if known.size == 0 or known.max() >= len(CLASSES):
            raise ImageError(f"training sample {number}: map its labels to the ids 0..6 and 255, some of them 0..6")
        checked.append((image, labels))
    if not checked:
        raise ImageError("no training samples: give at least one labelled facade")
    return checked


def _views(sample: Sample, rng: np.random.Generator) -> list[Sample]:
    """The facade itself, a crop painted in flat colours, and crops in other light, some with blank borders.

    Rectified textures often end below the roof or above the shops, and show nothing along a border.
    """
    crops = [_scale(_crop(sample, rng), rng) for _ in range(_VIEWS - 1)]
    crops[0] = _paint(crops[0], rng)
    return [sample] + [_blank_border(_jitter(crop, rng), rng) for crop in crops]


def _paint(sample: Sample, rng: np.random.Generator) -> Sample:
    """Draw each class mostly in its mean colour, shifted a little."""
    image, labels = sample
    painted = image.astype(np.float64)
    opacity = rng.uniform(0.6, 1.0)
    for label in np.unique(labels[labels != UNKNOWN]):
        here = labels == label
        colour = image[here].mean(0) + rng.normal(0, 20) + rng.normal(0, 10, 3)
        painted[here] += opacity * (colour - painted[here])
    return np.clip(np.rint(painted), 0, 255).astype(np.uint8), labels


def _blank_border(sample: Sample, rng: np.random.Generator) -> Sample:
    image, labels = sample
    if rng.random() < 0.2:
        image = image.copy()
        thickness = rng.integers(1, 1 + max(1, min(labels.shape) // 25))
        turned = np.rot90(image, int(rng.integers(4)))  # a view: what is written to it is written to the image
        turned[:thickness] = rng.choice([0, 255])
    return image, labels


def _crop(sample: Sample, rng: np.random.Generator) -> Sample:
    image, labels = sample
    height, width = labels.shape
    top = rng.uniform(0.1, 0.4) if rng.random() < 0.6 else 0.0
    bottom = rng.uniform(0.05, 0.3) if rng.random() < 0.3 else 0.0
    left, right = rng.uniform(0, 0.3, 2) * (rng.random(2) < 0.4)
    y0, y1 = int(top * height), max(height - int(bottom * height), int(top * height) + 1)
    x0, x1 = int(left * width), max(width - int(right * width), int(left * width) + 1)
    image, labels = image[y0:y1, x0:x1], labels[y0:y1, x0:x1]
    if rng.random() < 0.5:
        image, labels = image[:, ::-1], labels[:, ::-1]
    return image, labels


def _scale(sample: Sample, rng: np.random.Generator) -> Sample:
    import cv2

    image, labels = sample
    factor = np.exp(rng.uniform(np.log(0.65), np.log(1.4)))
    size = tuple(max(1, round(side * factor)) for side in labels.shape[::-1])
    mode = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    return (
        cv2.resize(np.ascontiguousarray(image), size, interpolation=mode),
        cv2.resize(np.ascontiguousarray(labels), size, interpolation=cv2.INTER_NEAREST),
    )


def _jitter(sample: Sample, rng: np.random.Generator) -> Sample:
    image, labels = sample
    light = (image / 255.0) ** np.exp(rng.normal(0, 0.25)) * np.exp(rng.normal(0, 0.1))
    grey = light.mean(2, keepdims=True)
    tinted = (grey + (light - grey) * rng.uniform(0.4, 1.3)) * np.exp(rng.normal(0, 0.06, 3))
    return np.rint(np.clip(tinted, 0, 1) * 255).astype(np.uint8), labels


def _cell_labels(labels: np.ndarray) -> np.ndarray:
    """The label in the middle of each cell, flat and row-major."""
    height, width = labels.shape
    rows = np.minimum(np.arange(0, height, forest_features.CELL) + forest_features.CELL // 2, height - 1)
    columns = np.minimum(np.arange(0, width, forest_features.CELL) + forest_features.CELL // 2, width - 1)
    return labels[np.ix_(rows, columns)].reshape(-1)


def _pick(labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Indices of the cells of a view to learn from; rare classes are drawn somewhat more often than they occur."""
    cells = _cell_labels(labels)
    known = np.flatnonzero(cells != UNKNOWN)
    if known.size == 0:
        return known
    share = np.bincount(cells[known], minlength=len(CLASSES)) / known.size
    odds = share[cells[known]] ** -0.3
    return rng.choice(known, min(_CELLS, known.size), replace=False, p=odds / odds.sum())


def _flat(rows: np.ndarray) -> np.ndarray:
    return rows.reshape(-1, rows.shape[-1])


def _fit(rows: np.ndarray, target: np.ndarray, trees: int, rng: np.random.Generator) -> RandomForestClassifier:
    from sklearn.ensemble import RandomForestClassifier

    forest = RandomForestClassifier(
        trees,
        max_leaf_nodes=_LEAVES,
        min_samples_leaf=4,
        max_features=0.15,
        max_samples=min(1.0, _ROWS_PER_TREE / len(rows)),
        random_state=int(rng.integers(2**31)),
        n_jobs=-1,
    )
    forest.fit(rows, target)
    # Voting in threads adds the trees up in the order in which they come.
    return forest.set_params(n_jobs=1)


def _vote(forest: RandomForestClassifier, rows: np.ndarray) -> np.ndarray:
    votes = np.zeros((len(rows), len(CLASSES)), np.float32)
    votes[:, forest.classes_] = forest.predict_proba(rows)
    return votes


def _slim(ensemble: Any) -> None:
    """Leave out leaf weights of zero and attributes at their defaults: a third of the file."""
    attributes = {attribute.name: attribute for attribute in ensemble.attribute}
    kept = np.flatnonzero(np.array(attributes["class_weights"].floats))
    for name, kind in (
        ("class_ids", "ints"),
        ("class_nodeids", "ints"),
        ("class_treeids", "ints"),
        ("class_weights", "floats"),
    ):
        values = np.array(getattr(attributes[name], kind))[kept].tolist()
        attributes[name].ClearField(kind)
        getattr(attributes[name], kind).extend(values)
    for name in ("nodes_hitrates", "nodes_missing_value_tracks_true"):
        ensemble.attribute.remove(attributes[name])


def _to_onnx(first: RandomForestClassifier, second: RandomForestClassifier) -> bytes:
    """One graph with both forests side by side, each from its own rows to (n, 7) votes."""
    from onnx import compose

    both = compose.merge_models(_graph(first, FIRST), _graph(second, SECOND), io_map=[])
    return both.SerializeToString()


def _graph(forest: RandomForestClassifier, name: str) -> Any:
    from onnx import TensorProto, compose, helper, numpy_helper
    from skl2onnx import to_onnx
    from skl2onnx.common.data_types import FloatTensorType

    model = to_onnx(
        forest,
        initial_types=[("rows", FloatTensorType([None, forest.n_features_in_]))],
        options={"zipmap": False, "output_class_labels": False},
        target_opset={"": 17, "ai.onnx.ml": 3},
    )
    # A class without a training pixel has no vote of its own: spread the known classes over all seven columns.
    spread = np.eye(len(CLASSES), dtype=np.float32)[forest.classes_]
    graph = model.graph
    _slim(graph.node[0])
    graph.initializer.append(numpy_helper.from_array(spread, "spread"))
    graph.node.append(helper.make_node("MatMul", ["probabilities", "spread"], ["votes"]))
    del graph.output[:]
    graph.output.append(helper.make_tensor_value_info("votes", TensorProto.FLOAT, [None, len(CLASSES)]))
    return compose.add_prefix(model, name + "_")
