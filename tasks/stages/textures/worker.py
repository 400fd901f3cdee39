"""Worker of `textures`: write a building's own textures and the aerial view of it, on every chart but facades."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catalogs.readers.pictures.aerial import Orthophoto
from facade_core.atlas.rasters import TexelLayout, chart_digests, describe_completeness, write_rasters
from facade_core.core.arrays import UInt8Array
from facade_core.core.provenance import Provenance
from facade_core.geometry.overhead_view import resample_aerial_to_chart, upward_roof_mask
from facade_core.imagery.rectify.model_texture import render_model_texture
from tasks.engine.atlas import Atlas
from tasks.engine.inputs import SURROUNDINGS_CHANGED, input_field
from tasks.engine.outcome import rejection_record_fields
from tasks.stages.shared.images import read_textures
from tasks.stages.shared.scene_view import SceneView


@dataclass(frozen=True)
class TextureInputs:
    """Inputs of the textured charts of a building.

    Attributes
    ----------
    own : its charts, with the places of their corners on pictures, and these pictures.
    aerial : picture from above.
    above : what may hide its roofs from above; None without such a picture.
    pictures : files of `own`, by their number in the model.
    """

    own: SceneView = input_field("own texture changed")
    aerial: Orthophoto | None = input_field("orthophoto changed")
    above: SceneView | None = input_field(SURROUNDINGS_CHANGED)
    pictures: Mapping[int, Path] = field(default_factory=dict)


class TexturedCharts(NamedTuple):
    """Colours (h, w, 3) uint8 and provenance (h, w) uint8 of charts, and errors of pictures that cannot be used."""

    rasters: Mapping[int, tuple[UInt8Array, UInt8Array]]
    refused: list[Exception]


def compute_textures(inputs: TextureInputs) -> TexturedCharts:
    """Resample the textures of a building's model, and its roofs from above, to the charts."""
    refused: list[Exception] = []
    images = read_textures(inputs.pictures, refused)
    aerial, seen_from = inputs.aerial, inputs.own if inputs.above is None else inputs.above
    scene, rasters = seen_from.scene, {}
    roofs = upward_roof_mask(scene)
    for chart in inputs.own.charts:
        rgb, covered = render_model_texture(scene, chart, images)
        if aerial is not None and roofs[chart]:
            seen, known = resample_aerial_to_chart(scene, chart, aerial.sample)
            rgb, covered = np.where((known & ~covered)[..., None], seen, rgb), covered | known
        rasters[chart] = rgb, np.where(covered, Provenance.PHOTO, Provenance.UNSEEN).astype(np.uint8)
    return TexturedCharts(rasters, refused)


def write_textures(atlas: Atlas, _unit: object, result: TexturedCharts) -> dict[str, object]:
    """Write the textured charts of a building; returns the fields of their record."""
    scene = atlas.plan.scene
    digests: dict[str, str] = {}
    for chart, (rgb, covered) in result.rasters.items():
        seed, evidence = rgb.reshape(-1, 3), covered.reshape(-1)
        layout = TexelLayout.of_charts(scene.placement, [chart])
        for name, flat in {"seed": seed, "seed_evidence": evidence}.items():
            write_rasters(atlas.group[f"atlas/{name}"], scene.spec, scene.placement, layout, flat)
        digests |= chart_digests(seed, evidence, scene.placement, layout, atlas.plan.ids)
    rejected = rejection_record_fields(result.refused, "without it")
    completeness = describe_completeness(source for _, source in result.rasters.values())
    return {"charts": len(result.rasters), "digests": digests, **completeness, **rejected}
