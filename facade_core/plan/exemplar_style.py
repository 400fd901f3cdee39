"""Which exemplar a building without imagery takes: one that fits, of its street's character, and not its neighbour's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from facade_core.core.labels import FacadeClass

# How much chance may outweigh fit. Floors count by their log ratio, as does the height of a storey; width hardly, as bays are
# repeated and dropped: it only decides between equals.
VARIETY, FLOORS, STOREY, WIDTH = 0.8, 0.7, 0.7, 0.05
# What was made anew of an exemplar beyond this share counts so many times: one of which half was is taken where no other fits.
OFTEN_HIDDEN, GUESSED = 0.15, 4.0
# And so does what lies in the shadow of something else: it would be on walls that stand in the sun.
SHADED = 0.18
# Buildings of which walls stand as near as this are neighbours, metres: they are seen together, and no two take one exemplar.
NEIGHBOURS_M = 60.0
# What it costs to take a neighbour's exemplar, beyond any misfit, and at most to look like one beside.
TWIN, ALIKE = 100.0, 1.2
# And to have the form of any neighbour, whatever the paint: nearly nothing where they differ by more than FORM.
SAME_FORM, FORM = 3.0, 0.5
# A street keeps to so many families of exemplars, and what one of another family costs.
STREET_FAMILIES, STRANGER = 3, 1.0
# What it costs to show shops where the map has none, or none where it has some.
SHOPPING = 1.4
# A family has about so many exemplars, and a library at most so many families.
FAMILY_SIZE, MOST_FAMILIES = 5, 8
# Who goes first is decided by chance among neighbours, in so many rounds; who is left then takes no notice of others that are.
# What a building takes depends on nothing farther than so many times NEIGHBOURS_M.
ROUNDS = 16
# What tells exemplars apart, as the difference of each figure of a look that is plainly seen.
_TELLING = np.array([12.0, 8.0, 10.0, 0.10, 0.35, 0.30, 0.06, 0.12, 3.0])
# Of these, the first tell its colour.
_COLOURS = 3


@dataclass(frozen=True)
class Walls:
    """Facades to choose for, as columns of n.

    width, height (n,) metres; floors (n,); building (n,) a number of each one's building that stays when others come and go;
    street (n,) the same of its street; ends (n, 2, 2) metres, where each begins and ends, from above; shops (n,) 1 where a map
    has shops, 0 where it has none, -1 where none tells.
    """

    width: np.ndarray
    height: np.ndarray
    floors: np.ndarray
    building: np.ndarray
    street: np.ndarray
    ends: np.ndarray
    shops: np.ndarray


@dataclass(frozen=True)
class Library:
    """Exemplars to choose from, as columns of k: width, height in metres, floors; hidden, the share that was hidden and made
    anew; shaded, the share of the wall in shadow; shops, the share of the width that shops take; looks (k, 9), `look_of`."""

    width: Sequence[float]
    height: Sequence[float]
    floors: Sequence[float]
    hidden: Sequence[float]
    shaded: Sequence[float]
    shops: Sequence[float]
    looks: Sequence[Sequence[float]]

    @cached_property
    def distance(self) -> np.ndarray:
        """How far the look of each is from that of each, (k, k): 1 is plainly seen."""
        return self._apart(0)

    @cached_property
    def form(self) -> np.ndarray:
        """The same whatever its colours, (k, k)."""
        return self._apart(_COLOURS)

    def _apart(self, first: int) -> np.ndarray:
        looks = (np.asarray(self.looks, float).reshape(len(self.floors), -1) / _TELLING)[:, first:]
        return np.sqrt(((looks[:, None] - looks[None]) ** 2).sum(axis=-1))

    @cached_property
    def family(self) -> np.ndarray:
        """The family of each, (k,) int64, from 0: those that look alike, by average linkage."""
        from scipy.cluster.hierarchy import fcluster, linkage
        from scipy.spatial.distance import squareform

        count = len(self.floors)
        most = int(np.clip(round(count / FAMILY_SIZE), 1, MOST_FAMILIES))
        if count < 2 or most < 2:
            return np.zeros(count, np.int64)
        tree = linkage(squareform(self.distance, checks=False), "average")
        return fcluster(tree, most, "maxclust").astype(np.int64) - 1


def look_of(image: np.ndarray, labels: np.ndarray, metres_per_pixel: float) -> list[float]:
    """What tells a facade's style, of its picture (h, w, 3) uint8 and labels (h, w): CIELAB of the wall; the share of it that
    windows are, how tall they are to their width (log), the logarithm of their pitch in metres; the shares of balconies and
    roof; ornament, the mean step of the wall's lightness within 10 cm."""
    import cv2

    lab = cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    wall = labels == FacadeClass.WALL
    colour = np.median(lab[wall], axis=0) if wall.any() else np.zeros(3)
    count, _, boxes, _ = cv2.connectedComponentsWithStats((labels == FacadeClass.WINDOW).astype(np.uint8))
    tall, pitch = 0.0, 0.0
    if count > 1:
        width, height = (np.median(boxes[1:, side]) for side in (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT))
        tall = float(np.log(height / width))
        wall_area = labels.size * metres_per_pixel**2
        pitch = float(0.5 * np.log(wall_area / (count - 1)))
    # Steps over 10 cm tell ornament, and leave grain and joints out.
    small = max(8, round(image.shape[0] * metres_per_pixel * 10)), max(8, round(image.shape[1] * metres_per_pixel * 10))
    light = cv2.resize(lab[..., 0], small[::-1], interpolation=cv2.INTER_AREA)
    plain = cv2.resize(wall.astype(np.float32), small[::-1], interpolation=cv2.INTER_AREA)[1:, 1:] > 0.99
    step = np.abs(np.diff(light, axis=0))[:, 1:] + np.abs(np.diff(light, axis=1))[1:]
    ornament = float(step[plain].mean()) if plain.any() else 0.0
    share = [float((labels == one).mean()) for one in (FacadeClass.WINDOW, FacadeClass.BALCONY, FacadeClass.ROOF)]
    return [round(float(v), 4) for v in (*colour, share[0], tall, pitch, share[1], share[2], ornament)]


