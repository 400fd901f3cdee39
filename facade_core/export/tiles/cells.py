"""The cells of a quadtree over a block, whose leaves fill their pages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from facade_core.export.models.textured_mesh import Textured
from facade_core.export.tiles.quadtree import members_of, quadrant_corner, quadrants

# Texels of a coarse tile at most, a page of 2048 square. A finer one is divided at FULL of these, and quadrants that stay whole
# are one tile as long as they are LARGEST_LEAF of these together.
TILE_TEXELS = 2048**2
FULL, LARGEST_LEAF = 2.0, 2.5
# Coarse tiles have this share of the texels per metre at most.
COARSE = 0.25
# No cell is divided more often.
DEEPEST = 12


@dataclass(frozen=True)
class Cell:
    """A cell of the quadtree: path of quadrants from the root, of joined ones "0_2"; the buildings and pieces of ground (chart
    ids) whose middles lie in it; texels of all their charts; scale of its coarse tile."""

    path: str
    buildings: np.ndarray
    ground: np.ndarray
    texels: int
    scale: float
    children: tuple[Cell, ...] = field(default=())

    def leaves(self) -> Iterator[Cell]:
        if not self.children:
            yield self
        for child in self.children:
            yield from child.leaves()


def quadtree(source: Textured) -> Cell:
    """The block's cells, divided until a cell's texels fit a tile or it holds one building; quadrants of one cell that fit a
    tile together are one."""
    members = members_of(source.charts, source.texels.prod(axis=1), np.unique(source.mesh.chart))
    points = members.points
    low, high = points.min(axis=0), points.max(axis=0)

    def cell(path: str, inside: np.ndarray, children: tuple[Cell, ...] = ()) -> Cell:
        total = int(members.weight[inside].sum())
        # the coarse tile's texels per metre are halved until it fits
        steps = np.ceil(np.log2(max(1.0, total * COARSE**2 / TILE_TEXELS)) / 2)
        return Cell(path, *members.split(inside), total, COARSE * 0.5 ** float(steps), children)

    def divided(inside: np.ndarray, path: str) -> bool:
        return int(members.weight[inside].sum()) > FULL * TILE_TEXELS and len(inside) > 1 and len(path) < DEEPEST

    def divide(path: str, inside: np.ndarray, corner: np.ndarray, side: float) -> Cell:
        if not divided(inside, path):
            return cell(path, inside)
        parts = {q: inside[mine] for q, mine in quadrants(points[inside], corner, side).items()}
        large = [q for q, mine in parts.items() if divided(mine, path + str(q))]
        children = [divide(path + str(q), parts[q], quadrant_corner(q, corner, side), side / 2) for q in large]
        small = [q for q in parts if q not in large]
        for joined in _joined(small, [int(members.weight[parts[q]].sum()) for q in small]):
            together = np.sort(np.concatenate([parts[q] for q in joined]))
            children.append(cell(path + "_".join(map(str, joined)), together))
        return cell(path, inside, tuple(children))

    return divide("", np.arange(len(points)), low, float((high - low).max()) + 1e-6)


def _joined(quadrants: Sequence[int], weight: Sequence[int]) -> list[list[int]]:
    """Quadrants bundled, the heaviest first, as long as a bundle fits a leaf."""
    bundles: list[tuple[int, list[int]]] = []
    for mine, quadrant in sorted(zip(weight, quadrants, strict=True), key=lambda one: (-one[0], one[1])):
        for i, (total, held) in enumerate(bundles):
            if total + mine <= LARGEST_LEAF * TILE_TEXELS:
                bundles[i] = (total + mine, [*held, quadrant])
                break
        else:
            bundles.append((mine, [quadrant]))
    return [sorted(held) for _, held in bundles]
