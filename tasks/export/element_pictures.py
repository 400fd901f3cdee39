"""Element pictures of a published block: what the finest tiles add to walls made from exemplars."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.core.arrays import IntArray
from facade_core.core.json_types import JsonObject
from tasks.export.factored_walls import (
    facade_source,
    original_exemplars,
    planar_walls,
    read_facade,
    read_original,
)
from tasks.publish.published_run import PublishedBlock

if TYPE_CHECKING:
    from facade_core.export.factored.library import FacadeLibrary
    from facade_core.export.factored.wall_geometry import WallPieces
    from facade_core.export.models.encoders import TextureEncoder
    from facade_core.export.models.features import FeatureTable
    from facade_core.export.models.textured_mesh import ModelFrame
    from facade_core.export.tiles.cells import QuadtreeCell
    from facade_core.export.tiles.tileset import DetailLevel, MakeAddition

FOLDER = "pictures"


def write_element_pictures(
    results: PublishedBlock,
    buildings: IntArray,
    folder: Path,
    encoder: TextureEncoder,
    frame: ModelFrame,
    features: FeatureTable,
) -> tuple[MakeAddition, JsonObject]:
    """Write the element pictures of some buildings, which all tiles share.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : folder of the tileset.
    encoder : encoder of the pictures.
    frame : frame of the tileset.
    features : feature table of the block.

    Returns
    -------
    addition : builds what is added to a leaf.
    statistics : counts and sizes.
    """
    from facade_core.export.factored.glb import encode_factored_glb
    from facade_core.export.factored.parts import build_factored_primitives, merge_pieces
    from facade_core.export.factored.texture_packing import pack_textures, texture_memory_bytes
    from facade_core.export.tiles.tileset import DetailLevel, z_up_bounds

    pieces_of, libraries = place_pictures(results, buildings)
    whole = merge_pieces(pieces_of.values())
    pictures = pack_textures(whole, libraries)
    suffix = encoder.mime_type.rpartition("/")[2].replace("jpeg", "jpg")
    names = [f"{FOLDER}/{number}.{suffix}" for number in range(len(pictures.pictures))]
    if names:
        (folder / FOLDER).mkdir()
    for name, page in zip(names, pictures.pictures, strict=True):
        (folder / name).write_bytes(encoder.encode(page))

    def build_addition(cell: QuadtreeCell) -> DetailLevel | None:
        own = [pieces_of[building] for building in cell.buildings.tolist() if building in pieces_of]
        parts = build_factored_primitives(merge_pieces(own), pictures, frame)
        if not parts:
            return None
        glb = encode_factored_glb(
            {cell.path or "block": parts},
            [f"../{name}" for name in names],
            pictures.is_repeated,
            encoder,
            features,
            extras={},
            copyright=results.attribution.line,
        )
        return DetailLevel("near", glb, z_up_bounds([part.position for part in parts.values()]), 0.0, len(parts))

    return build_addition, {
        "elements": len(whole.elements),
        "element_types": len(pictures.placement),
        "element_picture_bytes": sum((folder / name).stat().st_size for name in names),
        "element_texture_mb": round(texture_memory_bytes(pictures.pictures) * encoder.bytes_per_texel / 4e6, 1),
    }


def place_pictures(results: PublishedBlock, buildings: IntArray) -> tuple[dict[int, WallPieces], list[FacadeLibrary]]:
    """Place the pictures of exemplars on walls; return the pieces of each building and the libraries."""
    from facade_core.export.factored.element_pictures import place_element_pictures
    from facade_core.export.factored.wall_geometry import WallPieces

    numbers, libraries = _collect_libraries(results)
    pieces_of: dict[int, WallPieces] = {}
    for index, polygons in planar_walls(results, buildings).items() if libraries else ():
        number = numbers.get(facade_source(results, index))
        if number is None:
            continue
        pieces = pieces_of.setdefault(int(results.plan.facades.building[index]), WallPieces())
        facade, charts = read_facade(results, index), results.textured_mesh.charts
        place_element_pictures(facade, polygons, charts, libraries[number], number, pieces)
    return pieces_of, libraries


def _collect_libraries(results: PublishedBlock) -> tuple[dict[str, int], list[FacadeLibrary]]:
    """Collect the element pictures of every exemplar; return the number of each exemplar's and the libraries."""
    from facade_core.export.factored.element_pictures import collect_element_pictures
    from facade_core.parsing.elements import elements

    paths = original_exemplars(results)
    numbers: dict[str, int] = {}
    libraries: list[FacadeLibrary] = []
    for k, record in enumerate(results.journals["exemplars"]):
        if not record or record["status"] != "done":
            continue
        image, labels = (results.group[f"exemplars/{k}/{name}"][:] for name in ("image", "labels"))
        fine = read_original(paths.get(record["unit"]), image)
        if fine is None:
            continue
        density = 1 / float(record["metres_per_texel"])
        library = collect_element_pictures(image, fine, elements(labels), density)
        if library.units:
            numbers[record["unit"]] = len(libraries)
            libraries.append(library)
    return numbers, libraries