def choose_exemplars(walls: Walls, library: Library, *, seed: int) -> np.ndarray:
    """Index of the exemplar for each facade, (n,) int64; the facades of one building share theirs.

    The fit is of the building's widest facade: floors, the height of a storey, the families of its street, and what of an
    exemplar was made anew or lies in shadow; chance, by (seed, building), chooses among those that fit. No two buildings within
    NEIGHBOURS_M take the same one while there are others, after that the one whose nearest use is farthest; nor gladly two that
    look alike, or differ in paint alone. A choice depends on what is near, not on the order or number of the facades.
    """
    numbers, row = np.unique(walls.building, return_inverse=True)
    if not len(numbers):
        return np.zeros(0, np.int64)
    order = np.lexsort((-walls.width, row))
    main = order[np.searchsorted(row[order], np.arange(len(numbers)))]
    misfit = _misfits(walls, main, library)
    first = np.empty(len(numbers))
    for place, number in enumerate(numbers.tolist()):
        draw = np.random.default_rng([seed, number])
        first[place] = draw.random()  # as `order_of` has it
        misfit[place] += VARIETY * draw.random(misfit.shape[1])
    misfit += STRANGER * ~_at_home(walls.street[main], library.family, seed)
    near, metres = _neighbours(walls.ends, row, len(numbers))
    rank = _ranks(first, numbers)

    chosen = np.full(len(numbers), -1)
    for turn in range(ROUNDS + 1):
        left = np.flatnonzero(chosen < 0)
        ready = [int(i) for i in left if turn == ROUNDS or all(rank[i] < rank[j] for j in near[i] if chosen[j] < 0)]
        taken = {i: _taken(misfit[i], chosen[near[i]], metres[i], library) for i in ready}
        for i, exemplar in taken.items():
            chosen[i] = exemplar
        if len(ready) == len(left):
            break
    return chosen[row]


@dataclass(frozen=True)
class Order:
    """Who of a city's buildings chooses before whom: their numbers (b,), ascending, and of each the rows of those near that go
    before it."""

    numbers: np.ndarray
    first: tuple[np.ndarray, ...]

    def needed(self, chosen: np.ndarray) -> np.ndarray:
        """The numbers (k,) of the buildings that are needed to choose for some, (c,) their numbers, with these: those that
        go before them, before those, and so on."""
        found = np.isin(self.numbers, chosen)
        waiting = np.flatnonzero(found).tolist()
        while waiting:
            rows = self.first[waiting.pop()]
            new = rows[~found[rows]]
            found[new] = True
            waiting += new.tolist()
        return self.numbers[found]


