"""Images of the report: views of the block, and pictures of facades and exemplars."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TypeVar

from catalogs.features import safe_file_stem
from catalogs.published.reuse import SnapshotFileWriter
from catalogs.published.snapshot import SnapshotFolder
from facade_core.atlas.journal import Record, unit_key
from facade_core.atlas.stored_files import picture_path, read_stored_file
from facade_core.core.resizing import resize_image
from facade_core.export.pictures.rendering import encode_image
from facade_core.export.pictures.settings import DRAWINGS
from facade_core.export.pictures.views import select_pictured_facades
from tasks.engine.stage_code import stage_code_digest
from tasks.publish.partial_failures import PartialFailures
from tasks.publish.stored_block import StoredBlock
from tasks.stages.pictures.record import ReportPictureRecord

R = TypeVar("R", bound=Record)

# Name of a file in report/images, and its title.
TitledFile = tuple[str, str]


@dataclass(frozen=True)
class ReportImages:
    """Files in report/images, by subject.

    Attributes
    ----------
    views : names of views along streets.
    sheets : titled files by facade id.
    textures_only : ids of facades with a picture of their texture only.
    exemplars : titled files by exemplar name.
    before : file with the earlier state by facade id.
    """

    views: tuple[str, ...]
    sheets: Mapping[str, tuple[TitledFile, ...]]
    textures_only: frozenset[str]
    exemplars: Mapping[str, tuple[TitledFile, ...]]
    before: Mapping[str, str]


def write_report_images(
    snapshot: SnapshotFolder[Path], block: StoredBlock, files: SnapshotFileWriter, failures: PartialFailures
) -> ReportImages:
    """Write the images of the report; record unreadable ones as failures.

    Parameters
    ----------
    snapshot : snapshot that is written.
    block : block as its store holds it.
    files : files of the snapshot; added to.
    failures : failures so far; added to.
    """
    folder = (snapshot.report / "images").relative_to(snapshot.folder).as_posix()
    journal = block.journals["pictures"]
    first = len(journal) - len(select_pictured_facades(block.plan))  # views come before facades
    # a worker that failed to read the store may have met a damaged chunk
    failures.is_store_suspect |= any(record is not None and record.get("unread", False) for record in journal)
    views = []
    for record in _done_records(journal[:first]):
        with failures.attempt(record["unit"]):
            files.add_file(
                f"{folder}/{record['file']}.jpg", record["digest"], partial(_read_picture_file, block, record)
            )
            views.append(f"{record['file']}.jpg")
    sheets: dict[str, tuple[TitledFile, ...]] = {}
    for record in _done_records(journal[first:]):
        with failures.attempt(f"pictures of facade {record['unit']}"):
            sheets[record["unit"]] = tuple(_add_facade_pictures(folder, block, record, files))
    return ReportImages(
        tuple(name for name in views if name != "above.jpg"),
        sheets,
        frozenset(r["unit"] for r in _done_records(journal[first:]) if len(r["pictures"]) == 1),
        _add_exemplar_pictures(folder, block, files, failures),
        dict(_add_earlier_pictures(folder, block, files, failures)),
    )


def _done_records(records: Sequence[R | None]) -> list[R]:
    """Return the records of finished units."""
    return [record for record in records if record is not None and record["status"] == "done"]


def _read_picture_file(block: StoredBlock, record: ReportPictureRecord) -> bytes:
    return read_stored_file(block.group, picture_path(record["file"]), record["digest"])


def _add_facade_pictures(
    folder: str, block: StoredBlock, record: ReportPictureRecord, files: SnapshotFileWriter
) -> Iterator[TitledFile]:
    """Add a WebP per picture of a facade, cut out of its stored file, which is read only if one cannot be linked."""
    whole = cache(partial(_read_picture_file, block, record))
    for name, title, offset, length in record["pictures"]:
        file = f"{safe_file_stem(record['unit'])}-{name}.webp"
        source_key = unit_key(record["digest"], offset, length)
        files.add_file(f"{folder}/{file}", source_key, partial(_slice_file, whole, offset, length))
        yield file, title


def _add_earlier_pictures(
    folder: str, block: StoredBlock, files: SnapshotFileWriter, failures: PartialFailures
) -> Iterator[TitledFile]:
    """Add a WebP per facade that changed since an earlier capture; yields facade ids and file names."""
    for record in _done_records(block.records):
        if "before_file" in record:
            file, digest = f"{safe_file_stem(record['unit'])}-before.webp", record["before_digest"]
            with failures.attempt(f"picture of facade {record['unit']} before"):
                files.add_file(
                    f"{folder}/{file}", digest, partial(read_stored_file, block.group, record["before_file"], digest)
                )
                yield record["unit"], file


def _slice_file(whole: Callable[[], bytes], offset: int, length: int) -> bytes:
    return whole()[offset : offset + length]


def _add_exemplar_pictures(
    folder: str, block: StoredBlock, files: SnapshotFileWriter, failures: PartialFailures
) -> dict[str, tuple[TitledFile, ...]]:
    """Add two WebPs per finished exemplar: the prepared input and the extracted wall material."""
    found = {}
    for index, record in enumerate(block.journals["exemplars"]):
        if record is None or record["status"] != "done":
            continue
        pictures = [
            ("preview", "As given: dark is cut off, red is made anew"),
            ("image", "What walls are made of"),
        ]
        with failures.attempt(f"pictures of exemplar {record['unit']}"):
            titled = []
            for array, title in pictures:
                file = f"exemplar-{index}-{array}.webp"
                source_key = unit_key(stage_code_digest("publish"), record["key"], array)
                files.add_file(
                    f"{folder}/{file}",
                    source_key,
                    partial(_encode_exemplar, block, f"{record['folder']}/{array}"),
                )
                titled.append((file, title))
            found[record["unit"]] = tuple(titled)
    return found


def _encode_exemplar(block: StoredBlock, path: str) -> bytes:
    image = block.group[path][:]
    scale = min(1.0, DRAWINGS.max_preview_px / max(image.shape[:2]))
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    return encode_image(resize_image(image, (height, width)), "WEBP", quality=82, method=2)
