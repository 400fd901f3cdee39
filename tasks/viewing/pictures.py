"""Stage pictures of a facade, drawn from the store on request."""

from __future__ import annotations

import io

from facade_core.atlas.stored_files import read_stored_file
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.export.pictures.stage_pictures import StageTitle, iterate_stage_pictures
from tasks.viewing.run_view import RunView


def list_stage_pictures(view: RunView, index: int) -> list[StageTitle]:
    """List the stages with pictures of a facade in their order; empty until it is done."""
    return [stage.viewer for stage in iterate_stage_pictures(view.open_facade(index)) if stage.viewer is not None]


def draw_stage_picture(view: RunView, index: int, name: str) -> UInt8Array:
    """Draw a stage's picture (h, w, 3) uint8.

    Parameters
    ----------
    view : snapshot of the run.
    index : index of the facade.
    name : name of a stage from `list_stage_pictures`.

    Raises
    ------
    InputError : the facade has no such picture.
    """
    for stage in iterate_stage_pictures(view.open_facade(index)):
        if stage.viewer is not None and stage.viewer.name == name:
            return stage.draw()
    raise InputError(f"{view.tables.facades.id[index]}: no picture of stage {name}")


def read_previous_capture_picture(view: RunView, index: int) -> bytes:
    """Return the WebP file of a facade at the previous capture.

    Raises
    ------
    InputError : the store has no such picture.
    """
    record = view.records[index]
    if record is None or "before_file" not in record:
        raise InputError(f"{view.tables.facades.id[index]}: no picture of how it was before")
    return read_stored_file(view.group, record["before_file"], record["before_digest"])


def encode_picture(image: UInt8Array, kind: str = "WEBP", quality: int = 85, *, max_height: int | None = None) -> bytes:
    """Encode an image (h, w, 3) uint8 as a file's bytes, at most `max_height` pixels high."""
    from PIL import Image

    buffer = io.BytesIO()
    picture = Image.fromarray(image)
    if max_height is not None:
        picture.thumbnail((image.shape[1], max_height))
    picture.save(buffer, kind, quality=quality)
    return buffer.getvalue()
