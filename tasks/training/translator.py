"""Training of a translation network from renderings of blocks and real panoramas."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from catalogs.block.reader import Block, read_block
from catalogs.readers.pictures.decoding import open_picture
from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.streets import Viewpoint
from facade_core.street.translator import training
from facade_core.street.translator.training_steps import TrainingDomains, TrainingRecipe
from facade_core.street.translator.training_views import PANORAMA_WIDTHS, TrainingRendering, render_sequence
from facade_core.synth.furniture import build_street_occluders
from facade_core.synth.model_relief import render_facade_relief
from facade_core.synth.street_truth import synthetic_street
from tasks.engine.progress import begin_stage, report_progress
from tasks.engine.store.status import read_run_block_file
from tasks.stages.ingest.planning import make_plan
from tasks.training.composites import render_composites
from tasks.training.parser import training_progress_callback

# Coarse, because renderings count texels and do not show them.
TEXELS_PER_METRE = 4.0
# Consecutive viewpoints of a run of renderings.
VIEWPOINTS_PER_RUN = 4
RUNS_PER_BLOCK = 16
PROCEDURAL_STREETS = 8
# Validation takes every n-th run of renderings, and the last n-th of the panoramas by default.
VALIDATION_STRIDE = 5


@dataclass(frozen=True)
class PanoramaSplitPrefixes:
    """File-name prefixes that assign panoramas to validation or exclude them.

    Attributes
    ----------
    validation : prefixes of panoramas that select a checkpoint; empty: the last fifth.
    excluded : prefixes of panoramas that are not used.
    """

    validation: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunPanoramas:
    """Block file of a run, and the panoramas of its cameras as (name, file)."""

    block: Path
    pictures: tuple[tuple[str, Path], ...]


def read_run_panoramas(run: Path) -> RunPanoramas:
    """Find the block file and the panoramas of a run.

    Raises
    ------
    InputError : the folder has no run, or its block has no panoramas.
    """
    source = read_run_block_file(run)
    if source is None:
        raise InputError(f"{run}: no run of a block; name the folder that one was written to")
    found = tuple(
        (f"{run.resolve().name}/{one.path.name}", one.path)
        for one in read_block(source).panoramas
        if one.pose.lens is None
    )
    if not found:
        raise InputError(
            f"{source}: its imagery has no panoramas, which are what is learnt from; add some, or use --real"
        )
    return RunPanoramas(source, found)


def train_translator(
    real: Sequence[Path],
    blocks: Sequence[Path],
    out: Path,
    *,
    seed: int,
    recipe: TrainingRecipe,
    split: PanoramaSplitPrefixes,
    runs: Sequence[Path] = (),
    paired: Path | None = None,
) -> Path:
    """Train on panoramas, renderings of blocks and of procedural streets, and composite streets.

    Writes translator.onnx, translator.json and a picture of each checkpoint into `out`. An interrupted run resumes from
    translator.state.

    Parameters
    ----------
    real : folders of panoramas.
    blocks : block files to render.
    out : target folder.
    seed : random seed.
    recipe : training recipe.
    split : assignment of panoramas.
    runs : folders of runs whose blocks and panoramas are used too.
    paired : data folder of composite streets; None: no pairs.

    Raises
    ------
    InputError : there are no panoramas to train on, or none to validate on.
    ModelError : torch is not installed.
    """
    from facade_core.street.translator import network_export

    training.require_torch()  # before minutes of rendering
    streets = [read_run_panoramas(run) for run in runs]
    blocks = [*blocks, *(street.block for street in streets)]
    learnt, judged, names = read_panorama_sets(
        [*list_pictures(real), *(picture for street in streets for picture in street.pictures)], split
    )
    out.mkdir(parents=True, exist_ok=True)
    rendered, rendered_judged = render_training_views(blocks, seed=seed)
    pairs = render_composites(paired, seed=seed) if paired else []
    domains = TrainingDomains(rendered, learnt, rendered_judged, judged, pairs)
    trained = training.train_generator(
        domains,
        recipe,
        seed=seed,
        state=out / "translator.state",
        progress=training_progress_callback(),
        sample=_checkpoint_writer(out),
    )
    path = out / "translator.onnx"
    record = {
        "seed": seed,
        "training_set": names
        + [f"rendered/{block.stem}" for block in blocks]
        + ["rendered/procedural"]
        + (["composite/ecp", "composite/cmp", "composite/materials"] if paired else []),
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


def read_panorama_sets(
    pictures: Sequence[tuple[str, Path]], split: PanoramaSplitPrefixes
) -> tuple[list[UInt8Array], list[UInt8Array], list[str]]:
    """Load panoramas for training and validation.

    Parameters
    ----------
    pictures : (name, file) of each picture.
    split : assignment of panoramas.

    Returns
    -------
    training, validation : (h, w, 3) uint8 images of the largest of PANORAMA_WIDTHS.
    names : names of the training panoramas.

    Raises
    ------
    InputError : one of the sets is empty.
    """
    from PIL import Image

    found = []
    for name, path in {path.resolve(): (name, path) for name, path in pictures}.values():
        with open_picture(path) as picture:
            if picture.width != 2 * picture.height or (split.excluded and path.name.startswith(split.excluded)):
                continue
            small = picture.convert("RGB").resize(
                (max(PANORAMA_WIDTHS), max(PANORAMA_WIDTHS) // 2), Image.Resampling.BOX
            )
        found.append((name, path, np.asarray(small)))
    judges = (
        [path.name.startswith(split.validation) for _, path, _ in found]
        if split.validation
        else _assign_validation(len(found))
    )
    learnt = [image for (_, _, image), judge in zip(found, judges, strict=True) if judge is False]
    judged = [image for (_, _, image), judge in zip(found, judges, strict=True) if judge]
    if not learnt or not judged:
        raise InputError(
            f"{', '.join(sorted({str(path.parent) for _, path in pictures})) or 'no picture'}: "
            f"{len(learnt)} panoramas (pictures twice as wide as high) to learn from and {len(judged)} to judge by; "
            "give both, and the beginning of the names of the latter with --judge-by"
        )
    return learnt, judged, [name for (name, _, _), judge in zip(found, judges, strict=True) if judge is False]


def _assign_validation(count: int) -> list[bool | None]:
    """Assign pictures in name order to training (False), validation (True) or neither (None).

    Validation is the last fifth. A gap of half its size before it is unused, because it shows the same walls.
    """
    judging = -(-count // VALIDATION_STRIDE)
    between = judging // 2
    return [False] * (count - judging - between) + [None] * between + [True] * judging


def render_training_views(
    blocks: Sequence[Path], *, seed: int
) -> tuple[list[TrainingRendering], list[TrainingRendering]]:
    """Render viewpoints of blocks and of procedural streets for training and validation."""
    begin_stage("renderings", RUNS_PER_BLOCK * len(blocks) + PROCEDURAL_STREETS)
    runs: list[list[TrainingRendering]] = []
    for number in range(PROCEDURAL_STREETS):
        runs.append(render_procedural_street(seed=100 * seed + number, furnished=number % 2 == 0))
        report_progress("renderings", 1)
    for path in blocks:
        for run in render_viewpoint_sequences(read_block(path), RUNS_PER_BLOCK, seed=seed):
            runs.append(run)
            report_progress("renderings", 1)
    learnt = [view for number, run in enumerate(runs) if number % VALIDATION_STRIDE for view in run]
    judged = [view for number, run in enumerate(runs) if number % VALIDATION_STRIDE == 0 for view in run]
    return learnt, judged


def render_procedural_street(*, seed: int, furnished: bool) -> list[TrainingRendering]:
    """Render a street of painted facades as relief."""
    import cv2

    street = synthetic_street(8, seed=seed, occluders=0, texels_per_metre=20.0)
    placement = street.scene.placement
    reliefs = {}
    for chart, painted in zip(street.charts, street.facades, strict=True):
        shape = (int(placement.width[chart]), int(placement.height[chart]))
        grey = render_facade_relief(painted.labels, painted.metres_per_pixel)
        reliefs[chart] = np.asarray(cv2.resize(grey, shape, interpolation=cv2.INTER_NEAREST), np.uint8)
    viewpoints = []
    for number, along in enumerate(np.arange(2.5, street.length, 5.0)):
        x, y = street.world_point(float(along), 0.0)
        viewpoints.append(Viewpoint(number, 0, np.array([x, y, 2.5]), street.axis))
    line = shapely.LineString([street.world_point(along, 0.0) for along in (0.0, street.length)])
    furniture = build_street_occluders(line, partial(_level_ground, 0.0), seed=seed) if furnished else None
    return render_sequence(street.scene, viewpoints, furniture=furniture, relief=reliefs)


def render_viewpoint_sequences(block: Block, count: int, *, seed: int) -> Iterator[list[TrainingRendering]]:
    """Render sequences of viewpoints along a block's streets, best visible walls first."""
    texture = replace(block.texture, texels_per_metre=TEXELS_PER_METRE, panorama_width=512)
    plan = make_plan(replace(block, texture=texture, panoramas=()))
    scene = plan.scene
    wall = scene.charts.kind == ChartKind.WALL
    rng = np.random.default_rng(seed)
    shown = np.bincount(plan.views[wall[plan.views[:, 1]], 0], minlength=len(plan.viewpoints))
    starts = []
    for street in range(len(plan.streets)):
        viewpoints = plan.street_viewpoints(street)
        for first in range(0, len(viewpoints) - VIEWPOINTS_PER_RUN + 1, VIEWPOINTS_PER_RUN):
            starts.append(
                (int(shown[[v.id for v in viewpoints[first : first + VIEWPOINTS_PER_RUN]]].min()), street, first)
            )
    # sampling the better half skips open places without preferring the narrowest streets
    better = sorted(starts, reverse=True)[: max(count, len(starts) // 2)]
    for number in rng.permutation(len(better))[:count].tolist():
        _, street, first = better[number]
        viewpoints = plan.street_viewpoints(street)[first : first + VIEWPOINTS_PER_RUN]
        height = float(viewpoints[0].position[2]) - texture.viewpoint_height
        line = plan.streets[street].line
        furniture = None
        if number % 2:
            furniture = build_street_occluders(
                _clip_to_viewpoints(line, viewpoints), partial(_level_ground, height), seed=number
            )
        yield render_sequence(scene, viewpoints, furniture=furniture)


def _level_ground(height: float, points: Float64Array) -> Float64Array:
    return np.full(len(points), height)


def _clip_to_viewpoints(line: shapely.LineString, viewpoints: Sequence[Viewpoint]) -> shapely.LineString:
    """Clip a line to 30 m around some viewpoints."""
    reach = shapely.union_all([shapely.Point(v.position[:2]).buffer(30) for v in viewpoints])
    part = line.intersection(reach)
    return max(getattr(part, "geoms", [part]), key=lambda piece: piece.length)


def _checkpoint_writer(out: Path) -> Callable[[int, float, UInt8Array], None]:
    """Return a callback that writes a picture of each checkpoint and its kernel distance."""

    def sample(step: int, distance: float, sheet: UInt8Array) -> None:
        from PIL import Image

        Image.fromarray(sheet).save(out / f"step-{step:06d}.png")
        with (out / "distances.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, "kernel_distance": round(distance, 4)}) + "\n")

    return sample
