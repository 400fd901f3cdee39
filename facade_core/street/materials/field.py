"""Material field: the material of every chart as a function of the world point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, IntArray, UInt8Array
from facade_core.core.types import SURFACES, BuildingFinish, MappedGround, Street
from facade_core.facade.wall_material import WallMaterial
from facade_core.geometry.charts import ChartKind, raster_sizes
from facade_core.geometry.ground.carriageways import assume_street_ways
from facade_core.geometry.ground.layer_raster import rasterise_ground_layers
from facade_core.geometry.ground.shapes import GroundTiles
from facade_core.geometry.scene import Scene
from facade_core.street.materials import field_kernels as kernels
from facade_core.street.materials.field_kernels import (
    NO_OVERRIDE,
    ChartMaterials,
    MaterialFieldArrays,
    MaterialOverride,
    SurfaceMaterial,
)
from facade_core.street.materials.grain import GrainKind, GrainTables
from facade_core.street.materials.grain_file import load_shipped_grain_tables
from facade_core.street.materials.ground_kernels import LAYER_SURFACES
from facade_core.street.materials.pictured_ground import GroundPicture, learn_pictured_ground
from facade_core.street.materials.procedural import (
    BRICK_PALETTE,
    METAL_FIXTURE_PALETTE,
    PLASTER_PALETTE,
    SOFFIT_COLOUR,
    SURFACE_COLOURS,
    WOOD_PALETTE,
    GroundSurface,
)
from facade_core.street.materials.roofs import (
    FELT_PALETTE,
    ROOF_GRAVEL_PALETTE,
    ROOF_TILE_PALETTE,
    SHEET_METAL_PALETTE,
    SLATE_PALETTE,
)
from facade_core.street.materials.settings import MATERIAL_FIELD
from facade_core.street.materials.tiled_material import TiledMaterial
from facade_core.street.propagation.render import daylight_grey
from facade_core.street.propagation.sampling import DaylightGrids

# Values of OpenStreetMap's roof:material; others count as not stated.
ROOF_MATERIAL_TAGS = {
    SurfaceMaterial.SHEET_METAL: (
        "metal",
        "metal_sheet",
        "sheet_metal",
        "copper",
        "zinc",
        "tin",
        "steel",
        "aluminium",
        "iron",
        "lead",
    ),
    SurfaceMaterial.ROOF_TILE: ("roof_tiles", "tile", "tiles", "clay", "eternit", "concrete_tiles"),
    SurfaceMaterial.SLATE: ("slate", "stone"),
    SurfaceMaterial.FELT: (
        "tar_paper",
        "bitumen",
        "asphalt",
        "asphalt_shingle",
        "concrete",
        "roofing_felt",
        "plastic",
        "rubber",
    ),
    SurfaceMaterial.ROOF_GRAVEL: ("gravel", "grit", "pebbles"),
}
MATERIAL_GRAINS = {
    SurfaceMaterial.SHEET_METAL: GrainKind.METAL,
    SurfaceMaterial.ROOF_TILE: GrainKind.ROOF_TILES,
    SurfaceMaterial.SLATE: GrainKind.SLATE,
    SurfaceMaterial.FELT: GrainKind.ASPHALT,
    SurfaceMaterial.ROOF_GRAVEL: GrainKind.GRAVEL,
    SurfaceMaterial.PLASTER: GrainKind.PLASTER_FINE,
    SurfaceMaterial.BRICK: GrainKind.BRICKS,
    SurfaceMaterial.BOARDS: GrainKind.BOARDS,
    SurfaceMaterial.SOFFIT: GrainKind.PLASTER_FINE,
    SurfaceMaterial.METAL_FIXTURE: GrainKind.METAL,
}


class MaterialField:
    """Material of all charts as a function of the world point, independent of the viewpoint.

    Ground follows `ground`, or carriageways along the streets. Walls take their building's plaster, tilted roofs tiles
    along the slope. A roof material replaces that of all roofs except upright ones. A footprint is the side in metres
    of the square over which a colour is averaged; a texel's footprint is the texel.

    Attributes
    ----------
    arrays : inputs of the kernels.
    is_lit : colours hold a coarse skylight, as views of streets show it.
    """

    def __init__(
        self,
        scene: Scene,
        streets: Sequence[Street],
        *,
        seed: int,
        roof_material: TiledMaterial | None = None,
        ground: MappedGround | None = None,
        grains: GrainTables | None = None,
    ) -> None:
        """Build the field of a scene.

        Parameters
        ----------
        scene : the block's geometry.
        streets : centrelines, for carriageways without `ground`.
        seed : seed of all random draws.
        roof_material : material of all roofs.
        ground : ground surfaces from a map.
        grains : grain examples; None loads the shipped ones.
        """
        self._scene = scene
        self._ground = GroundTiles(ground or MappedGround(assume_street_ways(streets)), scene.charts)
        self._step = 1 / scene.placement.texels_per_metre
        self.is_lit = True
        grey = TiledMaterial(np.full((1, 1, 3), 128, np.float32), (1.0, 1.0))
        self.arrays = MaterialFieldArrays(
            _build_surfaces(scene, seed, has_roof_picture=roof_material is not None),
            NO_OVERRIDE,
            self._ground.build_arrays([]),
            (roof_material or grey).mip_levels,
            grains or load_shipped_grain_tables(),
            learn_pictured_ground([], len(SURFACE_COLOURS)),
            seed,
        )

    def with_facade_material(self, charts: Sequence[int], wall: WallMaterial, facade: int) -> MaterialField:
        """Return a copy in which the plaster walls of a building take a facade's wall material.

        Walls whose material or colour a source states are left out; the field itself is returned where none is left.

        Parameters
        ----------
        charts : charts of the building.
        wall : material that the facade shows.
        facade : chart of the facade.
        """
        surfaces = self.arrays.charts
        plaster_walls = np.array(charts)
        plaster_walls = plaster_walls[surfaces.material[plaster_walls] == SurfaceMaterial.PLASTER]
        if self._scene.finishes:
            finish = [self._scene.finishes[row] for row in self._scene.charts.building[plaster_walls].tolist()]
            plaster_walls = plaster_walls[
                [finish_row.wall_colour is None and finish_row.wall_material is None for finish_row in finish]
            ]
        if not len(plaster_walls):
            return self
        material, example = SurfaceMaterial.PLASTER, int(surfaces.grain[plaster_walls[0]])
        if wall.brick:
            material, example = SurfaceMaterial.BRICK, MATERIAL_GRAINS[SurfaceMaterial.BRICK]
        changed = copy(self)
        colour = wall.colour / surfaces.grey[facade]
        changed.arrays = self.arrays._replace(
            override=MaterialOverride(np.sort(plaster_walls).astype(np.int64), int(material), int(example), colour)
        )
        return changed

    def without_light(self) -> MaterialField:
        """Return a copy whose colours hold no light: as in typical light."""
        changed = copy(self)
        surfaces = self.arrays.charts
        grey = np.full_like(surfaces.grey, MATERIAL_FIELD.typical_grey)
        tint = surfaces.tint * (grey / surfaces.grey)[:, None]
        changed.arrays = self.arrays._replace(charts=surfaces._replace(grey=grey, tint=tint))
        changed.is_lit = False
        return changed

    @property
    def reflectance(self) -> Float64Array:
        """Return the shares of light that the charts reflect, (charts, 3)."""
        surfaces = self.arrays.charts
        colour = np.clip(surfaces.tint / surfaces.grey[:, None] / 255, 0, 1) ** 2
        colour[colour.max(axis=1) < 0.01] = MATERIAL_FIELD.surface_albedo  # no colour of its own
        colour[surfaces.material == SurfaceMaterial.GROUND] = MATERIAL_FIELD.ground_albedo
        return colour

    def with_pictured_ground(self, shown: Mapping[int, tuple[UInt8Array, BoolArray]]) -> MaterialField:
        """Return a copy in which ground of each surface looks as pictures show it.

        Parameters
        ----------
        shown : by ground chart its colours (h, w, 3) and which texels (h, w) pictures show.
        """
        density = self._scene.placement.texels_per_metre
        pictures = [
            GroundPicture(rgb, is_seen, self._ground_surfaces(chart), float(density[chart]))
            for chart, (rgb, is_seen) in shown.items()
        ]
        changed = copy(self)
        changed.arrays = self.arrays._replace(pictured=learn_pictured_ground(pictures, len(SURFACE_COLOURS)))
        return changed

    def colour(self, chart: IntArray, points: Float64Array, footprint: Float64Array) -> UInt8Array:
        """Compute the shaded material of world points.

        Parameters
        ----------
        chart : (n,) chart rows.
        points : (n, 3) world points, metres.
        footprint : (n,) footprints, metres.

        Returns
        -------
        (n, 3) uint8.
        """
        out = np.empty((len(chart), 3), np.uint8)
        order, rows = np.argsort(chart, kind="stable"), chart.astype(np.int64, copy=False)
        kernels.compute_point_colours(order, rows, points, footprint, *self._kernel_arguments(np.unique(chart)), out)
        return out

    def texel_colours(self, chart: int, rows: Int64Array, columns: Int64Array) -> UInt8Array:
        """Compute the material at the centres of texels of a chart.

        Parameters
        ----------
        chart : row of the chart.
        rows, columns : (k,) texels.

        Returns
        -------
        (k, 3) uint8.
        """
        out = np.empty((len(rows), 3), np.uint8)
        for start in range(0, len(rows), MATERIAL_FIELD.paint_batch_texels):
            batch = slice(start, start + MATERIAL_FIELD.paint_batch_texels)
            self._paint_texels(chart, rows[batch], columns[batch], out[batch])
        return out

    def chart_raster(self, chart: int) -> UInt8Array:
        """Compute the material of a whole chart, (h, w, 3) uint8."""
        placement = self._scene.placement
        out = np.empty((*placement.shape(chart), 3), np.uint8)
        flat = out.reshape(-1, 3)
        for start in range(0, len(flat), MATERIAL_FIELD.paint_batch_texels):
            part = flat[start : start + MATERIAL_FIELD.paint_batch_texels]
            rows, columns = np.divmod(np.arange(start, start + len(part)), out.shape[1])
            self._paint_texels(chart, rows, columns, part)
        return out

    def ground_kinds(self, chart: int, margin: int, texels_per_metre: float | None = None) -> UInt8Array:
        """Return the kinds of ground on a chart and `margin` texels around it.

        Parameters
        ----------
        texels_per_metre : another density than that of the chart.

        Returns
        -------
        (h + 2 margin, w + 2 margin) uint8.
        """
        charts = self._scene.charts
        density = texels_per_metre or float(self._scene.placement.texels_per_metre[chart])
        width, height = raster_sizes(charts.size[chart], density).tolist()
        tile = self._ground.tile_around(chart)
        return rasterise_ground_layers(charts, chart, tile, density, (height, width), margin)

    def _ground_surfaces(self, chart: int) -> UInt8Array:
        """Return the surface of each texel (h, w) of a ground chart by the map, one that none has where roads differ."""
        roads = {way.surface for way in self._ground.tile_around(chart).ways if way.kind == "road"}
        carriageway = SURFACES.index(roads.pop()) if len(roads) == 1 else len(SURFACE_COLOURS)
        surfaces = np.array([GroundSurface.GRAVEL, *LAYER_SURFACES[:-1], carriageway], np.uint8)
        return surfaces[self.ground_kinds(chart, 0)]

    def _paint_texels(self, chart: int, rows: Int64Array, columns: Int64Array, out: UInt8Array) -> None:
        """Paint texels (k,) of a chart.

        Uses the kernel of `colour`: a second caller of its parts would duplicate the compilation.
        """
        step, count = float(self._step[chart]), len(rows)
        points = self._scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
        every = np.arange(count), np.full(count, chart), points, np.full(count, step)
        kernels.compute_point_colours(*every, *self._kernel_arguments([chart]), out)

    def _kernel_arguments(self, charts: Sequence[int] | IntArray) -> tuple[MaterialFieldArrays, DaylightGrids]:
        """Return the arrays and the light for some charts."""
        if not self.is_lit:
            count = np.full(len(self._scene.charts), 2)
            lights = DaylightGrids(np.zeros_like(count), count, count, np.ones(4, np.float32))
            return self.arrays._replace(ground=self._ground.build_arrays(charts)), lights
        daylight = self._scene.daylight
        daylight.compute(charts)
        lights = DaylightGrids(daylight.start, daylight.columns, daylight.rows, daylight.light)
        return self.arrays._replace(ground=self._ground.build_arrays(charts)), lights


def _build_surfaces(scene: Scene, seed: int, *, has_roof_picture: bool) -> ChartMaterials:
    charts, mesh = scene.charts, scene.mesh
    vertex_chart = mesh.vertex_chart
    wall = charts.kind[vertex_chart] == ChartKind.WALL
    # lowest wall point of each building
    foot = np.full(max(1, int(charts.building.max(initial=-1)) + 1), np.inf)
    np.minimum.at(foot, charts.building[vertex_chart[wall]], mesh.vertices[wall, 2])
    normal = charts.normals()
    chart_material = np.array(
        [
            SurfaceMaterial.PLASTER,
            SurfaceMaterial.ROOF_TILE,
            SurfaceMaterial.GROUND,
            SurfaceMaterial.GLASS,
            SurfaceMaterial.BOARDS,
            SurfaceMaterial.SOFFIT,
            SurfaceMaterial.METAL_FIXTURE,
        ],
        np.uint8,
    )[charts.kind]
    roof = charts.kind == ChartKind.ROOF
    # aerial models have steps between roofs as steep roofs, which carry no tiles
    steep = roof & (np.abs(normal[:, 2]) < MATERIAL_FIELD.max_wall_cosine)
    chart_material[steep] = SurfaceMaterial.PLASTER
    roof &= ~steep
    number = scene.building_hashes[charts.building]
    chart_material[roof & (normal[:, 2] > MATERIAL_FIELD.max_tiled_cosine)] = SurfaceMaterial.SHEET_METAL
    level, draw = (
        roof & (normal[:, 2] > MATERIAL_FIELD.max_sheet_metal_cosine),
        kernels.hash_uniform_array(number, seed + 83),
    )
    chart_material[level & (draw < MATERIAL_FIELD.flat_felt_share + MATERIAL_FIELD.flat_gravel_share)] = (
        SurfaceMaterial.ROOF_GRAVEL
    )
    chart_material[level & (draw < MATERIAL_FIELD.flat_felt_share)] = SurfaceMaterial.FELT
    if has_roof_picture:
        chart_material[roof] = SurfaceMaterial.ROOF_PICTURE
    if scene.finishes:
        bricks = np.array([finish.wall_material == "brick" for finish in scene.finishes])
        chart_material[(chart_material == SurfaceMaterial.PLASTER) & bricks[charts.building]] = SurfaceMaterial.BRICK
        stated_roof = np.array([_stated_roof_material(finish) for finish in scene.finishes])[charts.building]
        known = roof & (chart_material != SurfaceMaterial.ROOF_PICTURE) & (charts.building >= 0) & (stated_roof >= 0)
        chart_material[known] = stated_roof[known]
    grey = daylight_grey(normal)
    tint = np.ones((len(charts), 3))
    palettes = (
        (SurfaceMaterial.SHEET_METAL, SHEET_METAL_PALETTE, 5),
        (SurfaceMaterial.ROOF_TILE, ROOF_TILE_PALETTE, 19),
        (SurfaceMaterial.SLATE, SLATE_PALETTE, 19),
        (SurfaceMaterial.FELT, FELT_PALETTE, 5),
        (SurfaceMaterial.ROOF_GRAVEL, ROOF_GRAVEL_PALETTE, 5),
        (SurfaceMaterial.PLASTER, PLASTER_PALETTE, 9),
        (SurfaceMaterial.BRICK, BRICK_PALETTE, 9),
        (SurfaceMaterial.BOARDS, WOOD_PALETTE, 37),
        (SurfaceMaterial.METAL_FIXTURE, METAL_FIXTURE_PALETTE, 113),
    )
    for material, palette, turn in palettes:
        chosen = chart_material == material
        tint[chosen] = kernels.pick_palette_colours(palette, number[chosen], seed + turn)
    tint[chart_material == SurfaceMaterial.SOFFIT] = SOFFIT_COLOUR
    if scene.finishes:
        unknown = (np.nan, np.nan, np.nan)
        stated = np.array([(finish.wall_colour or unknown, finish.roof_colour or unknown) for finish in scene.finishes])
        for part, materials in (
            (0, (SurfaceMaterial.PLASTER, SurfaceMaterial.BRICK)),
            (
                1,
                (
                    SurfaceMaterial.SHEET_METAL,
                    SurfaceMaterial.ROOF_TILE,
                    SurfaceMaterial.SLATE,
                    SurfaceMaterial.FELT,
                    SurfaceMaterial.ROOF_GRAVEL,
                ),
            ),
        ):
            colour = np.where(charts.building[:, None] >= 0, stated[charts.building, part], np.nan)
            known = np.isin(chart_material, materials) & np.isfinite(colour[:, 0])
            tint[known] = colour[known]
    start = np.column_stack([np.einsum("ij,ij->i", charts.origin, axis) for axis in (charts.axis_u, charts.axis_v)])
    start[np.isin(charts.kind, (ChartKind.WINDOW, ChartKind.DOOR))] = 0.0
    frames = (charts.origin, charts.axis_u, charts.axis_v, charts.size)
    # sky above the horizon
    sky = np.maximum(0.5 + 0.5 * normal[:, 2], MATERIAL_FIELD.min_open_sky)
    examples = np.zeros(len(charts), np.int64)
    for material, example in MATERIAL_GRAINS.items():
        examples[chart_material == material] = example
    rendered = (chart_material == SurfaceMaterial.PLASTER) & (
        kernels.hash_uniform_array(number, seed + 73) < MATERIAL_FIELD.rough_plaster_share
    )
    examples[rendered] = GrainKind.PLASTER_ROUGH
    mossy = np.where(
        normal[:, 1] > MATERIAL_FIELD.min_north_cosine,
        MATERIAL_FIELD.max_moss_share * kernels.hash_uniform_array(number, seed + 79),
        0.0,
    )
    return ChartMaterials(
        *frames, start, chart_material, tint * grey[:, None], grey, foot[charts.building], sky, examples, mossy
    )


def _stated_roof_material(finish: BuildingFinish) -> int:
    """Return the stated material of a roof, -1 if none is stated.

    A colour that no tile has means sheet metal.
    """
    for material, names in ROOF_MATERIAL_TAGS.items():
        if finish.roof_material in names:
            return material
    if finish.roof_material is None and finish.roof_colour is not None:
        red, green, blue = finish.roof_colour
        if green > red + MATERIAL_FIELD.min_cool_excess or blue > red + MATERIAL_FIELD.min_cool_excess:
            return SurfaceMaterial.SHEET_METAL
    return -1
