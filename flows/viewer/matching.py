"""What the viewer's page asks to decide which walls photos show: these addresses are there with `--edit --photos` alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from catalogs.readers.pictures.decoding import read_picture
from facade_core.core.errors import InputError
from flows.viewer.editing import Editor, authorize_read, authorize_write
from tasks.corrections import block_of
from tasks.matching.table import TABLE, Decision, Match, alone, decided, read_table, write_table
from tasks.matching.taking import take, taking
from tasks.viewing import Reader
from tasks.viewing.pictures import encode

# The longer side of a photo as it is shown, pixels.
MAX_PHOTO_SIDE = 1600


def match_routes(reader: Reader, editor: Editor, photos: Path) -> list[Route]:
    """The addresses for who decides which walls the photos in a folder show; what they say goes into the table beside the block
    file, and the way of `streetloom match --take`."""

    def all_of() -> dict[str, Any]:
        return {"photos": [_match_row(match) for match in read_table(block_of(reader.out).parent / TABLE).matches()]}

    def picture(request: Request) -> Response:
        name = request.query_params.get("name", "")
        if not any(match.photo == name for match in read_table(block_of(reader.out).parent / TABLE).matches()):
            raise InputError(f"the table has no photo {name!r}")
        if name != Path(name).name or not (photos / name).is_file():
            raise InputError(f"there is no photo {name!r} in {photos}")
        image = read_picture(photos / name, max_side=MAX_PHOTO_SIDE).rgb
        return Response(encode(image, "JPEG"), media_type="image/jpeg", headers={"Cache-Control": "no-store"})

    def save(body: Any) -> dict[str, Any]:
        block = block_of(reader.out)
        path = block.parent / TABLE
        with alone(path):
            decisions = _parse_decisions(body)
            table = decided(read_table(path), decisions, who=editor.who)
            # what is decided is checked before anything is written; other rows that are wrong are told
            found = taking(block, photos, table, {one.photo for one in decisions})
            write_table(table)
            by_hand = take(found)
        notes = [f"not taken: {fault}" for fault in found.faults]
        notes += [f"write into the block file: {by_hand}"] if by_hand else []
        return {"said": f"{found.count} photos are the block's; what depends on them is due", "notes": notes} | all_of()

    return [
        Route("/edit/matches", authorize_read(editor, lambda request: all_of())),
        Route("/edit/photo", authorize_read(editor, picture)),
        Route("/edit/decisions", authorize_write(editor, save), methods=["POST"]),
    ]


def _match_row(match: Match) -> dict[str, Any]:
    return {
        "photo": match.photo,
        "facade": match.facade,
        "by": match.by,
        "candidates": [{"id": one.facade, "probability": one.probability, "why": one.why} for one in match.candidates],
        "place": match.place,
        "heading": match.heading,
    }


def _parse_decisions(body: Any) -> list[Decision]:
    """Raises ValueError for what the page does not send."""
    try:
        return [
            Decision(_require_text(one["photo"]), _require_text(one["facade"]), one["decided"] is True, (_require_text(facade), _require_text(by)))
            for one in body["decisions"]
            for facade, by in [one["stood"]]
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            'what is saved is {"decisions": [{"photo", "facade", "decided", "stood": [FACADE, BY]}]}'
        ) from error


def _require_text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value
