"""Contact sheets of a harvest: the exemplars with their parses and scores, and the rejected facades with their reasons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catalogs.published.folders import write_atomically
from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import colourise
from facade_core.export.pictures.contact_sheet import draw_contact_sheets
from facade_core.export.pictures.rendering import encode_image
from tasks.harvest.record import CANDIDATES_FOLDER, SHEETS_FOLDER, CandidateRecord
from tasks.stages.shared.images import read_exemplar_picture, read_labels

# Rejected facades on the sheets at most; the list holds all.
MAX_REJECTED_SHOWN = 600


def write_contact_sheets(
    out: Path, exemplars: Sequence[CandidateRecord], rejected: Sequence[tuple[CandidateRecord, str]]
) -> list[Path]:
    """Write the contact sheets of a harvest in place of earlier ones; returns their paths."""
    folder = out / SHEETS_FOLDER
    for path in folder.glob("*.jpg"):
        path.unlink()
    accepted = [(_with_labels(out, one), _describe(one)) for one in exemplars]
    others = [(_read(out, one), f"{one['name']}\n{reason}") for one, reason in rejected[:MAX_REJECTED_SHOWN]]
    written = []
    for kind, entries in (("exemplars", accepted), ("rejected", others)):
        for number, page in enumerate(draw_contact_sheets(entries), 1):
            path = folder / f"{kind}-{number}.jpg"
            write_atomically(path, encode_image(page, "jpeg", quality=85))
            written.append(path)
    return written


def _read(out: Path, record: CandidateRecord) -> UInt8Array:
    return read_exemplar_picture(out / CANDIDATES_FOLDER / f"{record['file']}.png").rgb


def _with_labels(out: Path, record: CandidateRecord) -> UInt8Array:
    """Picture of an exemplar with its labels on the right."""
    path = out / CANDIDATES_FOLDER / f"{record['file']}.png"
    image = read_exemplar_picture(path).rgb
    labels = read_labels(path, image.shape[:2])
    return image if labels is None else np.concatenate([image, colourise(labels)], axis=1)


def _describe(record: CandidateRecord) -> str:
    return (
        f"{record['name']}\n{record['score']:.2f}, {record['width_m']:.0f} x {record['height_m']:.0f} m, "
        f"{record['floors']} floors, {record['hidden']:.0%} made up"
    )
