"""OpenUSD of a published block: a stage for each building, a stage of references, and a package."""

from __future__ import annotations

import json
import os
from pathlib import Path

from catalogs.features import safe_file_stem
from facade_core.core.arrays import IntArray
from facade_core.export.models.encoders import ENCODERS
from facade_core.export.models.gltf_materials import DAY, NIGHT, encode_textures
from facade_core.export.models.textured_mesh import (
    GROUND_NODE,
    build_nodes,
    draw_page_images,
    mesh_y_up_frame,
    pack_charts_on_pages,
)
from facade_core.export.models.usd import (
    TextureAssetPaths,
    ZUpFrame,
    import_usd_library,
    write_usd_block,
    write_usd_building,
    write_usd_package,
)
from facade_core.export.surroundings.usd import write_usd_surroundings
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.features import list_building_rows
from tasks.export.models import append_ground_index, mesh_with_requested_lighting
from tasks.export.relief import add_requested_relief
from tasks.publish.published_run import PublishedBlock

# Unix time of 1980-01-02 in any time zone, the first day that a package can store, seconds.
PACKAGE_TIME_S = 315_619_200
# Names of texture files by the fields of MaterialTextures.
TEXTURE_NAMES = {"base_colour": "colour", "normal": "normal", "orm": "orm", "emissive": "glow"}


def write_usd(
    results: PublishedBlock,
    buildings: IntArray,
    folder: Path,
    *,
    lit: bool | None = None,
    night: bool = False,
    relief: str | None = None,
    package: bool = True,
) -> tuple[list[str], list[str]]:
    """Write BLOCK.usda, its buildings/ID.usdc and textures/, and all of them packed as BLOCK.usdz.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.
    lit : relight materials; see `mesh_with_requested_lighting`.
    night : night emission.
    relief : elements as geometry; see `add_requested_relief`.
    package : write the package too.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    import_usd_library()
    source, notes = mesh_with_requested_lighting(results, lit, night, relief, lit_by_default=True)
    source = add_requested_relief(results, source, buildings, relief)
    drawn = pack_charts_on_pages(source, source.select_charts(append_ground_index(results, buildings)))
    frame = ZUpFrame(mesh_y_up_frame(results.plan.scene.mesh).origin)
    nodes, _ = build_nodes([drawn], results.names, frame)
    begin_stage("export", len(drawn.layout.pages) + len(nodes) + package)
    for name in ("textures", "buildings"):
        (folder / name).mkdir()
    packed: list[str] = []
    pages: list[TextureAssetPaths] = []
    for page in range(len(drawn.layout.pages)):
        textures = encode_textures(draw_page_images(drawn, page), ENCODERS["jpeg"])
        pictures = {field: picture for field, picture in vars(textures).items() if picture is not None}
        files = {field: f"textures/{page:04}-{TEXTURE_NAMES[field]}.jpg" for field in pictures}
        for field, picture in pictures.items():
            (folder / files[field]).write_bytes(picture)
        packed += files.values()
        pages.append(TextureAssetPaths(**{field: f"../{file}" for field, file in files.items()}))
        report_progress("export", 1)
    time = None if source.maps is None else NIGHT if night else DAY
    rows = {results.names[index]: row for index, row in list_building_rows(results).items()}
    parts: dict[str, str] = {}
    for node in nodes:
        parts[node.name] = f"./buildings/{safe_file_stem(node.name)}.usdc"
        about = rows.get(node.name, {"kind": GROUND_NODE}) | {"attribution": results.attribution.line}
        write_usd_building(folder / parts[node.name], node, pages, about, time)
        report_progress("export", 1)
    plan = results.plan
    if (len(plan.objects) or len(plan.surroundings)) and GROUND_NODE in parts:
        parts["surroundings"] = "./surroundings.usdc"
        write_usd_surroundings(folder / "surroundings.usdc", plan.objects, plan.surroundings, frame)
    stem = safe_file_stem(results.block)
    metadata: dict[str, str] = {
        "block": results.block,
        "crs": results.crs,
        "origin": json.dumps(frame.origin.tolist()),
        "snapshot": results.snapshot.id,
        **results.attribution.tags(),
    }
    write_usd_block(folder / f"{stem}.usda", parts, metadata, results.attribution.line, time)
    if not package:
        return [f"{stem}.usda"], notes
    packed = [f"{stem}.usda", *(part.removeprefix("./") for part in parts.values()), *packed]
    for name in packed:  # a package stores modification times: a constant keeps its bytes reproducible
        os.utime(folder / name, (PACKAGE_TIME_S, PACKAGE_TIME_S))
    write_usd_package(folder, packed, folder / f"{stem}.usdz")
    report_progress("export", 1)
    return [f"{stem}.usda", f"{stem}.usdz"], notes
