"""Sample variations: assign elements to places of the same type."""

from __future__ import annotations

from math import factorial, gcd

import numpy as np

from facade_core.core.arrays import Int32Array, Int64Array, IntArray
from facade_core.core.errors import InputError

# Fewer permutations than this are numbered, so that seeds cannot coincide.
_MAX_NUMBERED = 10**12


def make_generator(seed: int) -> np.random.Generator:
    """Check the seed of a sample and return its random generator.

    Raises
    ------
    InputError
        For a seed that is negative or no whole number.
    """
    if seed < 0 or seed != int(seed):
        raise InputError(f"seed {seed}: samples are numbered from 0; pass a whole number that is not negative")
    return np.random.default_rng(int(seed))


def permute_within_types(types: IntArray, seed: int) -> Int64Array:
    """Permute elements within their types.

    If there are few permutations, consecutive seeds give different ones until all were given. Raises InputError as
    `make_generator`.

    Parameters
    ----------
    types : (N,) types.
    seed : number of the permutation, from 0.

    Returns
    -------
    (N,) int element shown at each place.
    """
    rng = make_generator(seed)
    members = [np.flatnonzero(types == t) for t in np.unique(types)]
    shown = np.arange(len(types))
    total = 1
    for of_type in members:
        total = min(total * factorial(len(of_type)), _MAX_NUMBERED)
    if total >= _MAX_NUMBERED:
        for of_type in members:
            shown[of_type] = rng.permutation(of_type)
        return shown
    step = next(s for s in range(int(0.618 * total) + 1, 2 * total + 2) if gcd(s, total) == 1)
    number = (1 + seed) * step % total
    for of_type in members:
        left = of_type.tolist()
        for place in of_type:
            number, k = divmod(number, len(left))
            shown[place] = left.pop(k)
    return shown


def assign_elements_by_type(
    types: IntArray, places: Int64Array, boxes: Int32Array, rng: np.random.Generator
) -> Int64Array:
    """Assign an element to each place of an enlarged facade, of the type of the place.

    Every element of a type is used about equally often, and repetitions are far apart.

    Parameters
    ----------
    types : (N,) types of the elements.
    places : (M,) element that each place is a copy of.
    boxes : (M, 4) pixels.

    Returns
    -------
    (M,) int.
    """
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2
    shown = np.full(len(places), -1)
    for t in np.unique(types[places]):
        members = np.flatnonzero(types == t)
        used = np.zeros(len(members), int)
        # Distance from each place of this type to the nearest one that already shows the member.
        here = np.flatnonzero(types[places] == t)
        free = np.full((len(here), len(members)), np.inf)
        for k, place in enumerate(here):
            offered = np.flatnonzero(used <= used.min() + 1)
            nearest = free[k, offered]
            best = offered[nearest == nearest.max()]
            pick = int(rng.choice(best))
            shown[place] = members[pick]
            used[pick] += 1
            free[:, pick] = np.minimum(free[:, pick], np.hypot(*(centre[here] - centre[place]).T))
    return shown
