"""Wavefront OBJ of a published block, which nearly every 3D program opens."""

from __future__ import annotations

from pathlib import Path

from catalogs.features import safe_file_stem
from catalogs.printable_text import escape_invisible
from facade_core.core.arrays import IntArray
from facade_core.export.models.obj import format_materials, format_obj
from facade_core.export.models.textured_mesh import build_nodes, mesh_y_up_frame
from tasks.engine.progress import report_progress
from tasks.export.models import append_ground_index, write_texture_pages
from tasks.export.relief import add_requested_relief
from tasks.publish.published_run import PublishedBlock


def write_obj(
    results: PublishedBlock, buildings: IntArray, folder: Path, *, relief: str | None = None
) -> tuple[list[str], list[str]]:
    """Write BLOCK.obj with an object for each building, BLOCK.mtl and textures, in the frame of `glb`.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.
    relief : elements as geometry; see `add_requested_relief`.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    source = add_requested_relief(results, results.textured_mesh, buildings, relief)
    drawn, textures = write_texture_pages(source, append_ground_index(results, buildings), folder, 1)
    frame = mesh_y_up_frame(results.plan.scene.mesh)
    nodes, _ = build_nodes([drawn], {b: escape_invisible(name) for b, name in results.names.items()}, frame)
    origin = " ".join(f"{value:.3f}" for value in frame.origin.tolist())
    comments = [
        escape_invisible(results.attribution.line),
        f"Metres, y up, around x y z = {origin} of {results.crs}",
    ]
    stem = safe_file_stem(results.block)
    with (folder / f"{stem}.obj").open("w", encoding="utf-8") as file:
        file.writelines(format_obj(nodes, f"{stem}.mtl", comments))
    (folder / f"{stem}.mtl").write_text(format_materials(textures), encoding="utf-8")
    report_progress("export", 1)
    return [f"{stem}.obj"], []
