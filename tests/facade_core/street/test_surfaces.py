"""Charts finished: nothing is left bare, what is known stays, and seams between the two go."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.provenance import Provenance
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.party_walls import find_enclosed_texels
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.settings import EXAMPLE_FILL
from facade_core.street.surfaces import (
    FinishSettings,
    KnownTexture,
    finish_chart,
    photo_fade_weight,
)

STREET = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))


@pytest.fixture(scope="module")
def scene() -> Scene:
    houses = [Building("a", shapely.box(0, 0, 20, 10), 12.0, "height")]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024))


@pytest.fixture(scope="module")
def materials(scene: Scene) -> MaterialField:
    return MaterialField(scene, [STREET], seed=1)


def ground(scene: Scene) -> int:
    """The largest piece."""
    own = np.flatnonzero(scene.charts.kind == ChartKind.GROUND)
    return int(own[np.argmax(scene.charts.size[own].prod(axis=1))])


def known(scene: Scene, chart: int, rank: np.ndarray, value: int) -> KnownTexture:
    """One chart of one colour where rank (h, w) says that it is known; others are bare."""

    def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        shape = scene.placement.shape(one)
        ranks = rank if one == chart else np.zeros(shape, np.uint8)
        colour = np.where(ranks[..., None] > Provenance.UNSEEN, np.uint8(value), np.zeros((*shape, 3), np.uint8))
        return colour[rows, columns], ranks[rows, columns]

    return KnownTexture(read, {chart})


def bare(scene: Scene, chart: int) -> np.ndarray:
    return np.zeros(scene.placement.shape(chart), np.uint8)


def test_a_chart_that_nobody_saw_is_its_material(scene: Scene, materials: MaterialField) -> None:
    for chart in range(len(scene.charts)):
        colour, provenance = finish_chart(scene, materials, chart, known(scene, -1, bare(scene, 0), 0))
        np.testing.assert_array_equal(colour, materials.chart_raster(chart))
        assert (provenance == Provenance.MATERIAL).all()


def test_a_photo_stays_and_what_is_painted_beside_it_meets_it(scene: Scene, materials: MaterialField) -> None:
    chart = int(np.flatnonzero((scene.charts.kind == ChartKind.WALL) & (scene.charts.size[:, 0] > 19))[0])
    rank = bare(scene, chart)
    rank[:, :40] = Provenance.PHOTO
    read = known(scene, chart, rank, 160)
    colour, provenance = finish_chart(scene, materials, chart, read)
    assert (colour[:, :40] == 160).all()
    assert (provenance[:, 40:] == Provenance.MATERIAL).all()
    plain, _ = finish_chart(scene, materials, chart, read, FinishSettings(levelling=False))
    np.testing.assert_array_equal(plain[:, 40:], materials.chart_raster(chart)[:, 40:])
    step = [abs(found[:, 40:46].astype(float).mean() - 160) for found in (plain, colour)]
    assert step[1] < 0.35 * step[0]
    far = slice(150, None)
    assert abs(colour[:, far].astype(float) - plain[:, far]).mean() < 2


def test_a_picture_of_the_ground_fades_to_where_none_is_but_not_to_the_border(scene: Scene) -> None:
    """FADE_M is ten texels; beyond the piece, to its left, none is either."""
    chart = ground(scene)
    end = np.pad(bare(scene, chart), 12).astype(bool)
    end[:, :12] = end[:, 52:] = True
    ramp = np.arange(1, 11) / 10
    share = photo_fade_weight(scene, chart, end)
    assert share[100, 30:41] == pytest.approx([*ramp[::-1], 0.0], abs=1e-6)
    assert share[100, :10] == pytest.approx(ramp)
    assert (share[:, 40:] == 0).all()
    assert (share[:, 10:30] == 1).all()
    # where nothing is known of what lies beside it, nothing ends at the piece's border
    alone = photo_fade_weight(scene, chart, end[12:-12, 12:-12])
    assert (alone[:, :30] == 1).all()
    assert (photo_fade_weight(scene, chart, np.zeros_like(end)) == 1).all()


def test_a_picture_of_the_ground_goes_on_by_example_and_fades_into_the_material(
    scene: Scene, materials: MaterialField
) -> None:
    """Stripes along the picture's border, with a hole: they go on through the hole and FILLED_M beyond the border, the last of
    which fades."""
    chart = ground(scene)
    density = float(scene.placement.texels_per_metre[chart])
    rank = bare(scene, chart)
    stripes = np.where(np.arange(len(rank)) // 8 % 2, 210, 90).astype(np.uint8)[:, None, None]
    rank[:, :120] = Provenance.PHOTO
    rank[60:80, 40:70] = Provenance.UNSEEN
    plain = known(scene, chart, rank, 1).read

    def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        colour, ranks = plain(one, rows, columns)
        return (colour * stripes[rows] if one == chart else colour), ranks

    colour, provenance = finish_chart(scene, materials, chart, KnownTexture(read, {chart}))
    hole = provenance[60:80, 40:70]
    assert (hole == Provenance.INPAINTED).all()
    assert np.abs(colour[60:80, 40:70].astype(float) - stripes[60:80]).mean() < 8
    last = 120 + round(EXAMPLE_FILL.max_fill_m * density)
    assert (provenance[20:-20, 120 : last - 2] == Provenance.INPAINTED).all()
    assert (provenance[:, last + 2 :] < Provenance.INPAINTED).all()
    painted = materials.chart_raster(chart)
    np.testing.assert_array_equal(colour[:, last + 2 :], painted[:, last + 2 :])
    edge = np.abs(colour[20:-20, last - 3].astype(float) - painted[20:-20, last - 3]).mean()
    assert edge < 0.5 * np.abs(stripes[20:-20, 0].astype(float) - painted[20:-20, last - 3]).mean()


def test_what_is_painted_meets_a_photo_on_the_piece_beside_it() -> None:
    """A wall in two pieces: one is a photo, the other bare."""
    houses = [Building("a", shapely.box(0, 0, 40, 10), 12.0, "height")]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=20, largest=20.1, grid=20
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024), names=("a",))
    materials = MaterialField(scene, [STREET], seed=1)
    front = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.normals()[:, 1] < -0.9))
    one, other = front[np.argsort(charts.origin[front, 0])].tolist()
    photo = np.full_like(bare(scene, one), Provenance.PHOTO)
    step = {}
    for levelling in (False, True):
        colour, _ = finish_chart(
            scene, materials, other, known(scene, one, photo, 120), FinishSettings(levelling=levelling)
        )
        step[levelling] = abs(colour[:, :6].astype(float).mean() - 120)
    assert step[True] < 0.35 * step[False]


def test_a_party_wall_takes_one_colour_where_its_neighbour_covers_it() -> None:
    """The taller of two houses that touch: grain above the lower one's roof, none behind it."""
    houses = [
        Building("tall", shapely.box(0, 0, 12, 10), 12.0, "height"),
        Building("low", shapely.box(12, 0, 24, 10), 6.0, "height"),
        Building("apart", shapely.box(25.5, 0, 30, 10), 9.0, "height"),
    ]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024), names=("tall", "low", "apart"))
    materials = MaterialField(scene, [STREET], seed=1)
    shut = np.array([find_enclosed_texels(scene, chart).mean() for chart in range(len(charts))])
    east = charts.normals()[:, 0]
    (party,) = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.building == 0) & (east > 0.9))
    (covered,) = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.building == 1) & (east < -0.9))
    assert shut[covered] == 1
    assert shut[party] == pytest.approx(0.5, abs=0.06)
    assert not np.delete(shut, [party, covered]).any()
    colour, provenance = finish_chart(scene, materials, int(party), known(scene, -1, bare(scene, 0), 0))
    assert (provenance == Provenance.MATERIAL).all()
    assert np.ptp(colour[70:].reshape(-1, 3), axis=0).max() == 0
    np.testing.assert_array_equal(colour[:55], materials.chart_raster(int(party))[:55])
