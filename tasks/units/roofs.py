"""What a block's own imagery says of roofs and ground: a picture from above, or one of the roofs' material."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from catalogs.readers.pictures.aerial import Aerial
from facade_core.errors import InputError
from facade_core.plan import Plan
from facade_core.street.overhead import Aerial as Sampler
from facade_core.street.overhead import shown_from_above
from facade_core.street.tiled import Material
from tasks.run import Run
from tasks.units.images import read_whole

# Places along either side of a roof that are looked for on the picture.
LOOKED_AT = 8


def under_aerial(plan: Plan, aerial: Aerial) -> Plan:
    """The plan with the roofs that the picture shows marked as textured."""
    scene, charts = plan.scene, plan.scene.charts
    roofs = np.flatnonzero(shown_from_above(scene))
    share = (np.stack(np.meshgrid(*[np.arange(LOOKED_AT)] * 2), axis=-1).reshape(-1, 2) + 0.5) / LOOKED_AT
    points = charts.at_shares(roofs, share)
    inside = aerial.covers(points.reshape(-1, 3)[:, :2]).reshape(len(roofs), len(share))
    textured = plan.textured.copy()
    textured[roofs[inside.any(axis=1)]] = True
    return replace(plan, textured=textured)


def sampler(run: Run) -> Sampler | None:
    """Colours of the block from above at the atlas' density, None where there is no picture."""
    aerial = run.aerial
    return None if aerial is None else lambda places: aerial.sample(places, 1 / run.texture.texels_per_metre)


def roof_material(run: Run) -> Material | None:
    """The material that roofs take, None where none is given."""
    if run.roof_material is None:
        return None
    path, metres_per_pixel = run.roof_material
    try:
        picture = read_whole(path)
        return Material.of(picture.rgb, metres_per_pixel / picture.scale, run.texture.texels_per_metre)
    except InputError as error:
        raise InputError(f"texture.roof_material: {path}: {error}") from error
