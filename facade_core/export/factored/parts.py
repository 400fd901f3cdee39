"""A factored model's parts: what was laid of facades, by texture, and pages of all that is none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from facade_core.core.grouping import RowIndex, group_rows
from facade_core.export.factored.glb import Part
from facade_core.export.factored.texture_packing import Shown
from facade_core.export.factored.wall_geometry import Piece, Pieces
from facade_core.export.models.pages import scaled
from facade_core.export.models.textured_mesh import Frame, Textured
from facade_core.export.tiles.tile_pages import tile_pages
from facade_core.geometry.charts import ChartKind

# What is no facade has this share of its texels a metre, which are fewer the farther off streets pass (ADR 0063); at most, and
# no fewer than so many: ground, and all else (roofs, walls between houses).
GROUND_SHARE, GROUND_MOST, REST_SHARE, REST_MOST, LEAST = 0.375, 8.0, 0.25, 4.0, 2.0


def joined(every: Iterable[Pieces]) -> Pieces:
    """What was laid of all buildings, by picture."""
    whole = Pieces()
    for pieces in every:
        for key, own in pieces.by_picture.items():
            whole.by_picture.setdefault(key, []).extend(own)
        whole.elements.extend(pieces.elements)
    return whole


def parts_of(pieces: Pieces, pictures: Shown, frame: Frame) -> dict[int, Part]:
    """What was laid of a building, by texture."""
    by_texture: dict[int, list[tuple[Piece, np.ndarray, np.ndarray]]] = {}
    for key, own in sorted(pieces.by_picture.items()):
        for piece in own:
            texture, uv, colour = pictures.laid(key, piece)
            by_texture.setdefault(texture, []).append((piece, uv, colour))
    return {
        texture: _part(
            [(piece.position, piece.normal, uv, colour, piece.triangles, piece.chart) for piece, uv, colour in own],
            frame,
        )
        for texture, own in by_texture.items()
    }


def together(every: Iterable[Mapping[int, Part]]) -> dict[int, Part]:
    """Parts of several buildings as one, by texture."""
    of: dict[int, list[Part]] = {}
    for parts in every:
        for texture, part in parts.items():
            of.setdefault(texture, []).append(part)
    return {texture: _joined(own) for texture, own in sorted(of.items())}


def _joined(own: Sequence[Part]) -> Part:
    first = np.concatenate([[0], np.cumsum([len(part.position) for part in own])[:-1]])
    return Part(
        np.concatenate([part.position for part in own]),
        np.concatenate([part.normal for part in own]),
        np.concatenate([part.uv for part in own]),
        np.concatenate([part.colour for part in own]),
        np.concatenate([part.triangles + start for part, start in zip(own, first.tolist(), strict=True)]),
        np.concatenate([part.chart for part in own]),
    )


def _part(rows: Sequence[tuple[Any, ...]], frame: Frame) -> Part:
    """One part of rows of position, normal, texture coordinates, colour, triangles and charts."""
    position, normal, uv, colour, triangles, chart = zip(*rows, strict=True)
    first = np.concatenate([[0], np.cumsum([len(one) for one in position])])
    return Part(
        frame.points(np.concatenate(position)),
        frame.directions(np.concatenate(normal)),
        np.concatenate(uv),
        np.concatenate(colour),
        np.concatenate([one + start for one, start in zip(triangles, first[:-1], strict=True)]),
        np.concatenate([np.full(len(p), c) for p, c in zip(position, chart, strict=True)]),
    )


def rest(
    source: Textured, triangles_of: RowIndex, charts: np.ndarray, before: int, frame: Frame
) -> tuple[list[np.ndarray], dict[int, dict[int, Part]]]:
    """The pages of charts that are not factored, before which are so many other pictures; and their parts, by building.
    triangles_of: the mesh's by chart."""
    kind = source.charts.kind
    density = (source.texels / source.extent).max(axis=1)
    share, most = np.where((kind == ChartKind.GROUND)[:, None], (GROUND_SHARE, GROUND_MOST), (REST_SHARE, REST_MOST)).T
    most = np.clip(share * density, LEAST, most)
    share = np.where(np.isin(kind, (ChartKind.WINDOW, ChartKind.DOOR)), 1.0, np.minimum(1.0, most / density))
    texels = np.maximum(1, np.ceil(source.texels * share[:, None] - 1e-6)).astype(np.int64)

    def raster(chart: int) -> np.ndarray:
        width, height = texels[chart].tolist()
        return scaled(source.raster(chart), (width, height))

    pages = tile_pages(replace(source, texels=texels, raster=raster), charts)
    drawn, mesh = pages.drawn, source.mesh
    place = np.full(len(source.charts), -1, np.int64)
    place[charts] = np.arange(len(charts))
    mine = triangles_of.rows_with_any(charts)
    page = drawn.layout.page[place[mesh.chart[mine]]]
    owner = source.charts.building[mesh.chart[mine]].astype(np.int64)
    count = len(drawn.layout.pages)
    parts: dict[int, dict[int, Part]] = {}
    for code, here in sorted(group_rows((owner + 1) * count + page).items()):
        used, index = np.unique(mesh.triangles[mine[here]], return_inverse=True)
        chart = mesh.vertex_chart[used]
        parts.setdefault(int(code // count - 1), {})[before + int(code % count)] = Part(
            frame.points(mesh.vertices[used]),
            frame.directions(source.normals[used]),
            drawn.texture_coordinates(chart, source.coordinates[used]),
            np.ones((len(used), 3)),
            index.reshape(-1, 3),
            chart,
        )
    return [pages.pictures(page).colour for page in range(count)], parts
