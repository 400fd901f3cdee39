"""Training of a translation network: `python -m benchmarks.papers.translator.train --style PICTURES --out OUT`.

Learns from painted streets, procedural ones and those of runs (--from), and from a city's pictures. Needs the `train` extra.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.papers.translator import network_training as training
from benchmarks.papers.translator.crops import PANORAMA_HEIGHT, RealPicture, resample_photo
from benchmarks.papers.translator.steps import TrainingDomains, TrainingRecipe
from benchmarks.papers.translator.street_renderings import VALIDATION_STRIDE, render_training_views
from catalogs.readers.pictures.decoding import open_picture
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import FacadeError, InputError
from training.torch_files import require_torch

# Photos are reduced to this many pixels along the longer side when they are read.
_PHOTO_SIDE = 640


@dataclass(frozen=True)
class PictureSplitPrefixes:
    """File-name prefixes that assign pictures to validation or exclude them.

    Attributes
    ----------
    validation : prefixes of pictures that select a checkpoint; empty: the last fifth.
    excluded : prefixes of pictures that are not used.
    """

    validation: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()


def main() -> None:
    """Train a network on a city's pictures and write it to OUT; resumes from the last checkpoint."""
    from flows.step_reporter import show_progress

    parser = argparse.ArgumentParser(prog="python -m benchmarks.papers.translator.train", description=main.__doc__)
    parser.add_argument(
        "--style",
        type=Path,
        action="append",
        required=True,
        metavar="PICTURES",
        help="folder of a city's street photos and panoramas (twice as wide as high)",
    )
    parser.add_argument(
        "--from", type=Path, action="append", default=[], dest="runs", metavar="OUT", help="run to render streets of"
    )
    parser.add_argument(
        "--judge-by",
        action="append",
        default=[],
        metavar="PREFIX",
        help="name prefix of pictures that rank checkpoints; without, the last fifth",
    )
    parser.add_argument(
        "--leave-out", action="append", default=[], metavar="PREFIX", help="name prefix of pictures to exclude"
    )
    parser.add_argument(
        "--out", type=Path, required=True, help="folder of translator.onnx, its .json and the training state"
    )
    parser.add_argument("--steps", type=int, default=training.RECIPE.steps, help="number of steps")
    parser.add_argument("--seed", type=int, default=0, help="0 for the network in models/")
    options = parser.parse_args()
    for folder in (*options.style, *options.runs):
        if not folder.is_dir():
            parser.error(f"{folder}: no such folder")
    if options.steps < 1:
        parser.error(f"--steps: {options.steps} is less than 1")
    recipe = replace(training.RECIPE, steps=options.steps)
    split = PictureSplitPrefixes(tuple(options.judge_by), tuple(options.leave_out))
    with show_progress():
        path = train_translator(options.style, options.runs, options.out, seed=options.seed, recipe=recipe, split=split)
    print(path)


def train_translator(
    style: Sequence[Path],
    runs: Sequence[Path],
    out: Path,
    *,
    seed: int,
    recipe: TrainingRecipe,
    split: PictureSplitPrefixes,
) -> Path:
    """Train on a city's pictures and on renderings of procedural streets and of runs.

    Writes translator.onnx, translator.json and a picture of each checkpoint into `out`. An interrupted run resumes from
    translator.state.

    Parameters
    ----------
    style : folders of street photos and panoramas.
    runs : folders of finished runs whose streets are rendered.
    out : target folder.
    seed : random seed.
    recipe : training recipe.
    split : assignment of pictures.

    Raises
    ------
    InputError : there are no pictures to train on, or none to validate on.
    ModelError : torch is not installed.
    """
    from benchmarks.papers.translator import network_export

    require_torch()  # before minutes of rendering
    learnt, judged, names = read_picture_sets(list_pictures(style), split)
    out.mkdir(parents=True, exist_ok=True)
    rendered, rendered_judged = render_training_views(runs, seed=seed)
    domains = TrainingDomains(rendered, learnt, rendered_judged, judged)
    trained = training.train_generator(
        domains,
        recipe,
        seed=seed,
        state=out / "translator.state",
        sample=_checkpoint_writer(out),
    )
    path = out / "translator.onnx"
    record = {
        "seed": seed,
        "training_set": [*names, *(f"rendered/{run.resolve().name}" for run in runs), "rendered/procedural"],
        "trained_on": {
            **{folder.resolve().name: "that of its pictures" for folder in style},
            **{f"renderings of {run.resolve().name}": "that of its pictures and map" for run in runs},
            "rendered procedural streets": "painted by Streetloom",
        },
        "held_out": [*split.validation, *split.excluded],
        "best_step": trained.step,
        "kernel_distances": {str(step): round(value, 4) for step, value in trained.distances.items()},
    }
    network_export.save_generator(trained.weights, recipe, path, record)
    return path


