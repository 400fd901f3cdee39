"""Charts finished at their texels: what facades and streets know of them, and what they are made of where nobody saw them."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from facade_core.atlas.surroundings import ChartReader, coplanar_pieces, read_with_surroundings
from facade_core.core.levelling import LEVELLED_M, LEVELLED_REACHES, level_seam
from facade_core.core.provenance import Provenance
from facade_core.core.types import Sun
from facade_core.geometry.chart_packing import Placement
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.overhead_view import Aerial, from_above
from facade_core.geometry.party_walls import enclosed
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.contact_shadow import contact_light
from facade_core.street.lighting.facade_light import relight_facade
from facade_core.street.lighting.sun import apply_sunlight, sunlight_share
from facade_core.street.materials.example_fill import MAX_FILL_M, fill_by_example
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.translator.translators import pixel_footprint

# Metres around a chart that its levelling depends on.
LEVELLING_MARGIN_M = LEVELLED_M * LEVELLED_REACHES
# A picture of the ground fades into the material over so much, metres.
PHOTO_FADE_M = 1.0
# Texels whose grain is worked out together: what each takes is many times its colour.
DETAIL_BATCH_TEXELS = 1 << 18


class KnownTexture(NamedTuple):
    """What facades and streets know: `read`, of any chart, UNSEEN elsewhere; the charts that facades or textures seeded, those
    that streets wrote, and those of the seeded that are walls and roofs as cameras show them, at least of the chart that is
    asked for and of those beside it."""

    read: ChartReader
    seeded: Collection[int]
    written: Collection[int]
    pictured: Collection[int] = ()


class TranslatedViews(NamedTuple):
    """Of translated panorama pictures, `width` pixels wide, from `positions` (v, 3)."""

    positions: np.ndarray
    width: int


def paint_visible_texels(buffer: TexelBuffer, placement: Placement, materials: MaterialField) -> None:
    """Give the bare texels of a window that a view saw what they are made of, in place, each once (street paper, 3 Texture
    propagation, of a translator that answers with a field)."""
    for chart in buffer.writable.tolist():
        texels = buffer.rasters.slice(placement, chart)
        bare = np.flatnonzero((buffer.state.views[texels] > 0) & (buffer.provenance[texels] == Provenance.UNSEEN))
        if len(bare):
            rows, columns = np.divmod(bare, int(placement.width[chart]))
            buffer.colour[texels][bare] = materials.texels(chart, rows, columns)
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
    aerial: Aerial | None = None,
    sun: Sun | None = None,
    labels: np.ndarray | None = None,
    repaint: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """A whole chart: colour (h, w, 3) uint8 and provenance (h, w) uint8, of which none is UNSEEN.

    What nobody can ever see of a wall takes one colour, which costs nothing to keep. Where walls stand on the ground what is
    painted beside the line is darker; with a `sun` all is in its light and its shadows, those too of what stands out and lies
    back by a facade's `labels` (h, w), where it is no picture of that very facade.

    Bare texels take their material, bare ground under the free sky the `aerial` picture. With `levelling` what is painted is
    levelled to what was seen of the same surface, on its own chart or beside it, and both together to what pictures show; on
    the ground what pictures show fades instead.
    network: whether streets were translated by the network, whose colours are not those of the materials; pixels: of what, so
    that what is finer than they are is added from the material; anew: streets painted this chart with other materials than
    these, so that theirs is painted over.
    """
    colour, provenance = _finish_unlit(scene, materials, chart, known, is_neural, views, levelling, aerial, repaint)
    left = contact_light(scene, chart)
    if left is not None:
        darker = (provenance <= Provenance.TRANSLATED) & (left < 1)
        colour[darker] = (colour[darker] * left[darker][:, None] + 0.5).astype(np.uint8)
    if sun is not None:
        light, made = sunlight_share(scene, chart, sun), provenance == Provenance.SYNTHESISED
        if labels is not None and made.any():
            colour = relight_facade(scene, chart, sun, colour, made, labels, light, materials.field.seed)
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
    aerial: Aerial | None,
    repaint: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """As `surface`, before the light at feet and of the sun."""
    height, width = int(scene.placement.height[chart]), int(scene.placement.width[chart])
    colour, provenance = (values.copy() for values in known.read(chart, slice(0, height), slice(0, width)))
    bare = provenance == Provenance.UNSEEN
    shut = np.zeros_like(bare)
    if bare.any():
        shut = bare & enclosed(scene, chart)
        open_ = bare & ~shut
        painted = materials.raster(chart) if open_.all() else materials.texels(chart, *np.nonzero(open_))
        colour[open_] = painted.reshape(-1, 3)
        colour[shut] = _distant_colour(scene, materials, chart)
        provenance[bare] = Provenance.MATERIAL
        if aerial is not None and scene.charts.kind[chart] == ChartKind.GROUND:
            rgb, shown = from_above(scene, chart, aerial)
            shown &= bare
            colour[shown], provenance[shown] = rgb[shown], Provenance.PHOTO
    if repaint and not is_neural:
        rows, columns = np.nonzero(provenance == Provenance.TRANSLATED)
        colour[rows, columns] = materials.texels(chart, rows, columns)
    if views is not None:
        seen = np.flatnonzero(provenance == Provenance.TRANSLATED)
        for some in np.array_split(seen, -(-len(seen) // DETAIL_BATCH_TEXELS) or 1):
            rows, columns = np.divmod(some, width)
            grain = materials.detail(chart, rows, columns, _smallest_footprint(scene, chart, rows, columns, views))
            colour[rows, columns] = np.clip(colour[rows, columns] + grain, 0, 255)
    if not levelling:
        return colour, provenance
    foreign = bare & (provenance == Provenance.PHOTO) if not is_neural else bare
    if foreign.any():
        beside = {*known.seeded, *known.written}
        colour = _level_to_surroundings(scene, chart, colour, ~bare, foreign, known.read, beside, Provenance.UNSEEN)
    guessed = bare | (provenance <= Provenance.TRANSLATED)
    if scene.charts.kind[chart] != ChartKind.GROUND:
        around = {chart, *coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()}
        if not around.isdisjoint(known.pictured):
            # a wall is one thing all over, so that pictures of it go on as far as they may
            colour, filled, _ = _extend_photos(scene, None, chart, colour, guessed & ~shut, known, np.inf)
            provenance[filled] = Provenance.INPAINTED
            return _level_to_surroundings(
                scene,
                chart,
                colour,
                ~guessed | filled,
                guessed & ~filled,
                known.read,
                known.seeded,
                Provenance.TRANSLATED,
                np.inf,
            ), provenance
        return _level_to_surroundings(
            scene, chart, colour, ~guessed, guessed, known.read, known.seeded, Provenance.TRANSLATED
        ), provenance
    # a picture of the ground says nothing of ground far from it, which is not levelled to it: the picture goes on by example a
    # little way and then fades into the material. Beside a picture from above it ends nowhere: what readers know of the next
    # piece does not have that picture yet
    near = {chart, *coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()} if aerial is None else {chart}
    if near.isdisjoint(known.seeded):
        return colour, provenance
    pictured, end = ~guessed, provenance != Provenance.PHOTO
    if aerial is None:
        colour, filled, end = _extend_photos(scene, materials, chart, colour, guessed, known, MAX_FILL_M)
        provenance[filled] = Provenance.INPAINTED
        pictured |= filled
    share = photo_fade_weight(scene, chart, end)
    mixed = (share < 1) & pictured
    part, painted = share[mixed][:, None], materials.texels(chart, *np.nonzero(mixed))
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
    """Pictures go on by example where a piece's texels are free (h, w) bool, `reach` metres at most: its colour, where they do,
    and, of the piece with LEVELLING_MARGIN_M around it, where no picture is nor goes on. materials: of which the kinds of ground are; all
    of a wall or a roof is of one kind."""
    density, size = float(scene.placement.texels_per_metre[chart]), (free.shape[0], free.shape[1])
    margin = round(LEVELLING_MARGIN_M * density)
    own = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))

    def from_one(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        shown, rank = known.read(one, rows, columns)
        return shown, rank + 1  # 0 is where no piece is

    wide, rank = read_with_surroundings(scene.charts, scene.placement.texels_per_metre, chart, size, margin, from_one)
    pictured, there = rank == Provenance.PHOTO + 1, rank > 0
    there[own] &= free
    kinds = np.zeros(rank.shape, np.uint8) if materials is None else materials.kinds(chart, margin)
    made, filled = fill_by_example(wide, pictured, there, kinds, density, max_distance_m)
    end = (rank > 0) & ~pictured & ~filled
    found = filled[own]
    return np.where(found[..., None], made[own], colour), found, end


def photo_fade_weight(scene: Scene, chart: int, end: np.ndarray) -> np.ndarray:
    """How much of a picture of the ground counts (h, w) float32: it fades into the material over PHOTO_FADE_M to the texels `end`
    (h + 2 m, w + 2 m) bool of the piece and m around it, but not to the block's border, nor to a wall."""
    import cv2

    rows, columns = int(scene.placement.height[chart]), int(scene.placement.width[chart])
    if not end.any():
        return np.ones((rows, columns), np.float32)
    margin = (end.shape[0] - rows) // 2
    away = cv2.distanceTransform((~end).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    away = away[margin : margin + rows, margin : margin + columns]
    return np.clip(away / max(1.0, PHOTO_FADE_M * float(scene.placement.texels_per_metre[chart])), 0, 1).astype(np.float32)


def _distant_colour(scene: Scene, materials: MaterialField, chart: int) -> np.ndarray:
    """The colour (3,) of a chart seen from far."""
    width, height = scene.charts.size[chart]
    middle = scene.charts.points(chart, np.array([width / 2]), np.array([height / 2]))
    return materials.colour(np.array([chart]), middle, np.array([max(width, height)]))[0]


def _smallest_footprint(scene: Scene, chart: int, rows: np.ndarray, columns: np.ndarray, views: TranslatedViews) -> np.ndarray:
    """What the finest of the pixels covers of texels (k,) of a chart: the side of a square as large, metres, (k,)."""
    step = 1 / scene.placement.texels_per_metre[chart]
    points = scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
    normal, finest = scene.charts.normal()[chart], np.full(len(points), np.inf)
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
    decay_m: float = LEVELLED_M,
) -> np.ndarray:
    """A chart's colour (h, w, 3) with its texels `free` (h, w) levelled to those `fixed`, and to what is known of the charts
    `beside` it in a rank over `above`; a third of the offset is left after `over` metres."""
    density, size = float(scene.placement.texels_per_metre[chart]), (fixed.shape[0], fixed.shape[1])
    reach = decay_m * density
    if not free.any():
        return colour
    if not any(one in neighbours for one in coplanar_pieces(scene.charts, chart, LEVELLING_MARGIN_M).tolist()):
        return level_seam(colour, fixed, free, reach=reach)
    margin = round(LEVELLING_MARGIN_M * density)
    own = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))
    unranked = np.zeros(size, np.uint8)  # `fixed` and `free` say of the chart itself what counts

    def with_own(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        return (colour[rows, columns], unranked[rows, columns]) if one == chart else read(one, rows, columns)

    wide, rank = read_with_surroundings(scene.charts, scene.placement.texels_per_metre, chart, size, margin, with_own)
    pinned, loose = rank > min_rank, np.zeros(rank.shape, bool)
    pinned[own], loose[own] = fixed, free
    return level_seam(wide, pinned, loose, reach=reach)[own]
