"""Training of the shipped layout model and network, and of the benchmark's folds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.painter.facade_plan import plan_facade
from benchmarks.painter.styles import STYLE_BY_NAME, STYLES
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import LAYOUT_NETWORK_NAME, Element
from facade_core.facade.layout.densities import TERMS
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.model import MADE_FOR, LayoutModel
from facade_core.facade.layout.ranking import BoostedTrees
from training.datasets.layouts import read_layouts, split_layouts_for_training
from training.layout import learning
from training.layout.network_export import save_layout_network
from training.layout.network_training import NetworkSchedule, train_layout_network
from training.layout.ranking_examples import Layout
from training.model_files import write_json_model

# Planned facades of the network's training, their seed, and the metres of one of their pixels.
PLAN_COUNT = 1500
PLAN_SEED = 7
PLAN_METRES = 0.05
# Layouts with fewer elements, and plans with more, do not train the network.
MIN_ELEMENTS = 4
MAX_PLAN_ELEMENTS = 200
_SHIPPED_SCHEDULE = NetworkSchedule()


def train_layout(
    data: Path,
    out: Path,
    *,
    seed: int,
    fold: int = 0,
    size: int | None = None,
    corrected: Sequence[LayoutRecord] = (),
) -> Path:
    """Train the layout model on layouts/cmp.jsonl and on metric layouts, and write layouts.json.

    Parameters
    ----------
    data : data folder.
    out : target folder.
    seed : random seed.
    fold : every fifth layout from this one on is held out.
    size : number of training layouts, spread evenly; None: all.
    corrected : layouts with corrections, added to the training set.
    """
    train = _training_layouts(data, fold, size, corrected)
    metric = list(read_layouts(data / "layouts" / "ingolstadt_lod3_metres.jsonl"))
    model = learning.learn_layout_model(
        [(record.elements, record.domain) for record in train],
        names=[record.name for record in train],
        metric=[(record.elements, record.domain) for record in metric],
        seed=seed,
    )
    path = out / "layouts.json"
    save_layout_model(model, path, seed=seed)
    return path


def train_network(
    data: Path,
    out: Path,
    *,
    seed: int,
    fold: int = 0,
    size: int | None = None,
    corrected: Sequence[LayoutRecord] = (),
    schedule: NetworkSchedule = _SHIPPED_SCHEDULE,
) -> Path:
    """Train the layout network on the layouts of `train_layout` and on plans of painted facades.

    Writes layout_network.onnx and its .json. Needs torch; without a GPU it takes days.

    Parameters
    ----------
    data, out, seed, fold, size, corrected : as in `train_layout`.
    schedule : training schedule.
    """
    train = _training_layouts(data, fold, size, corrected)
    weights = train_layout_network(
        [
            layout
            for record in train
            if len((layout := _drawn_elements(record.elements, record.domain))[0]) >= MIN_ELEMENTS
        ],
        _plan_layouts(PLAN_COUNT),
        schedule,
        seed=seed,
    )
    path = out / LAYOUT_NETWORK_NAME
    save_layout_network(weights, path, training_set=[record.name for record in train], seed=seed)
    return path


def has_gpu() -> bool:
    """Return whether torch is installed and finds a GPU."""
    try:
        import torch
    except ImportError:
        return False
    return bool(torch.cuda.is_available())


def _training_layouts(data: Path, fold: int, size: int | None, corrected: Sequence[LayoutRecord]) -> list[LayoutRecord]:
    train, _ = split_layouts_for_training(list(read_layouts(data / "layouts" / "cmp.jsonl")), fold)
    if size is not None:
        train = [train[k * len(train) // size] for k in range(min(size, len(train)))]
    return [*train, *corrected]


def _drawn_elements(elements: Sequence[Element], domain: Rectangle) -> Layout:
    return [e for e in elements if e.label in ELEMENT_CLASSES], domain


def _plan_layouts(count: int) -> list[Layout]:
    """Return the layouts of planned facades of all styles."""
    rng = np.random.default_rng(PLAN_SEED)
    found: list[Layout] = []
    while len(found) < count:
        floors, columns = int(rng.integers(2, 9)), int(rng.integers(2, 13))
        height = floors * rng.uniform(2.9, 4.2) + rng.uniform(0, 4)
        width = columns * rng.uniform(1.6, 3.8)
        style = STYLE_BY_NAME[STYLES[int(rng.integers(len(STYLES)))]]
        pixels = (round(height / PLAN_METRES), round(width / PLAN_METRES))
        plan = plan_facade(style, *pixels, floors=floors, columns=columns, metres_per_pixel=PLAN_METRES, rng=rng)
        layout = _drawn_elements(plan.elements(), (0.0, 0.0, float(plan.width), float(plan.height)))
        if MIN_ELEMENTS <= len(layout[0]) <= MAX_PLAN_ELEMENTS:
            found.append(layout)
    return found


def save_layout_model(model: LayoutModel, path: str | Path, *, seed: int) -> None:
    """Write a layout model to a JSON file; equal models give equal bytes."""
    write_json_model(Path(path), _to_record(model), MADE_FOR, seed=seed, training_set=list(model.training_set))


def _to_record(model: LayoutModel) -> JsonObject:
    return {
        "mixtures": model.densities.mixtures.tolist(),
        "patterns": model.densities.patterns.tolist(),
        "symmetry": model.densities.symmetry.tolist(),
        "compatibility": model.densities.compatibility.tolist(),
        "weights": dict(zip(TERMS, model.weights.tolist(), strict=True)),
        "mean": model.averages_terms,
        "policies": model.policies.tolist(),
        "labels": model.label_shares.tolist(),
        "doors": model.priors.door_sizes.tolist(),
        "shops": model.priors.shop_sizes.tolist(),
        "floors": model.priors.floor_progressions.tolist(),
        "ratios": model.priors.size_to_spacing.tolist(),
        "styles": model.styles.tolist(),
        "metric": dict(model.metric_pitches),
        "likely": model.min_probability.tolist(),
        "trees": {
            "base": model.trees.base,
            **{name: getattr(model.trees, name).tolist() for name in BoostedTrees._fields if name != "base"},
        },
    }