def order_of(walls: Walls, *, seed: int) -> Order:
    """The order in which `choose_exemplars` goes through buildings."""
    numbers, row = np.unique(walls.building, return_inverse=True)
    near, _ = _neighbours(walls.ends, row, len(numbers))
    rank = _ranks(np.array([np.random.default_rng([seed, number]).random() for number in numbers.tolist()]), numbers)
    return Order(numbers, tuple(others[rank[others] < rank[one]] for one, others in enumerate(near)))


def _ranks(first: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Who goes before whom, (b,) int64, by a draw (b,) of each."""
    rank = np.empty(len(numbers), np.int64)
    rank[np.lexsort((numbers, first))] = np.arange(len(numbers))
    return rank


def _misfits(walls: Walls, main: np.ndarray, library: Library) -> np.ndarray:
    """What each exemplar costs each building by its widest facade, (b, k)."""

    def ratio(own: np.ndarray, theirs: np.ndarray) -> np.ndarray:
        return np.abs(np.log(own[:, None] / theirs[None]))

    floors, given = walls.floors[main].astype(float), np.maximum(np.asarray(library.floors, float), 1)
    misfit = FLOORS * ratio(floors, given)
    misfit += STOREY * ratio(walls.height[main] / floors, np.asarray(library.height, float) / given)
    misfit += WIDTH * ratio(walls.width[main], np.asarray(library.width, float))
    misfit += GUESSED * np.maximum(0, np.asarray(library.hidden, float) - OFTEN_HIDDEN)
    told, has = walls.shops[main][:, None], np.asarray(library.shops, float) > 0
    misfit += SHOPPING * ((told >= 0) & (has != (told > 0)))
    return misfit + GUESSED * np.maximum(0, np.asarray(library.shaded, float) - SHADED)


def _at_home(street: np.ndarray, family: np.ndarray, seed: int) -> np.ndarray:
    """Whether each exemplar is of the families of the street (b,) of each building, (b, k) bool."""
    home = np.ones((len(street), len(family)), bool)
    count = int(family.max(initial=0)) + 1
    for number in np.unique(street).tolist():
        kept = np.random.default_rng([seed, number]).permutation(count)[:STREET_FAMILIES]
        home[street == number] = np.isin(family, kept)
    return home


def _neighbours(ends: np.ndarray, row: np.ndarray, count: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Of each of `count` buildings the others with a wall within NEIGHBOURS_M, ascending, and their distances in metres."""
    lines = shapely.linestrings(ends)
    one, other = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=NEIGHBOURS_M)
    apart = row[one] != row[other]
    pairs = np.column_stack([row[one[apart]], row[other[apart]]])
    metres = shapely.distance(lines[one[apart]], lines[other[apart]])
    order = np.lexsort((metres, pairs[:, 1], pairs[:, 0]))
    pairs, metres = pairs[order], metres[order]
    new = np.ones(len(pairs), bool)
    new[1:] = (np.diff(pairs, axis=0) != 0).any(axis=1)
    pairs, metres = pairs[new], metres[new]
    cuts = np.searchsorted(pairs[:, 0], np.arange(1, count))
    return np.split(pairs[:, 1], cuts), np.split(metres, cuts)


def _taken(misfit: np.ndarray, theirs: np.ndarray, metres: np.ndarray, library: Library) -> int:
    """The exemplar of one building, by what its neighbours took, -1 nothing yet, and how far they are."""
    cost = misfit.copy()
    has = theirs >= 0
    closeness = 1 - metres[has] / NEIGHBOURS_M
    for exemplar, close in zip(theirs[has].tolist(), closeness.tolist(), strict=True):
        cost[exemplar] = max(cost[exemplar], misfit[exemplar] + TWIN * (1 + close))
    if has.any():
        alike = np.exp(-(library.distance[theirs[has]] ** 2)) * closeness[:, None]
        cost += ALIKE * alike.max(axis=0)
        cost += SAME_FORM * np.exp(-((library.form[theirs[has]] / FORM) ** 2)).max(axis=0)
    return int(np.argmin(cost))
