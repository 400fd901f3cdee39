"""Exemplars that a run harvests from the street pictures of its block (`imagery.style`) before its stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from catalogs.block.reader import Block
from catalogs.printable_text import format_count
from catalogs.published.folders import Folder, local_run_folder
from catalogs.readers.pictures.picture_kinds import LABEL_MAP_SUFFIX
from facade_core.core.errors import InputError
from tasks.harvest import MAX_EXEMPLARS, NOT_LOOKED_FOR, describe_weak_exemplars
from tasks.harvest.library import harvest_style_library

# Style library of a run, in its folder.
STYLE_FOLDER = "style"


def harvest_block_style(
    block: Block, out: Folder, *, workers: int, dask: str | None, notify: Callable[[str], None]
) -> Block:
    """Harvest the street pictures of a block and add the exemplars to its own; a block without such pictures is returned.

    Resumable, and cached by the digests of the pictures in the folder of the run.

    Parameters
    ----------
    out : folder of the run.
    workers : local processes; a cluster is not used.
    dask : address of a cluster that processes the block, which must see the folder.
    notify : receives one line for the result and for each picture that is left out.

    Raises
    ------
    InputError : no facade can be used, or the cluster would not see the exemplars.
    """
    if not block.style:
        return block
    if dask is not None and not isinstance(out, Path):
        raise InputError(
            "imagery.style: workers of a cluster do not see the exemplars of a run in a bucket; "
            "run `streetloom harvest` and name its folder with imagery.exemplars"
        )
    found = harvest_style_library(
        block.style, local_run_folder(out) / STYLE_FOLDER, most=MAX_EXEMPLARS, workers=workers
    )
    for fault in found.faults:
        notify(f"style: {fault.reason}")
    taken = {path.stem for path in block.exemplars}
    harvested = list_harvested_exemplars(out)
    for path in harvested:
        if path.stem in taken:
            notify(f"style: {path.stem} is left out: an exemplar of the block has this name; rename the picture")
    added = tuple(path for path in harvested if path.stem not in taken)
    notify(
        f"style: {format_count(len(added), 'exemplar')} of {format_count(found.pictures, 'picture')}; "
        f"{found.sheets[0].parent if found.sheets else local_run_folder(out)} has the contact sheets"
    )
    if not found.looked:
        notify(f"style: {NOT_LOOKED_FOR}")
    if found.weak:
        notify(f"style: {describe_weak_exemplars(found.weak)}")
    if not added and not block.exemplars and block.texture.walls == "exemplar":
        raise InputError(
            "imagery.style: no facade can be used; add photos taken from across the street, with a whole facade in view"
        )
    return replace(block, exemplars=(*block.exemplars, *added))


def list_harvested_exemplars(out: Folder) -> tuple[Path, ...]:
    """List the exemplars that the run in a folder has harvested, by name."""
    pictures = sorted((local_run_folder(out) / STYLE_FOLDER).glob("*.png"))
    return tuple(path for path in pictures if not path.name.endswith(LABEL_MAP_SUFFIX))
