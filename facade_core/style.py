"""Which exemplar a building without imagery takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# How much chance may outweigh fit: neighbours of one size should not all take the same exemplar.
VARIETY = 0.8
# What was made anew of an exemplar beyond this share counts so many times: one of which half was is taken where no other fits.
OFTEN_HIDDEN, GUESSED = 0.15, 4.0
# And so does what lies in the shadow of something else: it would be on walls that stand in the sun.
SHADED = 0.18


def choose_exemplars(
    width: np.ndarray,
    floors: np.ndarray,
    building: np.ndarray,
    exemplar_width: Sequence[float],
    exemplar_floors: Sequence[float],
    exemplar_hidden: Sequence[float],
    exemplar_shaded: Sequence[float],
    *,
    seed: int,
) -> np.ndarray:
    """Index of the exemplar for each facade, (n,) int64; the facades of one building share theirs.

    width (n,) metres, floors (n,), building (n,) of the facades; of the exemplars width, floors, the share of them that was
    hidden and made anew, and that of their wall in shadow. The fit is of the building's widest facade: log ratios of floors and
    width, and these shares; chance, by (seed, building), chooses among those that fit.
    """
    chosen = np.zeros(len(width), np.int64)
    for one in np.unique(building):
        facades = np.flatnonzero(building == one)
        main = facades[np.argmax(width[facades])]
        misfit = np.abs(np.log(floors[main] / np.asarray(exemplar_floors, float)))
        misfit += 0.5 * np.abs(np.log(width[main] / np.asarray(exemplar_width, float)))
        misfit += GUESSED * np.maximum(0, np.asarray(exemplar_hidden, float) - OFTEN_HIDDEN)
        misfit += GUESSED * np.maximum(0, np.asarray(exemplar_shaded, float) - SHADED)
        chance = np.random.default_rng([seed, int(one)]).random(len(misfit))
        chosen[facades] = int(np.argmin(misfit + VARIETY * chance))
    return chosen
