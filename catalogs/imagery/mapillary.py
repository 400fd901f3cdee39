"""Panoramas of Mapillary's Graph API (version 4), which needs a user's token."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

from catalogs.features import Fault
from catalogs.imagery.box_search import join_pages, search_boxes_by_quarters
from catalogs.imagery.http_client import HttpClient, RequestRejectedError, redact_url
from catalogs.imagery.remote_panorama import (
    LonLatBox,
    PanoramaQuery,
    RemotePanorama,
    finite_float_or_none,
    image_size,
    panorama_fault,
    parse_geojson_pose,
    resolve_licence,
)
from catalogs.imagery.settings import SERVICES
from catalogs.reader_errors import short_message
from catalogs.readers.pictures.camera_angles import camera_angles_from_rotation
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

MAPILLARY_API = "https://graph.mapillary.com"
# Licence of all pictures by Mapillary's terms of use; answers do not state it.
LICENCE, LICENCE_URL = "CC-BY-SA-4.0", "https://creativecommons.org/licenses/by-sa/4.0/"
FIELDS = (
    "id", "camera_type", "is_pano", "captured_at", "computed_geometry", "geometry", "computed_compass_angle", "compass_angle",
    "computed_rotation", "creator", "width", "height", "thumb_original_url",
)  # fmt: skip
_FULL_SPHERE_TYPES = ("spherical", "equirectangular")


def search_mapillary(client: HttpClient, api: str, query: PanoramaQuery) -> Iterator[RemotePanorama | Fault]:
    """Yield Mapillary's panoramas for a query, and a fault for each unusable one.

    Flat pictures are skipped.

    Raises
    ------
    InputError : no token, or an invalid answer.
    """
    if client.token is None:
        raise InputError("Mapillary wants a token: set STREETLOOM_IMAGERY_TOKEN to one of your own account's (MLY|...)")
    for record in search_boxes_by_quarters(
        _split_box(query.box), lambda box: join_pages(_search_pages(client, api, box, query.dates), api)
    ):
        found = record if isinstance(record, Fault) else _parse_record(record)
        if found is not None:
            yield found


def _split_box(box: LonLatBox) -> Iterator[LonLatBox]:
    """Split a box into boxes of at most SERVICES.max_box_side_deg."""
    west, south, east, north = box
    across, up = (
        max(1, -int(-(east - west) // SERVICES.max_box_side_deg)),
        max(1, -int(-(north - south) // SERVICES.max_box_side_deg)),
    )
    for row in range(up):
        for column in range(across):
            yield (
                west + (east - west) * column / across,
                south + (north - south) * row / up,
                west + (east - west) * (column + 1) / across,
                south + (north - south) * (row + 1) / up,
            )


def _search_pages(client: HttpClient, api: str, box: LonLatBox, dates: str | None) -> Iterator[list[JsonObject]]:
    """Yield the records of each page of a search."""
    first, last = _time_span(dates)
    url = f"{api.rstrip('/')}/images"
    params: Mapping[str, str] | None = {
        "bbox": ",".join(f"{value:.7f}" for value in box),
        "is_pano": "true",
        "fields": ",".join(FIELDS),
        "limit": str(SERVICES.max_pictures_per_page),
        **({"start_captured_at": first} if first else {}),
        **({"end_captured_at": last} if last else {}),
    }
    while url:
        content = _parse_answer(client.fetch_text(url, params=params), api)
        records = [one for one in content["data"] if isinstance(one, dict)]
        yield records
        paging = content.get("paging")
        following = paging.get("next") if isinstance(paging, Mapping) and records else None
        url, params = _strip_token(following) if isinstance(following, str) else "", None


def _strip_token(url: str) -> str:
    """Remove the token from a next page's address: addresses are logged."""
    parts = urlsplit(url)
    asked = [(name, value) for name, value in parse_qsl(parts.query) if name != "access_token"]
    return urlunsplit(parts._replace(query=urlencode(asked)))


def _parse_answer(text: str, api: str) -> JsonObject:
    try:
        content = json.loads(text)
    except ValueError:
        content = None
    if not isinstance(content, dict) or not isinstance(content.get("data"), list):
        raise RequestRejectedError(f"{redact_url(api)} answers with no list of pictures; check the address")
    return content


def _time_span(dates: str | None) -> tuple[str | None, str | None]:
    """Return the first and last moment of a span of days; None for an open end."""
    first, _, last = (dates or "../..").partition("/")
    return (None if first == ".." else f"{first}T00:00:00Z"), (None if last == ".." else f"{last}T23:59:59Z")


def _capture_day(milliseconds: object) -> str | None:
    taken = finite_float_or_none(milliseconds)
    return datetime.fromtimestamp(taken / 1000, UTC).date().isoformat() if taken and 0 < taken < 1e14 else None


def _author(creator: object) -> str | None:
    return str(creator.get("username") or creator.get("id") or "") or None if isinstance(creator, Mapping) else None


def _parse_record(record: JsonObject) -> RemotePanorama | Fault | None:
    identifier = str(record.get("id") or "")
    kind = str(record.get("camera_type") or "")
    if record.get("is_pano") is False or kind in ("perspective", "brown"):
        return None
    try:
        if kind not in ("", *_FULL_SPHERE_TYPES):
            raise ValueError(f"is a {kind} picture said to be a panorama; leave it out")
        url = record.get("thumb_original_url")
        if not identifier or not isinstance(url, str):
            raise ValueError("names no picture; tell its service")
        # reconstructed values if available, otherwise those of the camera's sensors
        angles = [record.get("computed_compass_angle", record.get("compass_angle"))]
        if record.get("computed_rotation"):
            angles = [*camera_angles_from_rotation(record["computed_rotation"])]
        pose = parse_geojson_pose(record.get("computed_geometry") or record.get("geometry"), *angles)
        rights = resolve_licence(LICENCE, LICENCE_URL, None)
    except (ValueError, TypeError) as error:
        return panorama_fault(identifier, short_message(error))
    return RemotePanorama(
        identifier,
        url,
        pose,
        captured=_capture_day(record.get("captured_at")),
        author=_author(record.get("creator")),
        licence=rights,
        licence_url=LICENCE_URL,
        size=image_size([record.get("width"), record.get("height")]),
    )
