"""Train the layout model that is shipped, and those of the benchmark's folds, from a data folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from catalogs.learning.layouts import LayoutRecord, read_layouts, split_layouts
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
    """Train on layouts/cmp.jsonl without every fifth from `fold` on, and on the metric layouts; writes layouts.json into `out`.

    size: so many of the training layouts only, spread evenly; corrected: layouts that people corrected, which are added.
    """
    train, _ = split_layouts(list(read_layouts(data / "layouts" / "cmp.jsonl")), fold)
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
