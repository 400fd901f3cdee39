"""The paper's tables 1 and 2: every network is trained with the same budget, and walks the test block."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.street.truth import interval
from benchmarks.translator.scenes import BLENDINGS, Blending, Translate, between, ingolstadt, walk
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.render import RenderedPanorama, render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.translator.training_steps import TrainingRecipe, stack_texture_and_grey, tensor_to_image
from facade_core.street.translator.translators import MaterialFieldTranslator

# Budget of each row.
BUDGET = TrainingRecipe(width=16, steps=300, warm=120, crop=(64, 128), batch=1, check=300)
ROWS = {
    "CUT": replace(BUDGET, conditioned=False),
    "PUT 1": replace(BUDGET, masked=False, equirectangular=False, merged=False),
    "PUT 2": replace(BUDGET, masked=False, equirectangular=False),
    "PUT 3": replace(BUDGET, masked=False),
    "PUT 4": replace(BUDGET, equirectangular=False),
    "full": BUDGET,
}
# Of the paper's method alone, of the shipped recipe, and of that with composite streets: longer, as every other step is theirs.
LONGER = replace(BUDGET, steps=900, check=900)
COMPOSITES = {
    "CUT, longer": replace(LONGER, conditioned=False),
    "full, longer": LONGER,
    "full and composites": LONGER,
}
# Where the rows of a panorama begin that show facades, as a share of its height: no road and little sky.
FACADES_FROM = 0.28
# Where those begin that show the ground.
GROUND_FROM = 0.63
PLACES = ("toulouse", "strasbourg_stra_1")
SIDE = 128


def measure(data: Path, models: Path, shipped: Translate) -> dict[str, Any]:
    """Kernel distances of every row and blending, means over streets with 95 % bootstrap intervals, and which of the paper's
    orderings hold: only those whose paired differences' intervals exclude zero."""
    scene, own, streets = ingolstadt(data)
    real = _real(data)
    by_row: dict[str, dict[str, Any]] = {}

    def score(name: str, translate: Translate, blending: Blending) -> None:
        by_row[f"{name}, {blending}"] = _scores(scene, own, translate, blending, real)

    for blending in BLENDINGS:
        for name in ("CUT", "full"):
            score(name, network(_file(models, name), ROWS[name]), blending)
    for name in ("PUT 1", "PUT 2", "PUT 3", "PUT 4"):
        score(name, network(_file(models, name), ROWS[name]), "weighted")
    by_row |= _untrained(scene, own, streets, shipped, real)
    table = _table(by_row)
    return {
        "budget": {"steps": BUDGET.steps, "of_them_warm": BUDGET.warm, "width": BUDGET.width, "crop": BUDGET.crop},
        "real": PLACES,
        "streets": len(own),
        "crops": int(8 * sum(len(between(views)) for views in own)),
        "rows": table,
        "orderings": {kind: _orderings(by_row, kind) for kind in ("full", "crop")},
    }


def composites(data: Path, models: Path, shipped: Translate) -> dict[str, Any]:
    """What composite streets bring: three rows of one budget beside those of what is shipped, and which is nearer."""
    scene, own, streets = ingolstadt(data)
    real = _real(data)
    by_row = {
        f"{name}, weighted": _scores(scene, own, network(_file(models, name), course), "weighted", real)
        for name, course in COMPOSITES.items()
    }
    by_row |= _untrained(scene, own, streets, shipped, real)
    others = [name for name in by_row if not name.startswith("full and")]
    claims = [("full and composites, weighted", other) for other in others]
    return {
        "budget": {"steps": LONGER.steps, "of_them_warm": LONGER.warm, "width": LONGER.width, "crop": LONGER.crop},
        "real": PLACES,
        "streets": len(own),
        "rows": _table(by_row),
        "orderings": {kind: _verdicts(by_row, kind, claims) for kind in ("full", "crop", "ground")},
    }


def shipped_alone(data: Path, shipped: Translate) -> dict[str, Any]:
    """The rows of what is shipped: the network, swatches and no texture."""
    scene, own, streets = ingolstadt(data)
    return {"real": PLACES, "streets": len(own), "rows": _table(_untrained(scene, own, streets, shipped, _real(data)))}


