"""Complete charts: texture of the base layer, materials elsewhere, ground after what streets continue."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.atlas.surroundings import ChartReader, coplanar_pieces, read_chart_with_surroundings
from facade_core.core.arrays import BoolArray, Float32Array, Int64Array, IntArray, UInt8Array
from facade_core.core.levelling import MAX_SEAM_DECAYS, SEAM_DECAY_M, level_seam_colours
from facade_core.core.provenance import Provenance
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.overhead_view import AerialSampler, resample_aerial_to_chart
from facade_core.geometry.party_walls import find_enclosed_texels
from facade_core.geometry.scene import Scene
from facade_core.street.continuation import DecidedDifferences
from facade_core.street.lighting.facade_light import light_facade
from facade_core.street.lighting.light import SceneLight
from facade_core.street.materials.example_fill import fill_by_example
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.settings import EXAMPLE_FILL

# Margin around a chart that its levelling depends on.
LEVELLING_MARGIN_M = SEAM_DECAY_M * MAX_SEAM_DECAYS
# Distance over which a ground picture fades into the material.
PHOTO_FADE_M = 1.0


class KnownTexture(NamedTuple):
    """Reader of the texture of the base layer, and the charts that have it.

    Attributes
    ----------
    read : reads part of any chart; provenance UNSEEN where nothing is known.
    base_charts : charts with a base layer from facades or textures.
    photo_charts : walls and roofs of `base_charts` that show camera pictures; at least the asked chart and its
        neighbours.
    """

    read: ChartReader
    base_charts: Collection[int]
    photo_charts: Collection[int] = ()


@dataclass(frozen=True)
class FinishSettings:
    """Settings by which a chart is finished.

    Attributes
    ----------
    levelling : level generated texels to seen ones of the same surface, and both to pictures. Pictures of ground fade
        instead.
    aerial : picture from above.
    differences : what the views of streets decided that ground differs by from its material.
    """

    levelling: bool = True
    aerial: AerialSampler | None = None
    differences: DecidedDifferences | None = None


@dataclass(frozen=True)
class ChartLight:
    """Light on a chart.

    Attributes
    ----------
    scene : light on the charts of the scene.
    labels : (h, w) class id of the facade on the chart, whose relief casts shadows.
    """

    scene: SceneLight
    labels: UInt8Array | None = None


DEFAULT_FINISH = FinishSettings()


class _Surroundings(NamedTuple):
    """Texels of other charts that a chart is levelled to.

    Attributes
    ----------
    read : reads part of any chart.
    charts : charts that count.
    rank_limit : texels count if their rank exceeds it.
    decay_m : metres over which the offset decays to a third.
    """

    read: ChartReader
    charts: Collection[int]
    rank_limit: int
    decay_m: float = SEAM_DECAY_M


def finish_chart(
    scene: Scene,
    materials: MaterialField,
    chart: int,
    known: KnownTexture,
    settings: FinishSettings = DEFAULT_FINISH,
    light: ChartLight | None = None,
) -> tuple[UInt8Array, UInt8Array]:
    """Compute the final colour and provenance of a chart.

    Untextured texels get their material, with the differences that views decided; untextured ground under the open sky
    gets the aerial picture. Hidden parts of a wall get one colour, which compresses to nothing. Generated texels are
    lit before they are levelled, so that what continues a picture keeps the light that the picture shows. Pictures are
    never lit. Labels add the shadows of a facade's relief.

    Parameters
    ----------
    scene : the block's geometry and atlas layout.
    materials : material field of the block, without light of its own if `light` is given.
    chart : row of the chart.
    known : texture of the base layer.
    settings : settings by which the chart is finished.
    light : None for colours without light.

    Returns
    -------
    Colour (h, w, 3) uint8 and provenance (h, w) uint8 without UNSEEN.
    """
    aerial, differences = settings.aerial, settings.differences
    height, width = scene.placement.shape(chart)
    colour, provenance = (values.copy() for values in known.read(chart, slice(0, height), slice(0, width)))
    untextured = provenance == Provenance.UNSEEN
    hidden = np.zeros_like(untextured)
    if untextured.any():
        hidden = untextured & find_enclosed_texels(scene, chart)
        exposed = untextured & ~hidden
        colour[exposed] = paint_texels(materials, chart, differences, *np.nonzero(exposed))
        colour[hidden] = _distant_colour(scene, materials, chart)
        provenance[untextured] = Provenance.MATERIAL
        if differences is not None:
            provenance[exposed & (differences.views > 0)] = Provenance.TRANSLATED
        if aerial is not None and scene.charts.kind[chart] == ChartKind.GROUND:
            rgb, has_aerial = resample_aerial_to_chart(scene, chart, aerial)
            has_aerial &= untextured
            colour[has_aerial], provenance[has_aerial] = rgb[has_aerial], Provenance.PHOTO
    if light is not None:
        _light_generated(
            scene, light, chart, colour, np.where(hidden, Provenance.UNSEEN, provenance), materials.arrays.seed
        )
        known = known._replace(read=_lit_reader(known.read, light.scene))
    if not settings.levelling:
        return colour, provenance
    free = untextured & (provenance == Provenance.PHOTO)
    if free.any():
        textured = _Surroundings(known.read, known.base_charts, Provenance.UNSEEN)
        colour = _level_to_surroundings(scene, chart, colour, ~untextured, free, textured)
    generated = untextured | (provenance <= Provenance.TRANSLATED)
    if scene.charts.kind[chart] != ChartKind.GROUND:
        pieces = {chart, *coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()}
        if not pieces.isdisjoint(known.photo_charts):
            # a wall is one material, so that its pictures extend without limit
            colour, filled, _ = _extend_photos(scene, None, chart, colour, generated & ~hidden, known)
            provenance[filled] = Provenance.INPAINTED
            seen = _Surroundings(known.read, known.base_charts, Provenance.TRANSLATED, np.inf)
            return _level_to_surroundings(
                scene, chart, colour, ~generated | filled, generated & ~filled, seen
            ), provenance
        seen = _Surroundings(known.read, known.base_charts, Provenance.TRANSLATED)
        return _level_to_surroundings(scene, chart, colour, ~generated, generated, seen), provenance
    # A ground picture says nothing about distant ground, so that is not levelled to it: the picture extends a little by
    # example and then fades into the material. With an aerial picture it does not end at a piece's border: the
    # neighbours' data do not contain the aerial picture yet.
    ground_pieces = (
        {chart, *coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()} if aerial is None else {chart}
    )
    if ground_pieces.isdisjoint(known.base_charts):
        return colour, provenance
    has_photo, end = ~generated, provenance != Provenance.PHOTO
    if aerial is None:
        colour, filled, end = _extend_photos(scene, materials, chart, colour, generated, known)
        provenance[filled] = Provenance.INPAINTED
        has_photo |= filled
    share = photo_fade_weight(scene, chart, end)
    mixed = (share < 1) & has_photo
    painted = colour.copy()
    painted[mixed] = paint_texels(materials, chart, differences, *np.nonzero(mixed))
    if light is not None:
        _light_generated(scene, light, chart, painted, np.where(mixed, Provenance.MATERIAL, 0), materials.arrays.seed)
    weight = share[mixed][:, None]
    colour[mixed] = (weight * colour[mixed] + (1 - weight) * painted[mixed] + 0.5).astype(np.uint8)
    return colour, provenance


def _light_generated(
    scene: Scene, light: ChartLight, chart: int, colour: UInt8Array, provenance: IntArray, seed: int
) -> None:
    """Light the generated texels of a chart by their provenance (h, w), in place; UNSEEN ones stay."""
    painted = (provenance > Provenance.UNSEEN) & (provenance <= Provenance.TRANSLATED)
    light.scene.lay(chart, colour, painted)
    is_synthesised = provenance == Provenance.SYNTHESISED
    if light.labels is None:
        light.scene.lay(chart, colour, is_synthesised)
    elif is_synthesised.any():
        light_facade(scene, light.scene, chart, colour, is_synthesised, light.labels, seed)


def _lit_reader(read: ChartReader, light: SceneLight) -> ChartReader:
    """Return a reader of the base layer with light on its synthesised texels."""

    def read_lit(chart: int, rows: slice, columns: slice) -> tuple[UInt8Array, UInt8Array]:
        colour, provenance = read(chart, rows, columns)
        is_synthesised = provenance == Provenance.SYNTHESISED
        if is_synthesised.any():
            colour = colour.copy()
            light.lay(chart, colour, is_synthesised, start=(rows.start, columns.start))
        return colour, provenance

    return read_lit


def paint_texels(
    materials: MaterialField, chart: int, differences: DecidedDifferences | None, rows: Int64Array, columns: Int64Array
) -> UInt8Array:
    """Return the material (k, 3) of texels, with the differences that views decided."""
    painted = materials.texel_colours(chart, rows, columns)
    return painted if differences is None else differences.apply(painted, rows, columns)


def _extend_photos(
    scene: Scene,
    materials: MaterialField | None,
    chart: int,
    colour: UInt8Array,
    free: BoolArray,
    known: KnownTexture,
) -> tuple[UInt8Array, BoolArray, BoolArray]:
    """Extend pictures by example into free texels.

    Returns the colour (h, w, 3), the filled texels (h, w), and texels without picture of the chart with
    LEVELLING_MARGIN_M around it. `materials` gives the kinds of ground, where pictures extend up to MAX_FILL_M; None
    treats the surface as one kind, where they extend without limit.
    """
    max_distance_m = np.inf if materials is None else EXAMPLE_FILL.max_fill_m
    density, size = float(scene.placement.texels_per_metre[chart]), (free.shape[0], free.shape[1])
    margin = round(LEVELLING_MARGIN_M * density)
    interior = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))

    def read_ranked(piece: int, rows: slice, columns: slice) -> tuple[UInt8Array, UInt8Array]:
        piece_colour, rank = known.read(piece, rows, columns)
        return piece_colour, rank + 1  # 0 is outside all pieces

    wide, rank = read_chart_with_surroundings(
        scene.charts, scene.placement.texels_per_metre, chart, size, margin, read_ranked
    )
    has_photo, fillable = rank == Provenance.PHOTO + 1, rank > 0
    fillable[interior] &= free
    kinds = np.zeros(rank.shape, np.uint8) if materials is None else materials.ground_kinds(chart, margin)
    extended, filled = fill_by_example(wide, has_photo, fillable, kinds, density, max_distance_m)
    end = (rank > 0) & ~has_photo & ~filled
    filled_inside = filled[interior]
    return np.where(filled_inside[..., None], extended[interior], colour), filled_inside, end


def photo_fade_weight(scene: Scene, chart: int, end: BoolArray) -> Float32Array:
    """Compute the weight of a ground picture against the material, (h, w) float32 in 0..1.

    The picture fades over PHOTO_FADE_M, but not at the block's border or at a wall.

    Parameters
    ----------
    scene : the block's geometry and atlas layout.
    chart : row of the chart.
    end : (h + 2 m, w + 2 m) bool, texels without a picture, with a margin of m texels.
    """
    import cv2

    rows, columns = scene.placement.shape(chart)
    if not end.any():
        return np.ones((rows, columns), np.float32)
    margin = (end.shape[0] - rows) // 2
    distance = cv2.distanceTransform((~end).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    distance = distance[margin : margin + rows, margin : margin + columns]
    weight: Float32Array = np.clip(
        distance / max(1.0, PHOTO_FADE_M * float(scene.placement.texels_per_metre[chart])), 0, 1
    ).astype(np.float32)
    return weight


def _distant_colour(scene: Scene, materials: MaterialField, chart: int) -> UInt8Array:
    """Return the mean colour (3,) of a chart."""
    width, height = scene.charts.size[chart]
    middle = scene.charts.points(chart, np.array([width / 2]), np.array([height / 2]))
    colour: UInt8Array = materials.colour(np.array([chart]), middle, np.array([max(width, height)]))[0]
    return colour


def _level_to_surroundings(
    scene: Scene,
    chart: int,
    colour: UInt8Array,
    fixed: BoolArray,
    free: BoolArray,
    around: _Surroundings,
) -> UInt8Array:
    """Level the free texels (h, w) of a chart to the fixed ones and its surroundings."""
    read, neighbours, rank_limit, decay_m = around
    density, size = float(scene.placement.texels_per_metre[chart]), (fixed.shape[0], fixed.shape[1])
    reach = decay_m * density
    if not free.any():
        return colour
    if not any(piece in neighbours for piece in coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()):
        return level_seam_colours(colour, fixed, free, reach=reach)
    margin = round(LEVELLING_MARGIN_M * density)
    interior = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))
    unranked = np.zeros(size, np.uint8)  # the masks `fixed` and `free` decide inside the chart

    def read_current(piece: int, rows: slice, columns: slice) -> tuple[UInt8Array, UInt8Array]:
        return (colour[rows, columns], unranked[rows, columns]) if piece == chart else read(piece, rows, columns)

    wide, rank = read_chart_with_surroundings(
        scene.charts, scene.placement.texels_per_metre, chart, size, margin, read_current
    )
    pinned, loose = rank > rank_limit, np.zeros(rank.shape, bool)
    pinned[interior], loose[interior] = fixed, free
    return level_seam_colours(wide, pinned, loose, reach=reach)[interior]
