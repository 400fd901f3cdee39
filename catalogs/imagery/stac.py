"""Panoramas of a STAC API such as Panoramax.

Items have a point, view:azimuth and the field of view of the perspective imagery extension.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

import pystac_client
from pystac.link import HREF
from pystac_client import Client
from pystac_client.stac_api_io import StacApiIO

from catalogs.features import Fault
from catalogs.imagery.box_search import join_pages, search_boxes_by_quarters
from catalogs.imagery.http_client import HttpClient, RequestRejectedError, redact_url
from catalogs.imagery.remote_panorama import (
    FULL_TURN_DEG,
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
from catalogs.reader_errors import fault_reason, is_system_error, short_message
from catalogs.readers.cityjson.values import mapping_or_empty
from catalogs.readers.pictures.source_poses import parse_iso_date
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

# Names of the asset with the picture at full size.
_FULL_SIZE_ASSETS = ("hd", "data", "visual", "image")
# How far outside a small box a picture may lie that belongs to the answer, about 10 m.
MIN_BOX_MARGIN_DEG = 1e-4


def search_stac(client: HttpClient, api: str, query: PanoramaQuery) -> Iterator[RemotePanorama | Fault]:
    """Yield a STAC API's panoramas for a query, and a fault for each unusable one.

    Flat pictures are skipped. Searches that may be incomplete are repeated by quarters of the box.

    Raises
    ------
    InputError : the API cannot be searched.
    """
    try:
        stac_client = pystac_client.Client.open(api, stac_io=_stac_io(client))
        search = _box_search(stac_client, query.dates)
        for item in search_boxes_by_quarters([query.box], search):
            found = _parse_item(item, query.licence)
            if found is not None:
                yield found
    except InputError:
        raise
    except Exception as error:  # pystac raises errors of any kind for invalid answers
        if is_system_error(error):
            raise
        raise InputError(
            f"{redact_url(api)} is no STAC API that can be searched ({short_message(error)}); check the address"
        ) from error


def _box_search(client: Client, dates: str | None) -> Callable[[LonLatBox], Iterator[JsonObject | Fault]]:
    """Return a function that searches a box page by page."""

    def search(box: LonLatBox) -> Iterator[JsonObject | Fault]:
        # GET: services differ in their answers to POST
        pages = client.search(
            method="GET", bbox=list(box), datetime=dates, limit=SERVICES.stac_page_size
        ).pages_as_dicts()
        items = ([item for item in page.get("features") or () if isinstance(item, dict)] for page in pages)
        api, elsewhere = client.get_self_href() or "", 0
        for item in join_pages(items, api):
            if isinstance(item, Fault) or _lies_near(item, box):
                yield item
            else:
                elsewhere += 1
        if elsewhere:  # a fault: quarters would be answered alike
            reason = f"ignores the box: {elsewhere} of its pictures lie elsewhere and are left out; tell its service"
            yield panorama_fault(redact_url(api), reason)

    return search


def _lies_near(item: JsonObject, box: LonLatBox) -> bool:
    """Report whether a picture lies in a box or near it; True if its place cannot be read."""
    place = mapping_or_empty(item.get("geometry")).get("coordinates")
    if not isinstance(place, list) or len(place) < 2:
        return True
    lon, lat = (finite_float_or_none(value) for value in place[:2])
    if lon is None or lat is None or abs(lon) > 180.0 or abs(lat) > 90.0:
        return True
    west, south, east, north = box
    margin = max(east - west, north - south, MIN_BOX_MARGIN_DEG)
    return west - margin <= lon <= east + margin and south - margin <= lat <= north + margin


def _parse_item(item: JsonObject | Fault, licence: str | None) -> RemotePanorama | Fault | None:
    """Parse an item; a fault if the panorama cannot be used, None if the picture is no panorama."""
    if isinstance(item, Fault):
        return item
    identifier = str(item.get("id") or "")
    try:
        return _parse_panorama(identifier, item, licence)
    except ValueError as error:
        return panorama_fault(identifier, str(error))
    except Exception as error:  # values of any other type than STAC's
        return panorama_fault(identifier, fault_reason(error, "tell its service"))


def _parse_panorama(identifier: str, item: JsonObject, licence: str | None) -> RemotePanorama | None:
    """Parse an item; None if the picture is no panorama. Raises ValueError with the remedy if it cannot be used."""
    properties = mapping_or_empty(item.get("properties"))
    inner = mapping_or_empty(properties.get("pers:interior_orientation"))
    if (finite_float_or_none(inner.get("field_of_view")) or 0.0) < FULL_TURN_DEG:
        return None
    asset = _picture_asset(item.get("assets"))
    pose = parse_geojson_pose(
        item.get("geometry"), _parse_heading(properties), *(properties.get(f"pers:{a}") for a in ("pitch", "roll"))
    )
    links = [link for link in item.get("links") or () if isinstance(link, Mapping) and link.get("rel") == "license"]
    text = str(links[0].get("href")) if links else None
    rights = resolve_licence(properties.get("license"), text, licence)
    if not identifier:
        raise ValueError("has no id; tell its service")
    return RemotePanorama(
        identifier,
        str(asset["href"]),
        pose,
        captured=parse_iso_date(properties.get("datetime")),
        author=_provider_names(item, properties),
        licence=rights,
        licence_url=text,
        size=image_size(inner.get("sensor_array_dimensions")),
        sha256=_checksum_sha256(asset.get("file:checksum")),
    )


def _parse_heading(properties: JsonObject) -> object:
    """Return view:azimuth, which GeoVisio rounds to degrees, or the exact EXIF tag if both agree."""
    heading, exif = properties.get("view:azimuth"), properties.get("exif")
    tag = exif.get("Exif.GPSInfo.GPSImgDirection") if isinstance(exif, Mapping) else None
    stated = finite_float_or_none(heading)
    try:
        exact = float(Fraction(tag)) if isinstance(tag, str) else None
    except (ValueError, ZeroDivisionError, OverflowError):
        return heading
    if stated is None or exact is None:
        return heading
    return exact if abs((exact - stated + 180.0) % 360.0 - 180.0) <= 0.5 else heading


def _picture_asset(assets: object) -> JsonObject:
    """Return the asset of the picture at full size. Raises ValueError if there is none."""
    named = [(name, asset) for name, asset in mapping_or_empty(assets).items() if mapping_or_empty(asset).get("href")]
    pictures = [(name, asset) for name, asset in named if str(asset.get("type", "image/")).startswith("image/")]
    if not pictures:
        raise ValueError("names no picture; tell its service")
    best: JsonObject = min(pictures, key=lambda one: _asset_preference(*one))[1]
    return best


def _asset_preference(name: str, asset: JsonObject) -> tuple[object, ...]:
    """Return a key that is least for the best asset: of the role data, JPEG, of the best name."""
    return "data" not in (asset.get("roles") or ()), asset.get("type") != "image/jpeg", _asset_rank(name)


def _asset_rank(name: str) -> tuple[int, str]:
    return (_FULL_SIZE_ASSETS.index(name) if name in _FULL_SIZE_ASSETS else len(_FULL_SIZE_ASSETS), name)


def _provider_names(item: JsonObject, properties: JsonObject) -> str | None:
    providers = item.get("providers") or properties.get("providers") or ()
    names = [str(one["name"]) for one in providers if isinstance(one, Mapping) and one.get("name")]
    return "; ".join(dict.fromkeys(names))[:200] or None


def _checksum_sha256(checksum: object) -> str | None:
    """Return the digest of a hexadecimal sha2-256 multihash; None for other hashes."""
    found = re.fullmatch(r"1220([0-9a-f]{64})", checksum) if isinstance(checksum, str) else None
    return found[1] if found else None


def _stac_io(client: HttpClient) -> StacApiIO:

    class Io(StacApiIO):
        """Requests by `HttpClient`: pystac-client's own log the token, open local files, and have no limits."""

        def read_text(self, source: HREF, *args: object, **kwargs: object) -> str:
            if isinstance(source, str) and "://" not in source:
                raise RequestRejectedError(f"{source[:80]} is no address; tell its service")
            return super().read_text(source, *args, **kwargs)

        def request(
            self,
            href: str,
            method: str | None = None,
            headers: dict[str, str] | None = None,
            parameters: JsonObject | None = None,
        ) -> str:
            if (method or "GET").upper() == "POST":
                return client.fetch_text(href, body=parameters or {})
            return client.fetch_text(href, params=parameters or None)

    return Io()
