"""Relighting of charts: base colour without baked light, and the maps of a physically based material."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, FloatArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.linear_light import linear_to_srgb, srgb_to_linear
from facade_core.core.provenance import Provenance
from facade_core.core.types import MappedGround
from facade_core.export.lighting.albedo import divide_light, estimate_shading
from facade_core.export.lighting.ground_materials import GroundMaterialOutlines
from facade_core.export.lighting.height_maps import cavity_visibility, estimate_heights, normals_from_heights
from facade_core.export.lighting.panes import (
    FacadeOpening,
    SeededRandom,
    find_openings,
    glass_mask,
    modulate_by_picture,
    opening_emission,
    pane_slope,
    snap_to_boxes,
)
from facade_core.export.lighting.pbr_materials import CHART_MATERIALS, ROUGHNESS, PbrMaterialClass, classify_facade
from facade_core.export.lighting.settings import STREET_LIGHT
from facade_core.export.lighting.street_light import (
    NO_EMITTERS,
    Emitters,
    join_emitters,
    street_light,
    window_emitters,
)
from facade_core.export.models.pages import PbrMaps, downscale
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.facade.wall_material import measure_wall_material
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.daylight import MIN_DAYLIGHT
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.light import SceneLight, interpolate_axis, invert_tones
from facade_core.street.materials.field_kernels import SurfaceMaterial
from facade_core.street.materials.settings import MATERIAL_FIELD

# Charts with cached maps: those of one building, which a shell reads repeatedly.
MAX_CACHED_CHARTS = 64


class StoredChartTexels(NamedTuple):
    """Stored texels of a chart, uint8.

    Attributes
    ----------
    provenance : (h, w) Provenance.
    base_layer : (h, w, 3) texture of the facade stages; None for charts that are no facade.
    labels : (h, w) facade classes; None for charts that are no facade.
    """

    provenance: UInt8Array
    base_layer: UInt8Array | None
    labels: UInt8Array | None


@dataclass(frozen=True)
class RelightingInputs:
    """Facts about a block that relighting needs.

    Attributes
    ----------
    scene : scene of the block.
    ground : ground of the map.
    chart_materials : (charts,) material of each chart, as in the charts of the material field.
    has_source_texture : (charts,) bool, charts with a texture of the input model.
    chart_numbers : (charts,) stable numbers that seed random choices.
    light : light in the colours; None if there is none.
    texels : returns the stored texels of a chart.
    has_relief : the elements of facades are geometry.
    lamps : street lamps.
    """

    scene: Scene
    ground: MappedGround
    chart_materials: UInt8Array
    has_source_texture: BoolArray
    chart_numbers: Sequence[int]
    light: SceneLight | None
    texels: Callable[[int], StoredChartTexels]
    has_relief: bool = False
    lamps: Emitters = NO_EMITTERS


def build_relightable_mesh(source: TexturedMesh, inputs: RelightingInputs) -> TexturedMesh:
    """Return the mesh with base colours without baked light, and with PBR maps."""
    charts, grounds = _ChartRelighter(source, inputs), GroundMaterialOutlines(inputs.ground)
    maps = lru_cache(maxsize=MAX_CACHED_CHARTS)(lambda chart: charts.maps(chart, charts.albedo(chart), grounds))
    return replace(source, raster=charts.albedo, maps=maps)


class _Surface(NamedTuple):
    """Surface of a chart at half the density of its colour.

    Attributes
    ----------
    material : (h, w) PbrMaterialClass.
    roughness : (h, w) float32.
    frames : (h, w) bool, window frames and bars; None without any.
    slope : (h, w, 2) slopes of panes to the right and up; None without any.
    light : (h, w, 3) light at night; None where all is dark.
    """

    material: UInt8Array
    roughness: Float32Array
    frames: BoolArray | None = None
    slope: Float32Array | None = None
    light: Float32Array | None = None


class _ChartRelighter:
    def __init__(self, source: TexturedMesh, inputs: RelightingInputs) -> None:
        self.source, self.inputs, self.scene = source, inputs, inputs.scene
        self.albedo = lru_cache(maxsize=MAX_CACHED_CHARTS)(self._find_albedo)
        self.known_windows: dict[int, Emitters] = {}

    def _find_albedo(self, chart: int) -> UInt8Array:
        """Compute the base colour (h, w, 3) uint8 of a chart.

        The base layer of synthesised texels has no light. For materials, the light of the block is computed again and
        divided out, after the tone curve; for photos, a smooth shading of the wall is divided out.
        """
        inputs, (provenance, base_layer, labels) = self.inputs, self.inputs.texels(chart)
        stored, shape = self.source.raster(chart), provenance.shape
        colour, light = stored.astype(np.float32), np.ones((*shape, 1), np.float32)
        painted = (provenance > Provenance.UNSEEN) & (provenance <= Provenance.TRANSLATED)
        if inputs.light is not None and painted.any():
            colour = np.where(painted[..., None], invert_tones(stored), colour)
            light = np.where(painted[..., None], inputs.light.factor(chart), light)
        pictured = provenance > Provenance.SYNTHESISED
        if labels is not None and pictured.any():
            field = estimate_shading(divide_light(colour, light), labels, self.density(chart))
            if field is not None:
                light = light * np.where(pictured, field, np.float32(1))[..., None]
        found = divide_light(colour, light)
        if base_layer is not None:
            made = provenance == Provenance.SYNTHESISED
            found[made] = base_layer[made]
        return found

    def density(self, chart: int) -> float:
        return float(self.scene.placement.texels_per_metre[chart])

    def sky_visibility(self, chart: int, shape: tuple[int, ...]) -> Float32Array:
        """Return the share of the sky that texels see, relative to an unobstructed chart, (h, w) float32."""
        daylight = self.scene.daylight
        daylight.compute([chart])
        rows, columns, first = int(daylight.rows[chart]), int(daylight.columns[chart]), int(daylight.start[chart])
        grid = daylight.light[first : first + rows * columns].reshape(rows, columns)
        free = max(0.5 + 0.5 * float(self.scene.charts.normals()[chart, 2]), MATERIAL_FIELD.min_open_sky)
        grid = np.minimum((grid - MIN_DAYLIGHT) / (1 - MIN_DAYLIGHT) / free, 1).astype(np.float32)
        for axis in (0, 1):
            grid = interpolate_axis(grid, axis, shape[axis])
        return grid

    def maps(self, chart: int, colour: UInt8Array, grounds: GroundMaterialOutlines) -> PbrMaps:
        labels = self.inputs.texels(chart).labels
        labels = None if labels is None else snap_to_boxes(labels)
        density = self.density(chart)
        size = (-(-colour.shape[1] // 2), -(-colour.shape[0] // 2))
        half = (size[1], size[0])
        reduced = downscale(colour, size)
        small = reduced.astype(np.float32).mean(axis=2)
        if labels is not None and not self.inputs.has_source_texture[chart]:
            surface = self.facade_surface(chart, colour, labels, size)
        else:
            surface = self.plain_surface(chart, half, grounds)
        coarse = None if labels is None else labels[::2, ::2]
        frames = np.zeros(half, bool) if surface.frames is None else surface.frames
        has_relief = self.inputs.has_relief
        height = estimate_heights(coarse, surface.material, small, frames, density / 2, has_relief=has_relief)
        occlusion = self.sky_visibility(chart, half) * cavity_visibility(height, density / 2)
        orm = np.stack([occlusion, surface.roughness, np.zeros(half, np.float32)], axis=-1)
        return PbrMaps(
            _to_uint8(normals_from_heights(height, density / 2, surface.slope) / 2 + np.float32(0.5)),
            _to_uint8(orm),
            self.night_picture(chart, reduced, surface.light),
        )

    def night_picture(self, chart: int, colour: UInt8Array, own: Float32Array | None) -> UInt8Array | None:
        """Return what a chart of a colour (h, w, 3) shows at night by its own windows, lamps and shops; None without light."""
        emitters, charts = self.inputs.lamps, self.scene.charts
        if charts.kind[chart] == ChartKind.GROUND:
            near = charts.charts_within(chart, STREET_LIGHT.window_reach_m)
            walls = near[charts.kind[near] == ChartKind.WALL]
            emitters = join_emitters([emitters, *map(self.lit_windows, walls.tolist())])
        received = street_light(self.scene, chart, emitters, colour.shape[:2])
        shown = np.zeros(colour.shape, np.float32) if own is None else own
        if received is not None:
            shown = shown + srgb_to_linear(colour) * received
        return linear_to_srgb(np.minimum(shown, 1)) if shown.any() else None

    def lit_windows(self, chart: int) -> Emitters:
        """Return the lit windows of a wall; those of a wall whose maps were made are known, few numbers each."""
        if chart not in self.known_windows:
            self.known_windows[chart] = NO_EMITTERS
            if not self.inputs.has_source_texture[chart] and (labels := self.inputs.texels(chart).labels) is not None:
                self.pane_maps(chart, self.albedo(chart), snap_to_boxes(labels))
        return self.known_windows[chart]

    def facade_surface(self, chart: int, colour: UInt8Array, labels: UInt8Array, size: tuple[int, int]) -> _Surface:
        """Return the surface of a facade from its labels, at `size` (width, height), half that of its colour."""
        measured = measure_wall_material(colour, labels, self.density(chart))
        is_brick = self.chart_material(chart) == PbrMaterialClass.BRICK or (measured is not None and measured.brick)
        wall = PbrMaterialClass.BRICK if is_brick else PbrMaterialClass.PLASTER
        panes, slopes, light = self.pane_maps(chart, colour, labels)
        material = classify_facade(labels, wall, panes)
        share = downscale(panes.astype(np.float32)[..., None], size)[..., 0]
        return _Surface(
            material[::2, ::2],
            downscale(ROUGHNESS[material][..., None], size)[..., 0],
            (labels[::2, ::2] == FacadeClass.WINDOW) & (share < 0.5),
            slopes[::2, ::2] * (share > 0.5)[..., None],
            None if light is None else downscale(light, size),
        )

    def plain_surface(self, chart: int, shape: tuple[int, int], grounds: GroundMaterialOutlines) -> _Surface:
        """Return the surface of a chart that is no facade: photographed, ground, window or of one material."""
        charts = self.scene.charts
        if self.inputs.has_source_texture[chart]:
            material = np.full(shape, PbrMaterialClass.PHOTOGRAPHED, np.uint8)
            return _Surface(material, ROUGHNESS[material])
        if charts.kind[chart] == ChartKind.GROUND:
            material = grounds.rasterise(charts, chart, shape)
        else:
            material = np.full(shape, self.chart_material(chart), np.uint8)
        light = None
        if charts.kind[chart] == ChartKind.WINDOW:
            pane = FacadeOpening(FacadeClass.WINDOW, 0, 0, shape[1], shape[0])
            light = opening_emission(
                pane, self.density(chart) / 2, float(charts.size[chart, 1]), self.make_random(chart)
            )
        return _Surface(material, ROUGHNESS[material], light=light)

    def chart_material(self, chart: int) -> PbrMaterialClass:
        return CHART_MATERIALS[SurfaceMaterial(self.inputs.chart_materials[chart])]

    def make_random(self, chart: int) -> SeededRandom:
        building = max(int(self.scene.charts.building[chart]), 0)
        return SeededRandom(int(self.scene.building_hashes[building]), int(self.inputs.chart_numbers[chart]))

    def pane_maps(
        self, chart: int, colour: UInt8Array, labels: UInt8Array
    ) -> tuple[BoolArray, Float32Array, Float32Array | None]:
        """Return the maps of a facade's panes.

        Returns
        -------
        Mask (h, w) bool of panes, their slopes (h, w, 2), and their light at night (h, w, 3); None where all is dark.
        """
        import cv2

        grey = np.asarray(cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY), np.uint8)
        density = self.density(chart)
        height, random = float(self.scene.charts.size[chart, 1]), self.make_random(chart)
        panes, leans = np.zeros(labels.shape, bool), np.zeros((*labels.shape, 2), np.float32)
        lit: Float32Array | None = None
        for opening in find_openings(labels):
            clear = glass_mask(opening, grey, density)
            panes[opening.box] |= clear
            leans[opening.box][clear] = pane_slope(opening, density, random)
            light = opening_emission(opening, density, height, random)
            if light is not None:
                lit = np.zeros((*labels.shape, 3), np.float32) if lit is None else lit
                lit[opening.box][clear] = modulate_by_picture(opening, light, grey, clear)[clear]
        self.known_windows[chart] = NO_EMITTERS if lit is None else window_emitters(self.scene.charts, chart, lit)
        return panes, leans, lit


def _to_uint8(values: FloatArray) -> UInt8Array:
    return (np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8)
