"""Complete charts: texture from facades and streets, materials where no view shows the surface."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from facade_core.atlas.surroundings import ChartReader, coplanar_pieces, read_with_surroundings
from facade_core.core.levelling import MAX_SEAM_DECAYS, SEAM_DECAY_M, level_seam
from facade_core.core.provenance import Provenance
from facade_core.core.types import Sun
from facade_core.geometry.chart_packing import Placement
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.overhead_view import AerialSampler, render_from_above
from facade_core.geometry.party_walls import enclosed_texels
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.contact_shadow import contact_light
from facade_core.street.lighting.facade_light import relight_facade
from facade_core.street.lighting.sun import apply_sunlight, sunlight_share
from facade_core.street.materials.example_fill import MAX_FILL_M, fill_by_example
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.translator.translators import pixel_footprint

# Margin around a chart that its levelling depends on.
LEVELLING_MARGIN_M = SEAM_DECAY_M * MAX_SEAM_DECAYS
# Distance over which a ground picture fades into the material.
PHOTO_FADE_M = 1.0
# Texels per batch of detail, which needs many times the memory of the colours.
DETAIL_BATCH_TEXELS = 1 << 18


class KnownTexture(NamedTuple):
    """Texture from facades and streets.

    Attributes
    ----------
    read : reads part of any chart; provenance UNSEEN where nothing is known.
    base_charts : charts with a base layer from facades or textures.
    street_charts : charts that streets wrote.
    photo_charts : walls and roofs of `base_charts` that show camera pictures; at least the asked chart and its
        neighbours.
    """

    read: ChartReader
    base_charts: Collection[int]
    street_charts: Collection[int]
    photo_charts: Collection[int] = ()


class TranslatedViews(NamedTuple):
    """Viewpoints of translated panoramas.

    Attributes
    ----------
    positions : (v, 3) centres of the panoramas, metres.
    width : width of the panoramas, pixels.
    """

    positions: np.ndarray
    width: int


def paint_visible_texels(buffer: TexelBuffer, placement: Placement, materials: MaterialField) -> None:
    """Paint the material of every untextured texel that a view saw, in place.

    For translators that return a material field (street paper, 3 Texture propagation).
    """
    for chart in buffer.writable.tolist():
        texels = buffer.layout.texel_slice(placement, chart)
        bare = np.flatnonzero((buffer.state.views[texels] > 0) & (buffer.provenance[texels] == Provenance.UNSEEN))
        if len(bare):
            rows, columns = np.divmod(bare, int(placement.width[chart]))
            buffer.colour[texels][bare] = materials.texel_colours(chart, rows, columns)
            buffer.provenance[texels][bare] = Provenance.TRANSLATED


def finish_chart(
    scene: Scene,
    materials: MaterialField,
    chart: int,
    known: KnownTexture,
    *,
    is_neural: bool,
    views: TranslatedViews | None = None,
    levelling: bool = True,
    aerial: AerialSampler | None = None,
    sun: Sun | None = None,
    labels: np.ndarray | None = None,
    repaint: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the final colour and provenance of a chart.

    Untextured texels get their material; untextured ground under the open sky gets the aerial picture. Hidden parts of
    a wall get one colour, which compresses to nothing. Walls and ground darken near their contact line. With a sun the
    chart gets its light and shadows. Labels add the shadows of a facade's relief, except on pictures of that facade.

    Parameters
    ----------
    scene : the block's geometry and atlas layout.
    materials : material field of the block.
    chart : row of the chart.
    known : texture from facades and streets.
    is_neural : the network translated the streets, so that their colours differ from the materials.
    views : views whose pixels are coarser than texels; finer detail is added from the material.
    levelling : level generated texels to seen ones of the same surface, and both to pictures. Pictures of ground fade
        instead.
    aerial : picture from above.
    sun : position of the sun, None for soft daylight only.
    labels : (h, w) class id of the facade on this chart.
    repaint : streets painted this chart with other materials; replaces theirs.

    Returns
    -------
    Colour (h, w, 3) uint8 and provenance (h, w) uint8 without UNSEEN.
    """
    colour, provenance = _finish_unlit(scene, materials, chart, known, is_neural, views, levelling, aerial, repaint)
    left = contact_light(scene, chart)
    if left is not None:
        darker = (provenance <= Provenance.TRANSLATED) & (left < 1)
        colour[darker] = (colour[darker] * left[darker][:, None] + 0.5).astype(np.uint8)
    if sun is not None:
        light, made = sunlight_share(scene, chart, sun), provenance == Provenance.SYNTHESISED
        if labels is not None and made.any():
            colour = relight_facade(scene, chart, sun, colour, made, labels, light, materials.arrays.seed)
        else:
            colour = apply_sunlight(colour, light)
    return colour, provenance


