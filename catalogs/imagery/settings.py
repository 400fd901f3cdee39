"""Numbers of the requests to services of pictures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ServiceLimits:
    """Limits of requests to services of pictures.

    Attributes
    ----------
    limit_multiple : An answer with a multiple of this many pictures may be cut off at the service's own
        limit.
    max_quartering_depth : Levels of quarters: at the last one, a side is 1 / 256 of the box, some metres of a
        block.
    max_downloads : Concurrent downloads from one service.
    max_consecutive_failures : After this many failures in a row the service counts as unavailable.
    connect_timeout_s : time to connect.
    read_timeout_s : Time between two pieces of an answer.
    total_timeout_s : Time of a whole answer.
    max_picture_bytes : About the size of a JPEG of 160 megapixels.
    max_page_bytes : page of a search.
    max_attempts : attempts of a request.
    initial_wait_s : Wait before the second attempt; each further wait is twice as long.
    max_wait_s : If a service demands a longer pause, the run ends; another run resumes.
    max_redirects : redirects of a request.
    max_pictures_per_page : limit of the API of Mapillary.
    max_box_side_deg : The API accepts boxes of up to 0.01 square degrees.
    stac_page_size : Items of a page.
    max_pages : Pages of a search; larger results need a smaller box.
    """

    limit_multiple: int = 100
    max_quartering_depth: int = 8
    max_downloads: int = 4
    max_consecutive_failures: int = 8
    connect_timeout_s: float = 10.0
    read_timeout_s: float = 60.0
    total_timeout_s: float = 600.0
    max_picture_bytes: int = 150_000_000
    max_page_bytes: int = 40_000_000
    max_attempts: int = 5
    initial_wait_s: float = 1.0
    max_wait_s: float = 300.0
    max_redirects: int = 5
    max_pictures_per_page: int = 2000
    max_box_side_deg: float = 0.05
    stac_page_size: int = 1000
    max_pages: int = 100


SERVICES = ServiceLimits()
