"""The paper's tables 1 and 2: every network is trained with the same budget, and walks the test block."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.papers.translator.colour_grid import NETWORK_HEIGHT
from benchmarks.papers.translator.neural_translator import ColourNetwork, NeuralTranslator
from benchmarks.papers.translator.scenes import BLENDINGS, Blending, Translate, between, ingolstadt, walk
from benchmarks.papers.translator.steps import TrainingRecipe, stack_inputs, tensor_to_image
from benchmarks.street.truth import interval
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.lighting.sky import add_sky
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.render import RenderedPanorama, render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from benchmarks.papers.translator.translators import MaterialFieldTranslator, Translator

# Budget of each row.
BUDGET = TrainingRecipe(width=16, steps=300, batch=2, check=300)
ROWS = {
    "CUT": replace(BUDGET, conditioned=False),
    "PUT 1": replace(BUDGET, masked=False, equirectangular=False, merged=False),
    "PUT 2": replace(BUDGET, masked=False, equirectangular=False),
    "PUT 3": replace(BUDGET, masked=False),
    "PUT 4": replace(BUDGET, equirectangular=False),
    "full": BUDGET,
}
# Where the rows of a panorama begin that show facades, as a share of its height: no road and little sky.
FACADES_FROM = 0.28
# Where those begin that show the ground.
GROUND_FROM = 0.63
PLACES = ("toulouse", "strasbourg_stra_1")
# Folders of the pictures that rows and the pretrained network learn from, without PLACES.
STYLE = ("panoramas", "city/amsterdam/panoramas", "streetphotos/swiss/train")
# Held out; country roads; other cuts of photos in the Swiss test set.
EXCLUDED = ("toulouse", "outskirts", "IMG_0772", "IMG_5873", "IMG_6008")
SIDE = 128


def measure(data: Path, models: Path, pretrained: ColourNetwork) -> dict[str, Any]:
    """Kernel distances of every row and blending, means over streets with 95 % bootstrap intervals, and which of the paper's
    orderings hold: only those whose paired differences' intervals exclude zero."""
    scene, own, streets = ingolstadt(data)
    real, painter = _real(data), MaterialFieldTranslator(scene, MaterialField(scene, streets, seed=7))
    by_row: dict[str, dict[str, Any]] = {}

    def score(name: str, translate: Translate, blending: Blending) -> None:
        by_row[f"{name}, {blending}"] = _scores(scene, own, translate, blending, real)

    for blending in BLENDINGS:
        for name in ("CUT", "full"):
            score(name, network(_file(models, name), ROWS[name], painter), blending)
    for name in ("PUT 1", "PUT 2", "PUT 3", "PUT 4"):
        score(name, network(_file(models, name), ROWS[name], painter), "weighted")
    by_row |= _untrained(scene, own, painter, pretrained, real)
    table = _table(by_row)
    return {
        "budget": {"steps": BUDGET.steps, "width": BUDGET.width, "batch": BUDGET.batch},
        "real": PLACES,
        "streets": len(own),
        "crops": int(8 * sum(len(between(views)) for views in own)),
        "rows": table,
        "orderings": {kind: _orderings(by_row, kind) for kind in ("full", "crop")},
    }


def pretrained_alone(data: Path, pretrained: ColourNetwork) -> dict[str, Any]:
    """The rows of the pretrained network, of the material field and without texture."""
    scene, own, streets = ingolstadt(data)
    painter = MaterialFieldTranslator(scene, MaterialField(scene, streets, seed=7))
    return {
        "real": PLACES,
        "streets": len(own),
        "rows": _table(_untrained(scene, own, painter, pretrained, _real(data))),
    }


def _untrained(
    scene: Scene,
    own: list[list[Viewpoint]],
    painter: MaterialFieldTranslator,
    pretrained: ColourNetwork,
    real: dict[str, np.ndarray],
) -> dict[str, dict[str, Any]]:
    translators: dict[str, Translate] = {
        "material field": lambda panorama, _: painter.translate(panorama),
        "pretrained network": lambda panorama, _: NeuralTranslator(pretrained, painter).translate(panorama),
        "untextured": lambda _, bare: bare.rgb,
    }
    return {
        f"{name}, weighted": _scores(scene, own, translate, "weighted", real) for name, translate in translators.items()
    }


