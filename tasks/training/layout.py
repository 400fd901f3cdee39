"""Training of the shipped layout model, and of the benchmark's folds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from catalogs.learning.layouts import LayoutRecord, read_layouts, split_layouts_for_training
from facade_core.facade.layout import learning
from facade_core.facade.layout.model import save_layout_model
from tasks.engine.progress import begin_stage, report_progress


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
    train, _ = split_layouts_for_training(list(read_layouts(data / "layouts" / "cmp.jsonl")), fold)
    if size is not None:
        train = [train[k * len(train) // size] for k in range(min(size, len(train)))]
    train = [*train, *corrected]
    metric = list(read_layouts(data / "layouts" / "ingolstadt_lod3_metres.jsonl"))
    model = learning.learn_layout_model(
        [(record.elements, record.domain) for record in train],
        names=[record.name for record in train],
        metric=[(record.elements, record.domain) for record in metric],
        seed=seed,
        progress=_report_step,
    )
    path = out / "layouts.json"
    save_layout_model(model, path, seed=seed)
    return path


def _report_step(step: str, done: int, total: int) -> None:
    if done <= 1:
        begin_stage(step, total)
    report_progress(step, min(done, 1))
