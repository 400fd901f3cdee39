"""Endpoints of the viewer that match photos to walls; only `--edit --photos` serves them."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from catalogs.block.corrections import lock_input_folder
from catalogs.printable_text import format_count
from catalogs.readers.pictures.decoding import read_picture
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from flows.viewer.editing import EditorUser, editor_read_endpoint, editor_write_endpoint
from tasks.corrections.correction_import import find_run_block_file
from tasks.matching.match_table import (
    TABLE,
    MatchDecision,
    PhotoMatch,
    apply_decisions,
    read_match_table,
    write_match_table,
)
from tasks.matching.photo_import import import_photos, plan_photo_import
from tasks.viewing.pictures import encode_picture
from tasks.viewing.run_view import RunReader

# Longer side of a displayed photo, pixels.
MAX_PHOTO_SIDE = 1600


def photo_match_routes(reader: RunReader, editor: EditorUser, photos: Path) -> list[Route]:
    """Return the HTTP routes that show and decide the matches of a folder of photos.

    Decisions go into the table in the folder of the block file, then through `streetloom match --take`.
    """

    def all_matches() -> JsonObject:
        return {
            "photos": [
                _match_row(match)
                for match in read_match_table(find_run_block_file(reader.out).parent / TABLE).matches()
            ]
        }

    def picture(request: Request) -> Response:
        name = request.query_params.get("name", "")
        if not any(
            match.photo == name for match in read_match_table(find_run_block_file(reader.out).parent / TABLE).matches()
        ):
            raise InputError(f"the table has no photo {name!r}")
        if name != Path(name).name or not (photos / name).is_file():
            raise InputError(f"there is no photo {name!r} in {photos}")
        image = read_picture(photos / name, max_side=MAX_PHOTO_SIDE).rgb
        return Response(encode_picture(image, "JPEG"), media_type="image/jpeg", headers={"Cache-Control": "no-store"})

    def save(body: object) -> JsonObject:
        block = find_run_block_file(reader.out)
        path = block.parent / TABLE
        with lock_input_folder(path.parent):
            decisions = _parse_decisions(body)
            table = apply_decisions(read_match_table(path), decisions, who=editor.who)
            # check the decided rows before any write; faults of other rows are only reported
            found = plan_photo_import(block, photos, table, {row.photo for row in decisions})
            write_match_table(table)
            by_hand = import_photos(found)
        notes = [f"not taken: {fault}" for fault in found.faults]
        notes += [f"write into the block file: {by_hand}"] if by_hand else []
        return {
            "said": f"{format_count(found.count, 'photo')} taken into the block; what depends on them is pending",
            "notes": notes,
        } | all_matches()

    return [
        Route("/edit/matches", editor_read_endpoint(editor, lambda request: all_matches())),
        Route("/edit/photo", editor_read_endpoint(editor, picture)),
        Route("/edit/decisions", editor_write_endpoint(editor, save), methods=["POST"]),
    ]


def _match_row(match: PhotoMatch) -> JsonObject:
    return {
        "photo": match.photo,
        "facade": match.facade,
        "by": match.decided_by,
        "candidates": [{"id": row.facade, "probability": row.probability, "why": row.why} for row in match.candidates],
        "place": match.place,
        "heading": match.heading,
    }


def _parse_decisions(body: object) -> list[MatchDecision]:
    """Parse the decisions that the page sends. Raises ValueError where they are malformed."""
    try:
        return [
            MatchDecision(
                _require_text(row["photo"]),
                _require_text(row["facade"]),
                row["decided"] is True,
                (_require_text(facade), _require_text(by)),
            )
            for row in cast(JsonObject, body)["decisions"]
            for facade, by in [row["stood"]]
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            'what is saved is {"decisions": [{"photo", "facade", "decided", "stood": [FACADE, BY]}]}'
        ) from error


def _require_text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value
