"""Views of each step of a training run of the parser network, drawn by a loader's processes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from training.datasets.facades import LabelledFacade
from training.parser.views import (
    OccluderCutout,
    OccluderPainter,
    estimate_metres_per_pixel,
    extract_occluder_cutouts,
    occluder_loss_weights,
    sample_view,
)


class ViewBatch(NamedTuple):
    """Views of one part of a step, stacked; the fields of `TrainingView` and each pixel's weight in its occluder loss."""

    image: UInt8Array
    possible: UInt8Array
    occluder: UInt8Array
    occluder_weight: Float32Array
    outside: UInt8Array
    place: Float32Array


class StepViews:
    """Views of each step of a training run, as a map-style data set of torch.

    Parameters
    ----------
    sets : labelled photos by name of the set.
    per_step : photos of each set per step.
    steps : number of steps.
    seed : random seed.
    parts : parallel parts of a step.
    paint_occluders : painter of thin occluders before the views.
    """

    def __init__(
        self,
        sets: Mapping[str, Sequence[LabelledFacade]],
        per_step: Mapping[str, int],
        steps: int,
        seed: int,
        parts: int,
        paint_occluders: OccluderPainter | None,
    ) -> None:
        self._sets, self._seed, self._parts, self._paint = sets, seed, parts, paint_occluders
        self._names = [name for name, count in per_step.items() for _ in range(count)]
        self._steps = steps
        self._cutout_groups: Sequence[Sequence[OccluderCutout]] = [
            group for photos in sets.values() for group in extract_occluder_cutouts(photos)
        ]
        self._scales = {
            name: [estimate_metres_per_pixel(photo.possible) for photo in photos] for name, photos in sets.items()
        }

    def __len__(self) -> int:
        return self._steps

    def __getitem__(self, step: int) -> list[ViewBatch]:
        """Return the views of each part of a step: every so manieth of them."""
        batches = []
        for part in range(self._parts):
            views = []
            for number in range(part, len(self._names), self._parts):
                name, rng = self._names[number], np.random.default_rng([self._seed, step, number])
                index = int(rng.integers(len(self._sets[name])))
                scale = self._scales[name][index]
                views.append(sample_view(self._sets[name][index], self._cutout_groups, rng, scale, self._paint))
            batches.append(
                ViewBatch(
                    np.stack([view.image for view in views]),
                    np.stack([view.possible for view in views]),
                    np.stack([view.occluder for view in views]),
                    np.stack([occluder_loss_weights(view.occluder) for view in views]),
                    np.stack([view.outside for view in views]),
                    np.stack([view.place for view in views]),
                )
            )
        return batches