def _untrained(
    scene: Scene,
    own: list[list[Viewpoint]],
    streets: Any,
    shipped: Translate,
    real: dict[str, np.ndarray],
) -> dict[str, dict[str, Any]]:
    swatches = MaterialFieldTranslator(scene, streets, seed=7)
    translators: dict[str, Translate] = {
        "exemplar (swatches)": lambda panorama, _: swatches.translate(panorama),
        "shipped network": shipped,
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


def network(path: Path, course: TrainingRecipe) -> Translate:
    """A row's network as a translator."""
    import torch

    from facade_core.street.translator.network import Generator, image_to_tensor

    generator = Generator(course.width, bands=course.bands, equirectangular=course.equirectangular)
    generator.load_state_dict(torch.load(path, weights_only=True))
    generator.eval()

    def translate(panorama: RenderedPanorama, bare: RenderedPanorama) -> np.ndarray:
        grey, partial = image_to_tensor(bare.rgb), image_to_tensor(panorama.rgb if course.conditioned else bare.rgb)
        known = torch.from_numpy(panorama.textured & course.conditioned)[None, None]
        given = stack_texture_and_grey(partial, grey, known, course)
        with torch.no_grad():
            entry = generator.gather_inputs(given, [(0, len(bare.rgb))])
            rgb = tensor_to_image(generator.decode(generator.run_blocks(entry, True, []), True)[0])
        rgb[panorama.chart < 0] = 0
        return rgb

    return translate


def _scores(
    scene: Scene, own: list[list[Viewpoint]], translate: Translate, blending: Blending, real: dict[str, np.ndarray]
) -> dict[str, list[float]]:
    """Per street: kernel distances of crops of its views to real ones, and the difference of consecutive outputs."""
    from facade_core.street.translator.kernel_distance import image_features, kernel_distance

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
    from facade_core.street.translator.kernel_distance import image_features
    from tasks.training.translator import PanoramaSplitPrefixes, list_pictures, read_panorama_sets

    held_out = read_panorama_sets(list_pictures([data / "panoramas"]), PanoramaSplitPrefixes(PLACES))[1]
    turned = [np.roll(image, shift, axis=1) for image in held_out for shift in range(0, 128, 13)]
    return {kind: image_features([crop for image in turned for crop in cut(image)]) for kind, cut in KINDS.items()}


def _orderings(by_row: dict[str, dict[str, Any]], kind: str) -> dict[str, str]:
    """The paper's orderings: holds, does not hold (the contrary does), or undecided."""
    claims = [(f"{name}, weighted", f"{name}, no blend") for name in ("CUT", "full")]
    claims += [(f"{name}, no blend", f"{name}, average") for name in ("CUT", "full")]
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


def train_rows(data: Path, models: Path, rows: Mapping[str, TrainingRecipe], *, seed: int = 0) -> dict[str, float]:
    """Train the rows that `models` does not hold yet; seconds a step of each."""
    import time

    import torch

    import tasks.training.composites
    from facade_core.street.translator import training, training_steps
    from tasks.training.translator import (
        PanoramaSplitPrefixes,
        list_pictures,
        read_panorama_sets,
        render_training_views,
    )

    missing = [name for name in rows if not _file(models, name).is_file()]
    if not missing:
        return {}
    blocks = Path(__file__).parents[2] / "catalogs" / "examples" / "blocks"
    os.environ["STREETLOOM_DATA"] = str(data)  # which the blocks' files name
    folders = [data / "panoramas", data / "city" / "amsterdam" / "panoramas"]
    learnt, judged, _ = read_panorama_sets(
        list_pictures(folders), PanoramaSplitPrefixes(("strasbourg_stra_1",), ("toulouse",))
    )
    rendered, rendered_judged = render_training_views([blocks / "helsinki.yaml", blocks / "delfshaven.yaml"], seed=seed)
    domains = training_steps.TrainingDomains(rendered, learnt, rendered_judged, judged)
    seconds = {}
    for name in missing:
        paired = tasks.training.composites.render_composites(data, seed=seed) if name == "full and composites" else []
        begun = time.perf_counter()
        trained = training.train_generator(replace(domains, paired=paired), rows[name], seed=seed)
        seconds[name] = round((time.perf_counter() - begun) / rows[name].steps, 2)
        models.mkdir(parents=True, exist_ok=True)
        torch.save(dict(trained.weights), _file(models, name))
    return seconds


def _file(models: Path, name: str) -> Path:
    return models / f"{name.replace(' ', '_')}.pt"
