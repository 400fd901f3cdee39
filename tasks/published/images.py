"""The report's images: views of the block, panoramas, and every facade stage by stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from catalogs.features import file_stem
from facade_core.export import Picture, aerial, aim, street_level
from tasks.published.facade_stages import StoredFacade, stages_of
from tasks.published.pages import jpeg
from tasks.published.stored import StoredBlock

VIEW_SIZE = (900, 1440)
# A facade from a photo is so much more worth showing than one from an exemplar.
PHOTO_WORTH = 4
# Views along streets, viewpoints of a street that are tried for its view, and panoramas.
STREETS, LOOKED_AT, PANORAMAS = 3, 24, 6

T = TypeVar("T")
# A file's name in report/images, and its title.
Titled = tuple[str, str]


@dataclass(frozen=True)
class Images:
    """What is in report/images: views along streets by their names, panoramas, and the sheets of facades by their ids."""

    views: tuple[str, ...]
    panoramas: tuple[Titled, ...]
    sheets: Mapping[str, tuple[Titled, ...]]


def aim_views(block: StoredBlock) -> dict[str, Picture]:
    """The block from above, and along some streets, from where most of the facades is seen, photos before others; to be painted
    page by page."""
    plan = block.plan
    worth = np.zeros(len(plan.scene.charts))
    for chart, record in zip(plan.facades.chart, block.records, strict=True):
        photo = record.get("provenance", [0.0])[-1] if record else 0.0
        worth[chart] = 1 + PHOTO_WORTH * photo
    views = {"above": aim(plan.scene, aerial(plan.scene, VIEW_SIZE, worth))}
    streets = sorted({v.street for v in plan.viewpoints})
    for number, street in enumerate(_spread(streets, STREETS)):
        own = [v for v in plan.viewpoints if v.street == street]
        camera = street_level(plan.scene, _spread(own, LOOKED_AT), VIEW_SIZE, worth)
        views[f"street-{number}"] = aim(plan.scene, camera)
    return views


def write_images(folder: Path, block: StoredBlock, views: Mapping[str, Picture]) -> Images:
    """Write the folder of images; views: painted."""
    folder.mkdir(parents=True)
    for name, view in views.items():
        (folder / f"{name}.jpg").write_bytes(jpeg(_halve(view.rgb), 90))
    return Images(
        tuple(f"{name}.jpg" for name in views if name != "above"),
        _write_panoramas(folder, block),
        dict(_write_sheets(folder, block, facade) for facade in range(len(block.records))),
    )


def _write_panoramas(folder: Path, block: StoredBlock) -> tuple[Titled, ...]:
    """One JPEG for some of the viewpoints, titled by their units."""
    done = [(number, record["unit"]) for number, record in enumerate(block.journals["viewpoints"]) if record]
    written = []
    for number, unit in _spread(done, PANORAMAS):
        name = f"panorama-{number}.jpg"
        (folder / name).write_bytes(jpeg(block.group["panoramas/rgb"][number], 88))
        written.append((name, unit))
    return tuple(written)


def _write_sheets(folder: Path, block: StoredBlock, facade: int) -> tuple[str, tuple[Titled, ...]]:
    """One WebP for each stage of a facade that the report shows; the facade's id and its sheets in the order of the stages."""
    from PIL import Image

    id, chart = block.plan.facades.id[facade], int(block.plan.facades.chart[facade])
    placement, record = block.plan.scene.placement, block.records[facade]
    stored = StoredFacade(block.group, placement, facade, chart, record, exemplars=())
    written = []
    for stage in stages_of(stored):
        if stage.report is not None:
            name = f"{file_stem(id)}-{stage.report.name}.webp"
            Image.fromarray(stage.draw()).save(folder / name, "WEBP", quality=82, method=2)
            written.append((name, stage.report.title))
    return id, tuple(written)


def _spread(values: list[T], count: int) -> list[T]:
    """At most `count` of the values, evenly spread."""
    if len(values) <= count:
        return values
    return [values[round(i * (len(values) - 1) / (count - 1))] for i in range(count)]


def _halve(rgb: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.resize(rgb, (rgb.shape[1] // 2, rgb.shape[0] // 2), interpolation=cv2.INTER_AREA)
