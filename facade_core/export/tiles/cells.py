"""Quadtree over a block whose leaves fill their texture pages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, IntArray
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.export.tiles.quadtree import collect_members, quadrant_corner, split_quadrants
from facade_core.export.tiles.settings import TILE_CELLS, CellSettings


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


def build_quadtree(source: TexturedMesh, settings: CellSettings = TILE_CELLS) -> QuadtreeCell:
    """Divide a block until the texels of a cell fit a tile or it holds one building.

    Quadrants of a cell that fit a tile together become one child.
    """
    members = collect_members(source.charts, source.texels.prod(axis=1), np.unique(source.mesh.chart))
    points = members.points
    low, high = points.min(axis=0), points.max(axis=0)

    def texels(inside: Int64Array) -> int:
        return int(members.texel_counts[inside].sum())

    def cell(path: str, inside: Int64Array, children: tuple[QuadtreeCell, ...] = ()) -> QuadtreeCell:
        total = texels(inside)
        # the texels per metre of the coarse tile are halved until it fits
        steps = np.ceil(np.log2(max(1.0, total * settings.coarse_scale**2 / settings.max_coarse_tile_texels)) / 2)
        return QuadtreeCell(path, *members.split(inside), total, settings.coarse_scale * 0.5 ** float(steps), children)

    def divided(inside: Int64Array, path: str) -> bool:
        return (
            texels(inside) > settings.division_factor * settings.max_coarse_tile_texels
            and len(inside) > 1
            and len(path) < settings.max_depth
        )

    def divide(path: str, inside: Int64Array, corner: Float64Array, side: float) -> QuadtreeCell:
        if not divided(inside, path):
            return cell(path, inside)
        parts = {q: inside[mine] for q, mine in split_quadrants(points[inside], corner, side).items()}
        large = [q for q, mine in parts.items() if divided(mine, path + str(q))]
        children = [divide(path + str(q), parts[q], quadrant_corner(q, corner, side), side / 2) for q in large]
        small = {q: texels(mine) for q, mine in parts.items() if q not in large}
        for joined in _bundle_quadrants(small, settings):
            together = np.sort(np.concatenate([parts[q] for q in joined]))
            children.append(cell(path + "_".join(map(str, joined)), together))
        return cell(path, inside, tuple(children))

    return divide("", np.arange(len(points)), low, float((high - low).max()) + 1e-6)


def _bundle_quadrants(texels: Mapping[int, int], settings: CellSettings) -> list[list[int]]:
    """Bundle quadrants with their texels, heaviest first, as long as a bundle fits a leaf."""
    bundles: list[tuple[int, list[int]]] = []
    for quadrant, mine in sorted(texels.items(), key=lambda one: (-one[1], one[0])):
        for i, (total, held) in enumerate(bundles):
            if total + mine <= settings.max_leaf_factor * settings.max_coarse_tile_texels:
                bundles[i] = (total + mine, [*held, quadrant])
                break
        else:
            bundles.append((mine, [quadrant]))
    return [sorted(held) for _, held in bundles]
