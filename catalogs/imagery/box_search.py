"""Search of boxes by quarters, for services that limit the number of pictures in an answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain

from catalogs.features import Fault
from catalogs.imagery.http_client import redact_url
from catalogs.imagery.remote_panorama import LonLatBox, panorama_fault
from catalogs.imagery.settings import SERVICES
from facade_core.core.json_types import JsonObject


def search_boxes_by_quarters(
    boxes: Iterable[LonLatBox], search: Callable[[LonLatBox], Iterator[JsonObject | Fault]]
) -> Iterator[JsonObject | Fault]:
    """Yield all results of a search in boxes, each id once.

    If an answer has a multiple of SERVICES.limit_multiple records, it may be incomplete: the quarters of its box are searched
    too.

    Parameters
    ----------
    boxes : (west, south, east, north) in degrees.
    search : yields records, and faults in place of unusable records.
    """
    known: set[str] = set()
    for one in chain.from_iterable(_search_box(box, search, 0) for box in boxes):
        identifier = one.id if isinstance(one, Fault) else str(one.get("id") or "")
        if identifier in known and identifier:
            continue
        known.add(identifier)
        yield one


def join_pages(pages: Iterable[Sequence[JsonObject]], api: str) -> Iterator[JsonObject | Fault]:
    """Yield the records of the pages of a search, each id once; pages without end stop with a fault.

    Parameters
    ----------
    pages : records of each page.
    api : address of the service.
    """
    known: set[str] = set()
    for number, records in enumerate(pages, 1):
        fresh = [record for record in records if str(record.get("id")) not in known]
        if number > SERVICES.max_pages or (records and not fresh):
            reason = f"there are over {SERVICES.max_pages} pages" if fresh else f"page {number} brings nothing new"
            yield panorama_fault(
                redact_url(api),
                f"pages without end ({reason}); what came before is used: fetch smaller boxes, and tell its service",
            )
            return
        known |= {str(record.get("id")) for record in fresh}
        yield from fresh


def _search_box(
    box: LonLatBox, search: Callable[[LonLatBox], Iterator[JsonObject | Fault]], depth: int
) -> Iterator[JsonObject | Fault]:
    count, faulty = 0, False
    for one in search(box):
        count += not isinstance(one, Fault)
        faulty |= isinstance(one, Fault)
        yield one
    if faulty or not count or count % SERVICES.limit_multiple:
        return
    if depth == SERVICES.max_quartering_depth:
        yield panorama_fault(
            " ".join(f"{value:g}" for value in box), f"has over {count} pictures; fetch the others with --dates"
        )
        return
    west, south, east, north = box
    across, up = (west + east) / 2, (south + north) / 2
    for quarter in (
        (west, south, across, up),
        (across, south, east, up),
        (west, up, across, north),
        (across, up, east, north),
    ):
        yield from _search_box(quarter, search, depth + 1)
