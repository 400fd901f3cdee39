"""3D Tiles 1.1: a quadtree of buildings, coarse above and as textured below."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from facade_core.export.attribution import Attribution
from facade_core.export.earth import EarthFrame
from facade_core.export.glb import glb_bytes
from facade_core.export.models import Drawn, Textured, jpegs, layout_of, nodes_of
from facade_core.export.quadtree import members_of, quadrant_corner, quadrants
from facade_core.export.shells import Shells

# Texels of a tile: a page of 2048 square. A cell with more is divided, a coarse tile has so much fewer per metre.
TILE_TEXELS = 2048**2
# Coarse tiles have this share of the texels per metre at most.
COARSE = 0.25
# A tile is replaced once a texel of its pictures covers a pixel: viewers do that where the error covers this many.
ERROR_PIXELS = 16
# No cell is divided more often.
DEEPEST = 12


@dataclass(frozen=True)
class Cell:
    """A cell of the quadtree: path of quadrants from the root; the buildings and pieces of ground (chart ids) whose middles lie
    in it; texels of all their charts; scale of its coarse tile."""

    path: str
    buildings: np.ndarray
    ground: np.ndarray
    texels: int
    scale: float
    children: tuple[Cell, ...] = field(default=())


def quadtree(source: Textured) -> Cell:
    """The block's cells, divided until a cell's texels fit a tile or it holds one building."""
    members = members_of(source.charts, source.texels.prod(axis=1), np.unique(source.mesh.chart))
    points = members.points
    low, high = points.min(axis=0), points.max(axis=0)

    def divide(path: str, inside: np.ndarray, corner: np.ndarray, side: float) -> Cell:
        total = int(members.weight[inside].sum())
        # the coarse tile's texels per metre are halved until it fits
        steps = np.ceil(np.log2(max(1.0, total * COARSE**2 / TILE_TEXELS)) / 2)
        scale = COARSE * 0.5 ** float(steps)
        children: tuple[Cell, ...] = ()
        if total > TILE_TEXELS and len(inside) > 1 and len(path) < DEEPEST:
            children = tuple(
                divide(path + str(q), inside[mine], quadrant_corner(q, corner, side), side / 2)
                for q, mine in quadrants(points[inside], corner, side).items()
            )
        return Cell(path, *members.split(inside), total, scale, children)

    return divide("", np.arange(len(points)), low, float((high - low).max()) + 1e-6)


def write_tileset(
    source: Textured,
    cells: Cell,
    shells: Shells,
    frame: EarthFrame,
    names: Mapping[int, str],
    density: float,
    write: Callable[[str, bytes], None],
    *,
    extras: Mapping[str, Any],
    attribution: Attribution,
) -> dict[str, Any]:
    """tileset.json of a quadtree as a value, its tiles given to `write` as (relative path, bytes).

    density: texels per metre of the source. The lowest tiles show the source as it is. Every tile above shows shells with
    fewer texels per metre, and buildings without a shell and the ground as they are, with as many fewer.
    """

    def content(uri: str, drawn: Sequence[Drawn]) -> np.ndarray:
        """Write a tile; its least and greatest corner (2, 3), z up."""
        nodes, bounds = nodes_of(drawn, names, frame)
        pictures = [jpeg for part in drawn for jpeg in jpegs(part)]
        write(uri, glb_bytes(nodes, pictures, copyright=attribution.line))
        return bounds[:, [0, 2, 1]] * [1, -1, 1]

    def full(cell: Cell) -> dict[str, Any]:
        uri = f"tiles/full{cell.path and '-'}{cell.path}.glb"
        charts = np.union1d(cell.ground, source.chosen(cell.buildings)).astype(np.int64)
        corners = content(uri, [layout_of(source, charts)])
        return {"boundingVolume": {"box": _box(corners)}, "geometricError": 0.0, "content": {"uri": uri}}

    def below(cell: Cell) -> list[dict[str, Any]]:
        """What replaces the coarse tile of a cell: tiles of the nearest cells within that are finer."""
        tiles = [t for c in cell.children for t in ([coarse(c)] if c.scale > cell.scale else below(c))]
        return tiles or [full(cell)]

    def coarse(cell: Cell) -> dict[str, Any]:
        children = below(cell)
        whole = np.intersect1d(cell.buildings, shells.kept)
        own = np.union1d(cell.ground, source.chosen(whole)).astype(np.int64)
        shelled = shells.textured.chosen(np.setdiff1d(cell.buildings, whole))
        uri = f"tiles/coarse{cell.path and '-'}{cell.path}.glb"
        # a shell's rasters are as coarse already as the finest coarse tile
        drawn = [layout_of(shells.textured, shelled, cell.scale / COARSE), layout_of(source, own, cell.scale)]
        corners = [content(uri, drawn), *map(_corners, children)]
        errors = [shells.off, ERROR_PIXELS / (density * cell.scale), *(child["geometricError"] for child in children)]
        return {
            "boundingVolume": {"box": _box(np.concatenate(corners))},
            "geometricError": max(errors),
            "refine": "REPLACE",
            "content": {"uri": uri},
            "children": children,
        }

    root = coarse(cells)
    root["transform"] = frame.transform().T.reshape(-1).tolist()
    reach = 2 * float(np.linalg.norm(np.array(root["boundingVolume"]["box"])[[3, 7, 11]]))
    return {
        "asset": {"version": "1.1", "extras": {**extras, "attribution": attribution.value()}},
        "geometricError": max(reach, 2 * root["geometricError"]),
        "root": root,
    }


def count_tiles(cell: Cell, above: float = 0.0) -> int:
    """How many tiles `write_tileset` makes of a quadtree below a tile of scale `above`."""
    return (cell.scale > above) + (sum(count_tiles(child, cell.scale) for child in cell.children) or 1)


def _box(points: np.ndarray) -> list[float]:
    """The bounding volume of points (n, 3), z up: centre and half axes, never flat."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.maximum((high - low) / 2, 0.01)
    return np.concatenate([(low + high) / 2, np.diag(half).reshape(-1)]).tolist()


def _corners(tile: Mapping[str, Any]) -> np.ndarray:
    box = np.array(tile["boundingVolume"]["box"])
    half = box[[3, 7, 11]]
    return np.stack([box[:3] - half, box[:3] + half])