def list_pictures(folders: Sequence[Path]) -> list[tuple[str, Path]]:
    """List the pictures in folders recursively as (name, file)."""
    return [
        (f"{folder.name}/{path.name}", path)
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if path.suffix.lower() in (".jpg", ".jpeg", ".png")
    ]


def read_picture_sets(
    pictures: Sequence[tuple[str, Path]], split: PictureSplitPrefixes
) -> tuple[list[RealPicture], list[RealPicture], list[str]]:
    """Load pictures for training and validation.

    Parameters
    ----------
    pictures : (name, file) of each picture.
    split : assignment of pictures.

    Returns
    -------
    training, validation : pictures as panoramas show them.
    names : names of the training pictures.

    Raises
    ------
    InputError : one of the sets is empty.
    """
    used = [
        (name, path)
        for name, path in {path.resolve(): (name, path) for name, path in pictures}.values()
        if not (split.excluded and path.name.startswith(split.excluded))
    ]
    judges = (
        [path.name.startswith(split.validation) for _, path in used]
        if split.validation
        else _assign_validation(len(used))
    )
    learnt = [_read_picture(path) for (_, path), judge in zip(used, judges, strict=True) if judge is False]
    judged = [_read_picture(path) for (_, path), judge in zip(used, judges, strict=True) if judge]
    if not learnt or not judged:
        raise InputError(
            f"{', '.join(sorted({str(path.parent) for _, path in pictures})) or 'no picture'}: {len(learnt)} pictures "
            f"to learn from and {len(judged)} to judge by; give both, and the beginning of the names of the latter with "
            "--judge-by"
        )
    return learnt, judged, [name for (name, _), judge in zip(used, judges, strict=True) if judge is False]


def _read_picture(path: Path) -> RealPicture:
    """Read a panorama, twice as wide as high, or a photo."""
    from PIL import Image

    with open_picture(path) as picture:
        is_panorama = picture.width == 2 * picture.height
        share = min(1.0, _PHOTO_SIDE / max(picture.size))
        size = (
            (2 * PANORAMA_HEIGHT, PANORAMA_HEIGHT)
            if is_panorama
            else (max(1, round(picture.width * share)), max(1, round(picture.height * share)))
        )
        image: UInt8Array = np.asarray(picture.convert("RGB").resize(size, Image.Resampling.BOX))
    return RealPicture(image) if is_panorama else resample_photo(image)


def _assign_validation(count: int) -> list[bool | None]:
    """Assign pictures in name order to training (False), validation (True) or neither (None).

    Validation is the last fifth. A gap of half its size before it is unused, because it shows the same walls.
    """
    judging = -(-count // VALIDATION_STRIDE)
    between = judging // 2
    return [False] * (count - judging - between) + [None] * between + [True] * judging


def _checkpoint_writer(out: Path) -> Callable[[int, float, UInt8Array], None]:
    """Return a callback that writes a picture of each checkpoint and its kernel distance."""

    def sample(step: int, distance: float, sheet: UInt8Array) -> None:
        from PIL import Image

        Image.fromarray(sheet).save(out / f"step-{step:06d}.png")
        with (out / "distances.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, "kernel_distance": round(distance, 4)}) + "\n")

    return sample


if __name__ == "__main__":
    try:
        main()
    except FacadeError as error:
        raise SystemExit(str(error)) from None
