"""Light on a facade from an exemplar: that of its place, with its relief and stains."""

from __future__ import annotations

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.light import SceneLight
from facade_core.street.lighting.sun import sun_in_chart_frame
from facade_core.street.materials.relief import relief_shadow_share
from facade_core.street.materials.stains import stain_tones


def light_facade(
    scene: Scene,
    light: SceneLight,
    chart: int,
    colour: UInt8Array,
    is_synthesised: BoolArray,
    labels: UInt8Array,
    seed: int,
) -> None:
    """Light the synthesised texels of a facade, in place, with shadows of its relief and, on walls, stains.

    Parameters
    ----------
    scene : the block's geometry.
    light : light on its charts.
    chart : row of the facade's chart.
    colour : (h, w, 3) uint8.
    is_synthesised : (h, w) bool.
    labels : (h, w) class id.
    seed : seed of the stains.
    """
    density, sunlight = float(scene.placement.texels_per_metre[chart]), light.sunlight(chart)
    if light.sun is not None and sunlight.any():  # a wall that the sun is behind has no relief that it shines on
        towards, shadow_brightness = sun_in_chart_frame(scene.charts, chart, light.sun)
        sunlight = sunlight * (1 - relief_shadow_share(colour, labels, density, towards, shadow_brightness))
    origin, along, down = (getattr(scene.charts, name)[chart] for name in ("origin", "axis_u", "axis_v"))
    tones = stain_tones(colour, labels, density, (float((origin * along).sum()), float((origin * down).sum())), seed)
    light.lay(chart, colour, is_synthesised, sunlight=sunlight, tones=tones, has_tone=labels == FacadeClass.WALL)
