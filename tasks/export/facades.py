"""Facades of a published block as annotated pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from catalogs.features import safe_file_stem
from catalogs.printable_text import format_count
from facade_core.atlas.rasters import read_chart_raster
from facade_core.core.arrays import IntArray
from facade_core.export.pictures.annotations import AnnotatedFacade, coco_document, labelme_document
from tasks.engine.progress import begin_stage, report_progress
from tasks.publish.published_run import PublishedBlock


def write_coco(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write annotations.json and images/ID.png: rectified facades without occluders, with their elements.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    (folder / "images").mkdir()
    facades = list(_annotate_facades(results, buildings, folder, "images/"))
    value = coco_document(
        facades, f"Facades of {results.block}, elements of the completed facades", results.attribution
    )
    (folder / "annotations.json").write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")
    return ["annotations.json"], _note_missing(results, buildings, len(facades))


def write_labelme(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write ID.png and ID.json for every facade.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.

    Returns
    -------
    files : the ID.json files.
    notes : remarks for the user.
    """
    facades = list(_annotate_facades(results, buildings, folder, ""))
    names = [f"{safe_file_stem(facade.facade)}.json" for facade in facades]
    for name, facade in zip(names, facades, strict=True):
        (folder / name).write_text(
            json.dumps(labelme_document(facade, results.attribution), indent=2, allow_nan=False) + "\n"
        )
    return names, _note_missing(results, buildings, len(facades))


def _annotate_facades(
    results: PublishedBlock, buildings: IntArray, folder: Path, within: str
) -> Iterator[AnnotatedFacade]:
    """Write the picture of every finished facade and yield its annotations."""
    facades = results.select_finished_facades(buildings)
    said = PngInfo()
    said.add_itxt("Copyright", results.attribution.line)
    begin_stage("export", len(facades))
    for index in facades:
        name = results.plan.facades.id[index]
        chart = int(results.plan.facades.chart[index])
        texture = read_chart_raster(results.group, results.plan.scene.placement, chart, "atlas/seed")
        file = f"{within}{safe_file_stem(name)}.png"
        Image.fromarray(texture).save(folder / file, pnginfo=said)
        metres = 1 / float(results.plan.scene.placement.texels_per_metre[chart])
        yield AnnotatedFacade(name, file, texture.shape[1], texture.shape[0], metres, results.elements(index))
        report_progress("export", 1)


def _note_missing(results: PublishedBlock, buildings: IntArray, written: int) -> list[str]:
    missing = int(np.isin(results.plan.facades.building, buildings).sum()) - written
    if not missing:
        return []
    return [f"left out: {format_count(missing, 'facade')} without a layout; `streetloom query` says why"]
