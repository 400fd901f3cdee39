"""Materials of a block's charts, and its own pictures of roofs, ground and materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from typing import Any, cast

import numpy as np

from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture
from facade_core.atlas.journal import latest_chart_digests, read_records
from facade_core.atlas.rasters import read_chart_raster
from facade_core.atlas.stored_files import digest_stored_file, read_stored_file, write_stored_file
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.core.types import MATERIALS
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.overhead_view import upward_roof_mask
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.grain import GrainExample, learn_grain
from facade_core.street.materials.grain_file import load_grain_tables
from facade_core.street.materials.tiled_material import TiledMaterial
from tasks.engine.context import load_run_plan
from tasks.engine.run import Run
from tasks.stages.shared.images import read_bounded_picture
from tasks.stages.shared.scene_view import StoredCharts, store_charts

# Ground charts, of up to 32 m, from which the look of ground is learnt.
MAX_GROUND_PICTURES = 12
# Places along either side of a roof that are looked for on the picture.
SAMPLES_PER_SIDE = 8
# Stored file of a block's own materials. Its folder is none of those that units restore: ingest writes it with the plan.
MATERIAL_FILE = "materials/pictures"


def mark_aerial_roofs(plan: Plan, aerial: Orthophoto) -> Plan:
    """Return the plan with the roofs that the aerial picture shows marked as textured."""
    scene, charts = plan.scene, plan.scene.charts
    roofs = np.flatnonzero(upward_roof_mask(scene) & plan.in_core)
    share = (np.stack(np.meshgrid(*[np.arange(SAMPLES_PER_SIDE)] * 2), axis=-1).reshape(-1, 2) + 0.5) / SAMPLES_PER_SIDE
    points = charts.points_at_shares(roofs, share)
    inside = aerial.covers(points.reshape(-1, 3)[:, :2]).reshape(len(roofs), len(share))
    textured = plan.textured.copy()
    textured[roofs[inside.any(axis=1)]] = True
    return replace(plan, textured=textured)


def material_field(
    plan: Plan, seed: int, roofs: RoofPicture | None, pictures: Sequence[MaterialPicture]
) -> MaterialField:
    """Build the material field of a block.

    Parameters
    ----------
    roofs : picture of the roof material and its metres per pixel, if given.
    pictures : pictures of other materials.
    """
    return _build_field(plan, seed, roof_material(roofs, plan.scene.spec.texels_per_metre), _learn_grains(pictures))


def _build_field(plan: Plan, seed: int, laid: TiledMaterial | None, examples: dict[str, GrainExample]) -> MaterialField:
    own = load_grain_tables(examples) if examples else None
    return MaterialField(plan.scene, plan.streets, seed=seed, roof_material=laid, ground=plan.ground, grains=own)


def pictured_ground(run: Run, plan: Plan, group: StoreGroup) -> StoredCharts:
    """Return the ground charts from which the look of ground is learnt."""
    charts, digests = _pictured_charts(plan, group)
    # what a picture shows is learnt for the surface that the map has there
    return store_charts(run, plan, charts, digests, plan.ground_digests(charts))


def _pictured_charts(plan: Plan, group: StoreGroup) -> tuple[list[int], dict[str, str]]:
    """Return those of MAX_GROUND_PICTURES ground charts near panoramas that a panorama shows, and their digests by id.

    However many charts there are, few records are read.
    """
    near = plan.ground_near_cameras()
    units = np.linspace(0, len(near) - 1, min(len(near), MAX_GROUND_PICTURES)).astype(np.int64)
    digests = latest_chart_digests(read_records(group, "grounds", units))
    return [chart for chart in near[units].tolist() if f"{plan.ids[chart]:016x}" in digests], digests


@lru_cache(maxsize=4)
def cached_material_field(
    run: Run,
    seed: int,
    roofs: RoofPicture | None,
    pictures: tuple[MaterialPicture, ...],
    learnt: StoredCharts,
) -> MaterialField:
    """Return the material field of a block with ground as pictures show it, built once in a process.

    Parameters
    ----------
    seed, roofs, pictures : as of `material_field`.
    learnt : ground charts from which the look of ground is learnt.
    """
    plan = load_run_plan(run)
    return with_pictured_ground(material_field(plan, seed, roofs, pictures), plan, learnt.store, learnt.charts)


def with_pictured_ground(field: MaterialField, plan: Plan, group: StoreGroup, charts: Sequence[int]) -> MaterialField:
    """Return the material field with ground as the base layer of some ground charts shows it; itself without any."""
    shown = read_pictured_ground(plan, group, charts)
    return field.with_pictured_ground(shown) if shown else field


def read_pictured_ground(
    plan: Plan, group: StoreGroup, charts: Sequence[int]
) -> dict[int, tuple[UInt8Array, BoolArray]]:
    """Return the base layer (h, w, 3) of some ground charts, and which texels (h, w) of it pictures show, by chart."""
    placement = plan.scene.placement
    shown = {}
    for chart in charts:
        rgb, evidence = (
            read_chart_raster(group, placement, chart, f"atlas/{name}") for name in ("seed", "seed_evidence")
        )
        shown[chart] = rgb, evidence == Provenance.PHOTO
    return shown


def _learn_grains(pictures: Sequence[MaterialPicture]) -> dict[str, GrainExample]:
    examples = {}
    for name, path, metres in pictures:
        try:
            examples[name] = learn_grain(read_bounded_picture(path).rgb, metres)
        except InputError as error:
            raise InputError(f"texture.materials: {path}: {error}") from error
    return examples


def store_materials(
    group: StoreGroup, roofs: RoofPicture | None, pictures: Sequence[MaterialPicture], texels_per_metre: float
) -> str | None:
    """Write the materials of a block's own pictures to its store; returns the digest of the file, None without any.

    The pictures themselves may be moved or renamed while the store is valid.

    Parameters
    ----------
    group : root group of the store.
    roofs : picture of the roof material and its metres per pixel, if given.
    pictures : pictures of other materials.
    texels_per_metre : density of the atlas.
    """
    laid, examples = roof_material(roofs, texels_per_metre), _learn_grains(pictures)
    arrays: dict[str, Any] = {
        f"{name}/{field}": value for name, one in examples.items() for field, value in one._asdict().items()
    }
    if laid is not None:
        arrays |= {"roof/tile": laid.tile, "roof/size": laid.size}
    if not arrays:
        return None
    file = BytesIO()
    np.savez_compressed(file, **arrays)
    write_stored_file(group, MATERIAL_FILE, file.getvalue(), "materials learnt from the block's own pictures, npz")
    return digest_stored_file(file.getvalue())


def rebuild_material_field(group: StoreGroup, plan: Plan) -> MaterialField:
    """Return the material field of a stored block, by the settings of its ingest."""
    arrays: dict[str, Any] = {}
    if digest := group.attrs["material_digest"]:
        with np.load(BytesIO(read_stored_file(group, MATERIAL_FILE, str(digest))), allow_pickle=False) as file:
            arrays = dict(file)
    examples = {
        name: GrainExample(*(arrays[f"{name}/{field}"] for field in GrainExample._fields))
        for name in MATERIALS
        if f"{name}/tile" in arrays
    }
    laid = TiledMaterial(arrays["roof/tile"], tuple(arrays["roof/size"].tolist())) if "roof/tile" in arrays else None
    field = _build_field(plan, cast(int, group.attrs["seed"]), laid, examples)
    return with_pictured_ground(field, plan, group, _pictured_charts(plan, group)[0])


def roof_material(roofs: RoofPicture | None, texels_per_metre: float) -> TiledMaterial | None:
    """Return the roof material, None if none is given."""
    if roofs is None:
        return None
    path, metres_per_pixel = roofs
    try:
        picture = read_bounded_picture(path)
        return TiledMaterial.from_picture(picture.rgb, metres_per_pixel / picture.scale, texels_per_metre)
    except InputError as error:
        raise InputError(f"texture.roof_material: {path}: {error}") from error
