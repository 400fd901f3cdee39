"""Prepared exemplars that the blocks of a city share: the first block that needs one prepares it, the others read it."""

from __future__ import annotations

import io
import json
import logging
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from catalogs.published.folders import Folder, join_path, write_atomically
from catalogs.published.s3 import folder_at
from facade_core.core.arrays import UInt8Array
from facade_core.core.name_hash import hash_name
from tasks.engine.run import Run
from tasks.engine.unit import Unit
from tasks.stages.exemplars.record import ExemplarFacts

log = logging.getLogger(__name__)


class PreparedExemplar(NamedTuple):
    """Arrays of a prepared exemplar, and what its record says of the picture.

    Attributes
    ----------
    image : (h, w, 3) uint8, at the block's density or coarser.
    labels : (h, w) uint8 class ids.
    preview : (y, x, 3) uint8, the picture as given with its cropped and completed parts marked.
    facts : columns of the record that depend on the picture alone.
    seconds : seconds by step of the preparation.
    """

    image: UInt8Array
    labels: UInt8Array
    preview: UInt8Array
    facts: ExemplarFacts
    seconds: dict[str, float]


def read_shared_exemplar(run: Run, unit: Unit[Any]) -> PreparedExemplar | None:
    """Read an exemplar that another block of the city prepared; None outside a city, and if there is none of its key."""
    if not run.shared:
        return None
    try:
        with np.load(io.BytesIO(_shared_file(run, unit).read_bytes()), allow_pickle=False) as file:
            if str(file["key"]) != unit.key:
                return None
            facts = json.loads(str(file["facts"]))
            return PreparedExemplar(file["image"], file["labels"], file["preview"], facts, {})
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        log.debug("the shared exemplar %s cannot be read and is prepared again: %s", unit.name, error)
        return None


def write_shared_exemplar(run: Run, unit: Unit[Any], prepared: PreparedExemplar) -> None:
    """Write an exemplar for the other blocks of the city; has no effect outside a city."""
    if not run.shared:
        return
    content = io.BytesIO()
    np.savez(
        content,
        image=prepared.image,
        labels=prepared.labels,
        preview=prepared.preview,
        key=np.array(unit.key),
        facts=np.array(json.dumps(prepared.facts)),
    )
    file = _shared_file(run, unit)
    try:
        if isinstance(file, Path):
            file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, content.getvalue())
    except OSError as error:  # the other blocks prepare it themselves
        log.debug("the exemplar %s cannot be shared: %s", unit.name, error)


def _shared_file(run: Run, unit: Unit[Any]) -> Folder:
    return join_path(folder_at(run.shared), f"exemplars/{hash_name(unit.name):08x}.npz")