def _table(by_row: dict[str, dict[str, Any]]) -> dict[str, Any]:
    return {
        name: {kind: interval(values) for kind, values in scores.items() if kind != "difference"}
        | {"difference_between_consecutive": interval(scores["difference"])}
        for name, scores in by_row.items()
    }


def network(path: Path, recipe: TrainingRecipe, painter: Translator) -> Translate:
    """A row's network as a translator."""
    import torch

    from benchmarks.papers.translator.network import Generator, apply_grid, image_to_tensor

    generator = Generator(recipe.width, bands=recipe.bands, equirectangular=recipe.equirectangular)
    generator.load_state_dict(torch.load(path, weights_only=True))
    generator.eval()

    def translate(panorama: RenderedPanorama, bare: RenderedPanorama) -> np.ndarray:
        plain = image_to_tensor(add_sky(painter.translate(bare), bare.depth))
        partial = image_to_tensor(add_sky(painter.translate(panorama), panorama.depth))
        known = torch.from_numpy(panorama.textured | np.isinf(panorama.depth))[None, None]
        if not recipe.conditioned:
            partial, known = plain, torch.zeros_like(known)
        with torch.no_grad():
            inputs = torch.nn.functional.interpolate(
                stack_inputs(partial, plain, known, recipe), (NETWORK_HEIGHT, 2 * NETWORK_HEIGHT), mode="area"
            )
            entry = generator.gather_inputs(inputs, [(0, NETWORK_HEIGHT)])
            grid = generator.decode(generator.run_blocks(entry, True, []), True)
            rgb = tensor_to_image(apply_grid(grid, partial)[0])
        if recipe.conditioned:
            kept = known[0, 0].numpy()
            rgb[kept] = tensor_to_image(partial[0])[kept]
        rgb[panorama.chart < 0] = 0
        return rgb

    return translate


def _scores(
    scene: Scene, own: list[list[Viewpoint]], translate: Translate, blending: Blending, real: dict[str, np.ndarray]
) -> dict[str, list[float]]:
    """Per street: kernel distances of crops of its views to real ones, and the difference of consecutive outputs."""
    from benchmarks.papers.translator.kernel_distance import image_features, kernel_distance

    found: dict[str, list[float]] = {"full": [], "crop": [], "ground": [], "difference": []}
    for views in own:
        walked = walk(scene, views, translate, blending)
        pictures = [_look(scene, walked.window, viewpoint) for viewpoint in between(views)]
        for kind, cut in KINDS.items():
            crops = [crop for picture in pictures for crop in cut(picture)]
            found[kind].append(kernel_distance(image_features(crops), real[kind]))
        found["difference"].append(walked.difference)
    return found


def _look(scene: Scene, window: TexelBuffer, viewpoint: Viewpoint) -> np.ndarray:
    return render_panorama(scene, window, viewpoint, (512, 1024)).rgb


def full_crops(panorama: np.ndarray) -> list[np.ndarray]:
    """Eight crops of all but zenith and nadir of a panorama (512, 1024, 3), at half its size."""
    import cv2

    small = cv2.resize(panorama, (512, 256), interpolation=cv2.INTER_AREA)
    return [small[top : top + SIDE, left : left + SIDE] for top in (26, 97) for left in range(0, 512, SIDE)]


def facade_crops(panorama: np.ndarray) -> list[np.ndarray]:
    """Eight crops of the rows of a panorama (512, 1024, 3) that show facades."""
    top = round(FACADES_FROM * len(panorama))
    return [panorama[top : top + SIDE, left : left + SIDE] for left in range(0, 1024, SIDE)]


