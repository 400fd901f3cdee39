"""Training of the shipped parser, and of the benchmark's folds, from a data folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from facade_core.core.errors import InputError
from facade_core.core.model_file import read_model_record
from facade_core.parsing import network
from facade_core.parsing.segmenter import parse
from tasks.publish.catalogue_facts import FACADE_MODELS
from training.datasets.corrected_facades import MIN_FACADES, CorrectedFacade, label_corrected_facade
from training.datasets.facades import (
    ANY_CLASS,
    ARTDECO,
    CMP,
    ECP,
    RUEMONGE,
    LabelledFacade,
    read_dataset,
    read_swiss_street_photos,
    split_facades_for_training,
)
from training.datasets.occluder_boxes import read_occluder_boxes
from training.model_files import extend_model_record
from training.parser import network_export, network_training
from training.parser.calibration import compare_parse_with_truth, fit_calibration
from training.parser.network_training import TrainingSchedule
from training.parser.sets import paint_labelled_facades, paint_random_occluders, relabel_occluders
from training.progress import track_progress

Sets = dict[str, list[LabelledFacade]]

SHIPPED_SCHEDULE = TrainingSchedule(steps=4791, per_step={"ecp": 9, "cmp": 10, "swiss": 5})
# Painted facades of the training set.
PAINTED_COUNT = 40
# Their seed, distinct from the seed of benchmarks.
PAINTED_SEED = 20_000
# Sets whose licence forbids shipped weights: fine-tuned networks for their own benchmark only.
FOLD_SCHEDULES = {
    "artdeco": TrainingSchedule(steps=500, per_step={"artdeco": 6}, rate=1e-3),
    "ruemonge2014": TrainingSchedule(steps=500, per_step={"ruemonge2014": 6}, rate=1e-3),
}
# Fine-tuning of the shipped network, whose normalisation is folded into its weights.
CORRECTED_SCHEDULE = TrainingSchedule(steps=200, per_step={"corrected": 4}, rate=1e-3, freeze_norms=True)


def train_shipped_parser(data: Path, out: Path, *, seed: int, schedule: TrainingSchedule = SHIPPED_SCHEDULE) -> Path:
    """Train the shipped network, and write network.onnx and network.json into `out`.

    The training set is facades/ecp, facades/cmp, streetphotos/swiss/train and painted facades, without held-out folds and
    the calibration photos. An interrupted run resumes from network.state.

    Parameters
    ----------
    data : data folder.
    out : target folder.
    seed : random seed.
    schedule : training schedule.
    """
    looked = read_occluder_boxes()
    cmp, apart = split_cmp_photos(data)
    sets: Sets = {
        "ecp": relabel_occluders(
            "ecp", split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))[0], looked
        ),
        "cmp": relabel_occluders("cmp", cmp, looked),
        "swiss": list(read_swiss_street_photos(data / "streetphotos" / "swiss" / "train")),
        "painted": paint_labelled_facades(PAINTED_COUNT, seed=PAINTED_SEED),
    }
    # Painted facades are sampled like photos of cmp; they teach that a clean wall is no occluder.
    taught = {"ecp": sets["ecp"], "cmp": [*sets["cmp"], *sets["painted"]], "swiss": sets["swiss"]}
    weights = network_training.train_parser_network(
        taught,
        schedule,
        seed=seed,
        state=out / "network.state",
        paint_occluders=paint_random_occluders,
    )
    path = out / "network.onnx"
    network_export.save_network(weights, path, training_set=_photo_names(sets), seed=seed)
    calibrate_parser_confidence(path, apart)
    return path


def calibrate_parser_confidence(model: Path, photos: Sequence[LabelledFacade]) -> None:
    """Calibrate a network's confidence on photos, and write the result into its record."""
    observed = [
        compare_parse_with_truth(parse(photo.image, model=model), photo.labels, photo.possible)
        for photo in track_progress("certainty", photos, len(photos))
    ]
    extend_model_record(model, certainty=fit_calibration(observed))


def split_cmp_photos(data: Path) -> tuple[list[LabelledFacade], list[LabelledFacade]]:
    """Split facades/cmp without its held-out fold into training photos and an eighth for calibration."""
    return split_facades_for_training(
        split_facades_for_training(list(read_dataset(CMP, data / "facades" / "cmp")))[0], every=8
    )


