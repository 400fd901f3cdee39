"""A facade's stages as pictures, drawn from the store when somebody looks."""

from __future__ import annotations

import io

from facade_core.atlas.stored_files import read_stored_file
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.export.pictures.stage_pictures import StageTitle, iterate_stage_pictures
from tasks.viewing.run_view import RunView


def list_stage_pictures(view: RunView, index: int) -> list[StageTitle]:
    """The stages that facade number `index` has pictures of, in their order; none before it is done."""
    return [stage.viewer for stage in iterate_stage_pictures(view.stored_facade(index)) if stage.viewer is not None]


def draw_stage_picture(view: RunView, index: int, name: str) -> UInt8Array:
    """The picture (h, w, 3) uint8 of a stage that `stages` lists. Raises InputError for another."""
    for stage in iterate_stage_pictures(view.stored_facade(index)):
        if stage.viewer is not None and stage.viewer.name == name:
            return stage.draw()
    raise InputError(f"{view.tables.facades.id[index]}: no picture of stage {name}")


def read_previous_picture(view: RunView, index: int) -> bytes:
    """How facade number `index` was at the capture before, a WebP file. Raises InputError where that is not kept."""
    record = view.records[index]
    if record is None or "before_file" not in record:
        raise InputError(f"{view.tables.facades.id[index]}: no picture of how it was before")
    return read_stored_file(view.group, record["before_file"], record["before_digest"])


def encode_picture(image: UInt8Array, kind: str = "WEBP", quality: int = 85) -> bytes:
    """An image (h, w, 3) uint8 as a file's bytes."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, kind, quality=quality)
    return buffer.getvalue()