def _finish_unlit(
    scene: Scene,
    materials: MaterialField,
    chart: int,
    known: KnownTexture,
    is_neural: bool,
    views: TranslatedViews | None,
    levelling: bool,
    aerial: AerialSampler | None,
    repaint: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute `finish_chart` without contact shading and sunlight."""
    height, width = int(scene.placement.height[chart]), int(scene.placement.width[chart])
    colour, provenance = (values.copy() for values in known.read(chart, slice(0, height), slice(0, width)))
    bare = provenance == Provenance.UNSEEN
    shut = np.zeros_like(bare)
    if bare.any():
        shut = bare & enclosed_texels(scene, chart)
        open_ = bare & ~shut
        painted = materials.chart_raster(chart) if open_.all() else materials.texel_colours(chart, *np.nonzero(open_))
        colour[open_] = painted.reshape(-1, 3)
        colour[shut] = _distant_colour(scene, materials, chart)
        provenance[bare] = Provenance.MATERIAL
        if aerial is not None and scene.charts.kind[chart] == ChartKind.GROUND:
            rgb, shown = render_from_above(scene, chart, aerial)
            shown &= bare
            colour[shown], provenance[shown] = rgb[shown], Provenance.PHOTO
    if repaint and not is_neural:
        rows, columns = np.nonzero(provenance == Provenance.TRANSLATED)
        colour[rows, columns] = materials.texel_colours(chart, rows, columns)
    if views is not None:
        seen = np.flatnonzero(provenance == Provenance.TRANSLATED)
        for some in np.array_split(seen, -(-len(seen) // DETAIL_BATCH_TEXELS) or 1):
            rows, columns = np.divmod(some, width)
            grain = materials.fine_detail(chart, rows, columns, _smallest_footprint(scene, chart, rows, columns, views))
            colour[rows, columns] = np.clip(colour[rows, columns] + grain, 0, 255)
    if not levelling:
        return colour, provenance
    foreign = bare & (provenance == Provenance.PHOTO) if not is_neural else bare
    if foreign.any():
        beside = {*known.base_charts, *known.street_charts}
        colour = _level_to_surroundings(scene, chart, colour, ~bare, foreign, known.read, beside, Provenance.UNSEEN)
    guessed = bare | (provenance <= Provenance.TRANSLATED)
    if scene.charts.kind[chart] != ChartKind.GROUND:
        around = {chart, *coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()}
        if not around.isdisjoint(known.photo_charts):
            # a wall is one material, so that its pictures extend without limit
            colour, filled, _ = _extend_photos(scene, None, chart, colour, guessed & ~shut, known, np.inf)
            provenance[filled] = Provenance.INPAINTED
            return _level_to_surroundings(
                scene,
                chart,
                colour,
                ~guessed | filled,
                guessed & ~filled,
                known.read,
                known.base_charts,
                Provenance.TRANSLATED,
                np.inf,
            ), provenance
        return _level_to_surroundings(
            scene, chart, colour, ~guessed, guessed, known.read, known.base_charts, Provenance.TRANSLATED
        ), provenance
    # A ground picture says nothing about distant ground, so that is not levelled to it: the picture extends a little by
    # example and then fades into the material. With an aerial picture it does not end at a piece's border: the
    # neighbours' data do not contain the aerial picture yet.
    near = {chart, *coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()} if aerial is None else {chart}
    if near.isdisjoint(known.base_charts):
        return colour, provenance
    pictured, end = ~guessed, provenance != Provenance.PHOTO
    if aerial is None:
        colour, filled, end = _extend_photos(scene, materials, chart, colour, guessed, known, MAX_FILL_M)
        provenance[filled] = Provenance.INPAINTED
        pictured |= filled
    share = photo_fade_weight(scene, chart, end)
    mixed = (share < 1) & pictured
    part, painted = share[mixed][:, None], materials.texel_colours(chart, *np.nonzero(mixed))
    colour[mixed] = (part * colour[mixed] + (1 - part) * painted + 0.5).astype(np.uint8)
    return colour, provenance


def _extend_photos(
    scene: Scene,
    materials: MaterialField | None,
    chart: int,
    colour: np.ndarray,
    free: np.ndarray,
    known: KnownTexture,
    max_distance_m: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Extend pictures by example into free texels, up to `max_distance_m`.

    Returns the colour (h, w, 3), the filled texels (h, w), and texels without picture of the chart with
    LEVELLING_MARGIN_M around it. `materials` gives the kinds of ground; None treats the surface as one kind.
    """
    density, size = float(scene.placement.texels_per_metre[chart]), (free.shape[0], free.shape[1])
    margin = round(LEVELLING_MARGIN_M * density)
    own = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))

    def from_one(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        shown, rank = known.read(one, rows, columns)
        return shown, rank + 1  # 0 is outside all pieces

    wide, rank = read_with_surroundings(scene.charts, scene.placement.texels_per_metre, chart, size, margin, from_one)
    pictured, there = rank == Provenance.PHOTO + 1, rank > 0
    there[own] &= free
    kinds = np.zeros(rank.shape, np.uint8) if materials is None else materials.ground_kinds(chart, margin)
    made, filled = fill_by_example(wide, pictured, there, kinds, density, max_distance_m)
    end = (rank > 0) & ~pictured & ~filled
    found = filled[own]
    return np.where(found[..., None], made[own], colour), found, end


def photo_fade_weight(scene: Scene, chart: int, end: np.ndarray) -> np.ndarray:
    """Compute the weight of a ground picture against the material, (h, w) float32 in 0..1.

    The picture fades over PHOTO_FADE_M, but not at the block's border or at a wall.

    Parameters
    ----------
    scene : the block's geometry and atlas layout.
    chart : row of the chart.
    end : (h + 2 m, w + 2 m) bool, texels without a picture, with a margin of m texels.
    """
    import cv2

    rows, columns = int(scene.placement.height[chart]), int(scene.placement.width[chart])
    if not end.any():
        return np.ones((rows, columns), np.float32)
    margin = (end.shape[0] - rows) // 2
    away = cv2.distanceTransform((~end).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    away = away[margin : margin + rows, margin : margin + columns]
    return np.clip(away / max(1.0, PHOTO_FADE_M * float(scene.placement.texels_per_metre[chart])), 0, 1).astype(
        np.float32
    )


def _distant_colour(scene: Scene, materials: MaterialField, chart: int) -> np.ndarray:
    """Return the mean colour (3,) of a chart."""
    width, height = scene.charts.size[chart]
    middle = scene.charts.points(chart, np.array([width / 2]), np.array([height / 2]))
    return materials.colour(np.array([chart]), middle, np.array([max(width, height)]))[0]


def _smallest_footprint(
    scene: Scene, chart: int, rows: np.ndarray, columns: np.ndarray, views: TranslatedViews
) -> np.ndarray:
    """Return the smallest footprint (k,) of the views' pixels on texels of a chart, metres."""
    step = 1 / scene.placement.texels_per_metre[chart]
    points = scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
    normal, finest = scene.charts.normals()[chart], np.full(len(points), np.inf)
    for position in views.positions:
        finest = np.minimum(finest, pixel_footprint(points - position, normal, views.width))
    return finest


def _level_to_surroundings(
    scene: Scene,
    chart: int,
    colour: np.ndarray,
    fixed: np.ndarray,
    free: np.ndarray,
    read: ChartReader,
    neighbours: Collection[int],
    min_rank: int,
    decay_m: float = SEAM_DECAY_M,
) -> np.ndarray:
    """Level the free texels (h, w) of a chart to the fixed ones and to texels of `neighbours` with a rank above
    `min_rank`.

    The offset decays to a third over `decay_m` metres.
    """
    density, size = float(scene.placement.texels_per_metre[chart]), (fixed.shape[0], fixed.shape[1])
    reach = decay_m * density
    if not free.any():
        return colour
    if not any(one in neighbours for one in coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()):
        return level_seam(colour, fixed, free, reach=reach)
    margin = round(LEVELLING_MARGIN_M * density)
    own = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))
    unranked = np.zeros(size, np.uint8)  # the masks `fixed` and `free` decide inside the chart

    def with_own(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        return (colour[rows, columns], unranked[rows, columns]) if one == chart else read(one, rows, columns)

    wide, rank = read_with_surroundings(scene.charts, scene.placement.texels_per_metre, chart, size, margin, with_own)
    pinned, loose = rank > min_rank, np.zeros(rank.shape, bool)
    pinned[own], loose[own] = fixed, free
    return level_seam(wide, pinned, loose, reach=reach)[own]