def ground_crops(panorama: np.ndarray) -> list[np.ndarray]:
    """Eight crops of the rows of a panorama (512, 1024, 3) that show the ground from 1 to 6 m off."""
    top = round(GROUND_FROM * len(panorama))
    return [panorama[top : top + SIDE, left : left + SIDE] for left in range(0, 1024, SIDE)]


KINDS: dict[str, Callable[[np.ndarray], list[np.ndarray]]] = {
    "full": full_crops,
    "crop": facade_crops,
    "ground": ground_crops,
}


def _real(data: Path) -> dict[str, np.ndarray]:
    """Features of crops of the panoramas that no network has learnt from, turned ten ways each."""
    from benchmarks.papers.translator.kernel_distance import image_features
    from benchmarks.papers.translator.train import PictureSplitPrefixes, list_pictures, read_picture_sets

    held_out = read_picture_sets(list_pictures([data / "panoramas"]), PictureSplitPrefixes(PLACES))[1]
    turned = [np.roll(image, shift, axis=1) for image in (one.image for one in held_out) for shift in range(0, 128, 13)]
    return {kind: image_features([crop for image in turned for crop in cut(image)]) for kind, cut in KINDS.items()}


def _orderings(by_row: dict[str, dict[str, Any]], kind: str) -> dict[str, str]:
    """The paper's orderings: holds, does not hold (the contrary does), or undecided."""
    claims = [(f"{name}, weighted", f"{name}, no blend") for name in ("CUT", "full")]
    claims += [(f"{name}, no blend", f"{name}, average") for name in ("CUT", "full")]
    claims += [(f"{name}, weighted", f"{name}, two frames") for name in ("CUT", "full")]
    claims += [(f"full, {blending}", f"CUT, {blending}") for blending in BLENDINGS]
    order = ["full", "PUT 4", "PUT 3", "PUT 2", "PUT 1"]
    claims += [(f"{a}, weighted", f"{b}, weighted") for a, b in zip(order[:-1], order[1:], strict=True)]
    return _verdicts(by_row, kind, claims)


def _verdicts(by_row: dict[str, dict[str, Any]], kind: str, claims: list[tuple[str, str]]) -> dict[str, str]:
    """Of each claim that one row is nearer than another: whether the interval of their paired differences says so."""
    verdicts = {}
    for better, worse in claims:
        gain = interval(list(np.subtract(by_row[worse][kind], by_row[better][kind])))
        verdict = "holds" if gain["low"] > 0 else "does not hold" if gain["high"] < 0 else "undecided"
        verdicts[f"{better} < {worse}"] = f"{verdict} ({gain['mean']} [{gain['low']}, {gain['high']}])"
    return verdicts


def train_rows(
    data: Path, models: Path, rows: Mapping[str, TrainingRecipe], *, runs: Sequence[Path], seed: int = 0
) -> dict[str, float]:
    """Train the rows that `models` does not hold yet; seconds a step of each."""
    import time

    import torch

    from benchmarks.papers.translator import network_training as training
    from benchmarks.papers.translator import steps as training_steps
    from benchmarks.papers.translator.street_renderings import render_training_views
    from benchmarks.papers.translator.train import PictureSplitPrefixes, list_pictures, read_picture_sets

    missing = [name for name in rows if not _file(models, name).is_file()]
    if not missing:
        return {}
    learnt, judged, _ = read_picture_sets(
        list_pictures([data / folder for folder in STYLE]), PictureSplitPrefixes(("strasbourg_stra_1",), EXCLUDED)
    )
    rendered, rendered_judged = render_training_views(runs, seed=seed)
    domains = training_steps.TrainingDomains(rendered, learnt, rendered_judged, judged)
    seconds = {}
    for name in missing:
        begun = time.perf_counter()
        trained = training.train_generator(domains, rows[name], seed=seed)
        seconds[name] = round((time.perf_counter() - begun) / rows[name].steps, 2)
        models.mkdir(parents=True, exist_ok=True)
        torch.save(dict(trained.weights), _file(models, name))
    return seconds


def _file(models: Path, name: str) -> Path:
    return models / f"{name.replace(' ', '_')}.pt"
