"""Quadtree over a block whose leaves fill their texture pages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, IntArray
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.export.tiles.quadtree import collect_members, quadrant_corner, split_quadrants

# Maximum texels of a coarse tile: a page of 2048 square.
MAX_COARSE_TILE_TEXELS = 2048**2
# A cell is divided above this multiple of MAX_COARSE_TILE_TEXELS.
DIVISION_FACTOR = 2.0
# Undivided quadrants share a tile up to this multiple of MAX_COARSE_TILE_TEXELS.
MAX_LEAF_FACTOR = 2.5
# Maximum scale of the texels per metre in coarse tiles.
COARSE_SCALE = 0.25
# Maximum depth of the quadtree.
MAX_DEPTH = 12


@dataclass(frozen=True)
class QuadtreeCell:
    """Cell of the quadtree.

    Attributes
    ----------
    path : quadrants from the root; joined quadrants as "0_2".
    buildings : buildings whose centre is in the cell.
    ground : ground charts whose centre is in the cell.
    texels : texels of all their charts.
    scale : scale of its coarse tile.
    children : cells below it.
    """

    path: str
    buildings: Int64Array
    ground: IntArray
    texels: int
    scale: float
    children: tuple[QuadtreeCell, ...] = field(default=())

    def leaves(self) -> Iterator[QuadtreeCell]:
        """Iterate over the leaves below the cell."""
        if not self.children:
            yield self
        for child in self.children:
            yield from child.leaves()


def build_quadtree(source: TexturedMesh) -> QuadtreeCell:
    """Divide a block until the texels of a cell fit a tile or it holds one building.

    Quadrants of a cell that fit a tile together become one child.
    """
    members = collect_members(source.charts, source.texels.prod(axis=1), np.unique(source.mesh.chart))
    points = members.points
    low, high = points.min(axis=0), points.max(axis=0)

    def cell(path: str, inside: Int64Array, children: tuple[QuadtreeCell, ...] = ()) -> QuadtreeCell:
        total = int(members.texel_counts[inside].sum())
        # the texels per metre of the coarse tile are halved until it fits
        steps = np.ceil(np.log2(max(1.0, total * COARSE_SCALE**2 / MAX_COARSE_TILE_TEXELS)) / 2)
        return QuadtreeCell(path, *members.split(inside), total, COARSE_SCALE * 0.5 ** float(steps), children)

    def divided(inside: Int64Array, path: str) -> bool:
        return (
            int(members.texel_counts[inside].sum()) > DIVISION_FACTOR * MAX_COARSE_TILE_TEXELS
            and len(inside) > 1
            and len(path) < MAX_DEPTH
        )

    def divide(path: str, inside: Int64Array, corner: Float64Array, side: float) -> QuadtreeCell:
        if not divided(inside, path):
            return cell(path, inside)
        parts = {q: inside[mine] for q, mine in split_quadrants(points[inside], corner, side).items()}
        large = [q for q, mine in parts.items() if divided(mine, path + str(q))]
        children = [divide(path + str(q), parts[q], quadrant_corner(q, corner, side), side / 2) for q in large]
        small = [q for q in parts if q not in large]
        for joined in _bundle_quadrants(small, [int(members.texel_counts[parts[q]].sum()) for q in small]):
            together = np.sort(np.concatenate([parts[q] for q in joined]))
            children.append(cell(path + "_".join(map(str, joined)), together))
        return cell(path, inside, tuple(children))

    return divide("", np.arange(len(points)), low, float((high - low).max()) + 1e-6)


def _bundle_quadrants(quadrants: Sequence[int], weight: Sequence[int]) -> list[list[int]]:
    """Bundle quadrants, heaviest first, as long as a bundle fits a leaf."""
    bundles: list[tuple[int, list[int]]] = []
    for mine, quadrant in sorted(zip(weight, quadrants, strict=True), key=lambda one: (-one[0], one[1])):
        for i, (total, held) in enumerate(bundles):
            if total + mine <= MAX_LEAF_FACTOR * MAX_COARSE_TILE_TEXELS:
                bundles[i] = (total + mine, [*held, quadrant])
                break
        else:
            bundles.append((mine, [quadrant]))
    return [sorted(held) for _, held in bundles]
