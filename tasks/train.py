"""Train the shipped models from a data folder."""

from __future__ import annotations

from pathlib import Path

from catalogs.datasets import ecp, split
from facade_core.parse import training
from tasks.progress import advance, begin_stage


def train_parser(data: Path, out: Path, *, seed: int) -> Path:
    """Train the facade parser on facades/ecp without its held-out fold; writes forest.onnx and forest.json into `out`."""
    reached: dict[str, int] = {}

    def progress(step: str, done: int, total: int) -> None:
        if step not in reached:
            begin_stage(step, total)
        advance(step, done - reached.get(step, 0))
        reached[step] = done

    train, _ = split(list(ecp(data / "facades" / "ecp")))
    model = training.train([(f.image, f.labels) for f in train], seed=seed, progress=progress)
    out.mkdir(parents=True, exist_ok=True)
    path = out / "forest.onnx"
    training.save(model, path, training_set=[f"ecp/{f.name}" for f in train], seed=seed)
    return path