def fine_tune_benchmark_parser(data: Path, out: Path, name: str, *, seed: int) -> Path:
    """Fine-tune the network in `out` on one benchmark set; write NAME.onnx and NAME.json.

    The result serves only the benchmark of that set.

    Parameters
    ----------
    data : data folder.
    out : folder of the finished network, and target folder.
    name : name of the set.
    seed : random seed.

    Raises
    ------
    ModelError : `out` has no finished network.
    """
    facades = {
        "artdeco": lambda: split_facades_for_training(list(read_dataset(ARTDECO, data / "facades" / "artdeco")))[0],
        "ruemonge2014": lambda: list(read_dataset(RUEMONGE, data / "facades" / "ruemonge2014" / "train")),
    }[name]()
    start = network_training.read_finished_weights(out / "network.state")
    state = out / f"{name}.state"
    weights = network_training.train_parser_network(
        {name: facades},
        FOLD_SCHEDULES[name],
        seed=seed,
        state=state,
        start=start,
    )
    path = out / f"{name}.onnx"
    seen = [*read_model_record(out / "network.onnx")["training_set"], *_photo_names({name: facades})]
    network_export.save_network(weights, path, training_set=seen, seed=seed)
    return path


def fine_tune_on_corrections(
    facades: Sequence[CorrectedFacade], out: Path, *, seed: int, schedule: TrainingSchedule = CORRECTED_SCHEDULE
) -> Path:
    """Fine-tune the shipped network on corrected facades; write network.onnx and .json.

    Every fifth facade is held out for validation. Calibration is copied from the shipped network.

    Parameters
    ----------
    facades : corrected facades.
    out : target folder.
    seed : random seed.
    schedule : training schedule.

    Raises
    ------
    InputError : fewer than MIN_FACADES are usable, or the result does not beat the shipped network; no file is left.
    """
    labelled = map(label_corrected_facade, track_progress("corrections", facades, len(facades)))
    usable = [photo for photo in labelled if photo is not None]
    if len(usable) < MIN_FACADES:
        raise InputError(
            f"pictures show {len(usable)} of {len(facades)} corrected facades; the parser needs {MIN_FACADES}"
        )
    learnt, held_out = split_facades_for_training(usable)
    sets: Sets = {"corrected": learnt}
    weights = network_training.train_parser_network(
        sets,
        schedule,
        seed=seed,
        state=out / "network.state",
        start=network_export.read_weights(network.SHIPPED_NETWORK),
    )
    shipped = read_model_record(network.SHIPPED_NETWORK)
    path = out / "network.onnx"
    network_export.save_network(weights, path, training_set=[*shipped["training_set"], *_photo_names(sets)], seed=seed)
    trained_on = {**FACADE_MODELS[0].trained_on, "facades that people corrected": "that of their pictures"}
    extend_model_record(path, certainty=shipped["certainty"], trained_on=trained_on)
    before, after = (parser_pixel_accuracy(held_out, model) for model in (network.SHIPPED_NETWORK, path))
    figures = (
        f"of {len(held_out)} corrected facades that it did not learn from, {after:.1%} of what was said is right, and "
        f"{before:.1%} by the shipped one"
    )
    if after <= before:
        path.unlink()
        path.with_suffix(".json").unlink()
        raise InputError(f"{figures}: nothing is kept; correct more facades, and in one style")
    path.with_suffix(".md").write_text(_model_card(learnt, schedule, seed, figures), encoding="utf-8")
    return path


def parser_pixel_accuracy(photos: Sequence[LabelledFacade], model: Path) -> float:
    """Compute the share of labelled pixels that a network parses correctly."""
    right = told = 0
    for photo in photos:
        known = photo.possible != ANY_CLASS
        parsed = 1 << parse(photo.image, model=model).labels[known]
        right, told = right + int((photo.possible[known] & parsed != 0).sum()), told + int(known.sum())
    return right / max(told, 1)


def _model_card(photos: Sequence[LabelledFacade], schedule: TrainingSchedule, seed: int, figures: str) -> str:
    runs = Counter(photo.name.partition("/")[0] for photo in photos)
    rows = "\n".join(f"| {run} | {count} |" for run, count in sorted(runs.items()))
    return _CARD.format(
        steps=schedule.steps, views=schedule.per_step["corrected"], seed=seed, told=rows, figures=figures
    )


_CARD = """# Model card: network.onnx, a facade parser that learnt from corrections

The shipped parser (`facade_core/parsing/models/network.md`), which went on for {steps} steps of {views}
views with facades whose elements people corrected; seed {seed}. Its licence is what those of the pictures and of the
shipped parser's sets allow together. How sure it may be was measured of the shipped one; {figures}.

| run | facades |
|---|---|
{told}
"""


def _photo_names(sets: Sets) -> list[str]:
    return [f"{name}/{photo.name}" for name, photos in sets.items() for photo in photos]
