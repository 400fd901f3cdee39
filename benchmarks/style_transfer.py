"""Whether a block shows the style of the city that was asked for: `python -m benchmarks.style_transfer --data DIR --out DIR`.

A cut of Delfshaven is run with `imagery.style` of every fourth picture of ECP (Paris), then of CMP (several cities), and
without imagery. Views at eye height are taken at the same places of all. The other pictures are seen as walls along a street,
and a logistic regression learns from two thirds of them to which set a square of wall belongs, by the features of
`image_features`. The pictures are reduced to the density of the block's textures. A view is classified by the mean over its
squares.

real_accuracy: share of the last third of pictures that are classified correctly. recall_first, recall_second: share of the
views in each style that are classified as it; balanced_accuracy: their mean. balanced_accuracy_centred: with the mean of all
views as the threshold, which cancels the difference between renderings and pictures. ordered: share of places where the view
of the first style is more like it than the view of the second is. default_as_first: share of the views without imagery, which
show bare walls, that are classified as the first city. Needs the `train` extra.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import yaml
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from benchmarks.city.runs import run
from benchmarks.look.outputs import Output, read_output
from benchmarks.look.views import EYE_M, FIELD_OF_VIEW, PITCH, SIZE, TURNED, View, render, street_cameras
from benchmarks.papers.translator.kernel_distance import image_features
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS
from training.datasets.facades import CMP, ECP, DatasetRecipe, LabelledFacade, read_dataset

CITIES: tuple[DatasetRecipe, DatasetRecipe] = (ECP, CMP)
# Cut of Delfshaven, degrees: west, south, east, north.
CUT = (4.45283, 51.90518, 4.45352, 51.90576)
# Every so many pictures are harvested; of the others every third is kept for `real_accuracy`; as many of each city are used.
HARVEST_STEP, REAL_STEP, MAX_REAL = 4, 3, 60
VIEWS, SEED = 60, 24
# Side of the squares of wall and distance between them, pixels; the smallest share of a square that shows walls, and the
# largest distance of its middle in metres.
SQUARE_PX, SQUARE_STEP_PX, MIN_WALL_SHARE, MAX_DISTANCE_M = 96, 48, 0.95, 25.0
# Density of the block's textures, and so of real pictures.
TEXELS_PER_METRE = 12.0
# Distances from a wall at which real pictures are seen, metres, and the views of each.
WALL_DISTANCES_M, VIEWS_A_PICTURE = (5.0, 10.0), 3


class StyleClassifier(NamedTuple):
    """Classifier of squares of wall, and the share of unseen pictures that it classifies correctly."""

    model: Pipeline
    real_accuracy: float

    def score(self, squares: np.ndarray) -> float:
        """Return the mean log-odds of the second city over squares (n, h, w, 3)."""
        return float(self.model.decision_function(image_features(list(squares))).mean())


def cut_squares(rgb: np.ndarray, is_wall: np.ndarray) -> np.ndarray:
    """Cut the squares (n, SQUARE_PX, SQUARE_PX, 3) of a view that show little but walls."""
    found = [
        rgb[part]
        for top in range(0, rgb.shape[0] - SQUARE_PX + 1, SQUARE_STEP_PX)
        for left in range(0, rgb.shape[1] - SQUARE_PX + 1, SQUARE_STEP_PX)
        if is_wall[part := np.s_[top : top + SQUARE_PX, left : left + SQUARE_PX]].mean() >= MIN_WALL_SHARE
    ]
    return np.array(found, np.uint8).reshape(-1, SQUARE_PX, SQUARE_PX, 3)


def cut_view(output: Output, view: View) -> np.ndarray:
    """Cut the squares of a view of a block."""
    is_wall = (view.chart != MISS) & (output.charts.kind[view.chart] == ChartKind.WALL)
    return cut_squares(view.rgb, is_wall & (view.distance < MAX_DISTANCE_M))


def see_along_street(facade: LabelledFacade, rng: np.random.Generator) -> np.ndarray:
    """See a real picture as a wall along a street, as views see walls, and cut its squares."""
    metres = exemplar_scale(facade.image, facade.labels)
    height, width = (side * metres for side in facade.labels.shape)
    distance, turn = rng.uniform(*WALL_DISTANCES_M), np.radians(rng.uniform(*TURNED)) * rng.choice([-1, 1])
    position = np.array([0.0, 0.0, EYE_M])
    # the wall is at y = distance, along x; the middle of the picture is where the camera looks
    ahead = np.array([np.cos(turn), abs(np.sin(turn)), PITCH]) * [np.sign(turn), 1, 1]
    camera = PerspectiveCamera(position, position + ahead, FIELD_OF_VIEW, SIZE)
    rays = camera.rays()
    points = rays * (distance / np.maximum(rays[..., 1], 1e-6))[..., None]
    left = distance / np.tan(turn) - width / 2
    x = (points[..., 0] - left) / metres
    y = (height - points[..., 2] - EYE_M) / metres
    is_wall = (x >= 0) & (x < facade.labels.shape[1]) & (y >= 0) & (y < facade.labels.shape[0])
    is_wall &= np.linalg.norm(points, axis=2) < MAX_DISTANCE_M
    # at the density of the block's texels, and reduced before it is sampled, where a pixel of a view shows several
    factor = min(1.0, metres * TEXELS_PER_METRE, metres * camera.axes()[3] / distance)
    image = cv2.resize(facade.image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    columns, rows = ((axis * factor).astype(np.float32) for axis in (x, y))
    seen = cv2.remap(image, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return cut_squares(np.asarray(seen, np.uint8), is_wall)


def read_real(recipe: DatasetRecipe, folder: Path, harvested: Sequence[Path]) -> list[LabelledFacade]:
    """Read the pictures of a city that are not harvested, MAX_REAL evenly chosen."""
    names = {path.stem for path in harvested}
    facades = [one for one in read_dataset(recipe, folder) if one.name not in names]
    chosen = np.unique(np.linspace(0, len(facades) - 1, MAX_REAL).astype(int))
    return [facades[number] for number in chosen.tolist()]


def train_classifier(cities: Sequence[Sequence[LabelledFacade]]) -> StyleClassifier:
    """Train on two thirds of the pictures of two cities, and count the rest."""
    rng = np.random.default_rng(SEED)
    features, truth, unseen = [], [], []
    for city, facades in enumerate(cities):
        for number, facade in enumerate(facades):
            seen = [see_along_street(facade, rng) for _ in range(VIEWS_A_PICTURE)]
            squares = np.concatenate(seen)
            if not len(squares):
                continue
            if number % REAL_STEP == 0:
                unseen.append((city, squares))
            else:
                features.append(image_features(list(squares)))
                truth += [city] * len(squares)
    model = make_pipeline(StandardScaler(), LogisticRegression(C=0.01, class_weight="balanced", max_iter=2000))
    classifier = StyleClassifier(model.fit(np.concatenate(features), truth), 0.0)
    correct = [(classifier.score(squares) > 0) == bool(city) for city, squares in unseen]
    return classifier._replace(real_accuracy=float(np.mean(correct)))


def write_block(folder: Path, data: Path, pictures: Sequence[Path]) -> Path:
    """Write the block file of a cut with copies of pictures to harvest, or without: the material field paints it."""
    folder.mkdir(parents=True, exist_ok=True)
    text = (EXAMPLE_BLOCKS_FOLDER / "delfshaven.yaml").read_text(encoding="utf-8")
    stated = yaml.safe_load(text.replace("${STREETLOOM_DATA}", str(data))) | {"area": list(CUT)}
    stated["texture"] = {"texels_per_metre": TEXELS_PER_METRE}
    del stated["imagery"]
    if pictures:
        style = folder / "pictures"
        style.mkdir(exist_ok=True)
        for path in pictures:
            (style / path.name).write_bytes(path.read_bytes())
        stated["imagery"] = {"style": {"path": str(style)}}
    else:
        stated["texture"] |= {"walls": "translate"}
    file = folder / "block.yaml"
    file.write_text(yaml.safe_dump(stated), encoding="utf-8")
    return file


def run_block(folder: Path, data: Path, pictures: Sequence[Path]) -> Output:
    """Run the cut in the style of pictures, or without."""
    run(write_block(folder, data, pictures), folder / "out", 1)
    return read_output(folder / "out")


def score_views(outputs: Sequence[Output], classifier: StyleClassifier) -> np.ndarray:
    """Return the log-odds (places, outputs) of the views at the same places that show squares of wall in all outputs."""
    places = street_cameras(outputs, VIEWS, SEED)
    scores = np.full((len(places), len(outputs)), np.nan)
    for number, output in enumerate(outputs):
        for place, view in enumerate(render(output, [cameras[number] for cameras in places])):
            squares = cut_view(output, view)
            if len(squares):
                scores[place, number] = classifier.score(squares)
    return scores[np.isfinite(scores).all(axis=1)]


def summarise_scores(scores: np.ndarray) -> dict[str, float | int]:
    """Summarise log-odds (places, 3): in the style of the first city, of the second, and without imagery."""
    first, second, default = scores.T
    middle = np.mean([first, second])
    recalls = float((first < 0).mean()), float((second > 0).mean())
    shares = {
        "recall_first": recalls[0],
        "recall_second": recalls[1],
        "balanced_accuracy": float(np.mean(recalls)),
        "balanced_accuracy_centred": float(np.mean([first < middle, second > middle])),
        "ordered": float((first < second).mean()),
        "default_as_first": float((default < 0).mean()),
        "default_as_first_centred": float((default < middle).mean()),
    }
    return {"views": len(scores)} | {name: round(share, 3) for name, share in shares.items()}


def main(arguments: list[str] | None = None) -> None:
    """Run the three blocks and print the shares as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with city/delfshaven, facades/ecp and cmp")
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs; a second call goes on there")
    options = parser.parse_args(arguments)
    data = options.data.resolve()
    names = [recipe.name for recipe in CITIES]
    folders = [data / "facades" / name for name in names]
    pictures = [
        sorted((folder / "images").iterdir())[::HARVEST_STEP] for folder, recipe in zip(folders, CITIES, strict=True)
    ]
    outputs = [
        run_block(options.out.resolve() / name, data, of_city) for name, of_city in zip(names, pictures, strict=True)
    ]
    outputs.append(run_block(options.out.resolve() / "default", data, ()))
    real = [read_real(*city) for city in zip(CITIES, folders, pictures, strict=True)]
    classifier = train_classifier(real)
    result: dict[str, object] = {"benchmark": "style_transfer", "first": names[0], "second": names[1]}
    result["real_accuracy"] = round(classifier.real_accuracy, 3)
    print(json.dumps(result | summarise_scores(score_views(outputs, classifier)), indent=1))


if __name__ == "__main__":
    main()
