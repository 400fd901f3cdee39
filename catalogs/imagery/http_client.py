"""HTTP client with limits on time and size, retries, and a token that is sent to its host only."""

from __future__ import annotations

import email.utils
import hashlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Lock, Thread
from typing import TYPE_CHECKING, NamedTuple, TypeVar
from urllib.parse import urljoin, urlsplit

from catalogs.imagery.settings import SERVICES
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    from requests import PreparedRequest, Response, Session

T = TypeVar("T")

_RETRY_STATUS_CODES = frozenset((408, 425, 429, 500, 502, 503, 504))
# Redirects after which a POST stays one.
_SAME_METHOD_STATUS_CODES = frozenset((307, 308))
_PIECE_BYTES = 1 << 16


class RequestRejectedError(InputError):
    """Answer that a retry would not change: missing, too large, or forbidden."""


class ServiceUnavailableError(InputError):
    """Service that did not answer after all retries; a later run may succeed."""


@dataclass(frozen=True)
class ServiceToken:
    """Token of a user: sent in a header to `host` (with its port) only, and never shown."""

    host: str
    header: str = field(repr=False)

    def __call__(self, request: PreparedRequest) -> PreparedRequest:
        if urlsplit(str(request.url)).netloc.lower() == self.host:
            request.headers["Authorization"] = self.header  # requests removes it on redirects to another host
        return request


class _Refusal(NamedTuple):
    status: int
    retry_after: str | None


@dataclass
class HttpClient:
    """Requests to one service, from any thread; `sleep` makes a pause."""

    token: ServiceToken | None = None
    sleep: Callable[[float], None] = time.sleep
    _session: Session | None = None
    _not_before: float = 0.0
    _lock: Lock = field(default_factory=Lock)

    def fetch_text(self, url: str, *, params: Mapping[str, str] | None = None, body: JsonObject | None = None) -> str:
        """Return the text of an answer to GET, or to POST if there is a JSON body.

        Raises
        ------
        RequestRejected, ServiceUnavailable : see there.
        """

        def read(response: Response) -> str:
            return b"".join(_read_pieces(response, SERVICES.max_page_bytes, url)).decode("utf-8", "replace")

        return self._request(url, read, params=params, body=body)

    def download(self, url: str, path: Path) -> str:
        """Write a picture to `path` atomically, and return its sha256.

        Raises
        ------
        RequestRejected, ServiceUnavailable : see there.
        """
        part = path.with_name(f".{path.name}.part")

        def write(response: Response) -> str:
            digest = hashlib.sha256()
            with part.open("wb") as file:
                for piece in _read_pieces(response, SERVICES.max_picture_bytes, url):
                    digest.update(piece)
                    file.write(piece)
            return digest.hexdigest()

        try:
            digest = self._request(url, write)
            os.replace(part, path)
            return digest
        finally:
            part.unlink(missing_ok=True)

    def _request(
        self,
        url: str,
        use: Callable[[Response], T],
        *,
        params: Mapping[str, str] | None = None,
        body: JsonObject | None = None,
    ) -> T:
        import requests

        where = redact_url(url)
        if urlsplit(url).scheme not in ("http", "https"):
            raise RequestRejectedError(f"{where} is no address of http or https; tell its service")
        problem = ""
        for attempt in range(SERVICES.max_attempts):
            self._wait_until_allowed()
            try:
                answer = _call_within_time_limit(partial(self._exchange, url, use, params, body))
                if not isinstance(answer, _Refusal):
                    return answer
                problem = f"answers {answer.status}"
                if answer.status not in _RETRY_STATUS_CODES:
                    raise RequestRejectedError(f"{where} {problem}; {_remedy(answer.status, url, self.token)}")
                wait = _parse_retry_after(answer.retry_after)
            except (requests.ConnectionError, requests.Timeout, requests.exceptions.ChunkedEncodingError) as error:
                problem, wait = f"cannot be read ({_error_name(error)})", None
            except requests.TooManyRedirects:
                raise RequestRejectedError(
                    f"{where} leads to another address {SERVICES.max_redirects} times over; tell its service"
                ) from None
            except requests.RequestException as error:
                raise RequestRejectedError(
                    f"{where} cannot be asked ({_error_name(error)}); check the address"
                ) from None
            if wait is not None and wait > SERVICES.max_wait_s:
                raise ServiceUnavailableError(
                    f"{where} {problem} and wants a pause of {wait:.0f} s; run again after that"
                )
            self._delay_requests(SERVICES.initial_wait_s * 2**attempt if wait is None else wait)
        raise ServiceUnavailableError(
            f"{where} {problem}, {SERVICES.max_attempts} times; run again later: downloaded files are kept"
        )

    def _exchange(
        self, url: str, use: Callable[[Response], T], params: Mapping[str, str] | None, body: JsonObject | None
    ) -> T | _Refusal:
        """Send a request, and use its answer. The body of a redirect is not read, which requests would do without a limit."""
        import requests

        session = self._get_session()
        for _ in range(SERVICES.max_redirects + 1):
            response = session.request(
                "GET" if body is None else "POST",
                url,
                params=params,
                json=body,
                auth=self.token,
                timeout=(SERVICES.connect_timeout_s, SERVICES.read_timeout_s),
                stream=True,
            )
            try:
                if (target := requests.Session.get_redirect_target(session, response)) is None:
                    return (
                        use(response)
                        if response.ok
                        else _Refusal(response.status_code, response.headers.get("Retry-After"))
                    )
            finally:
                response.close()
            url, params = urljoin(url, target), None
            if response.status_code not in _SAME_METHOD_STATUS_CODES:
                body = None
        raise requests.TooManyRedirects

    def _get_session(self) -> Session:
        import requests

        from catalogs.imagery import USER_AGENT

        class SingleRequestSession(requests.Session):
            """Session that follows no redirect: requests would read its whole body first."""

            def get_redirect_target(self, resp: Response) -> None:
                return None

        with self._lock:
            if self._session is None:
                self._session = SingleRequestSession()
                self._session.headers["User-Agent"] = USER_AGENT
                self._session.headers["Accept-Encoding"] = "identity"  # Content-Length then equals the file's size
            return self._session

    def _delay_requests(self, seconds: float) -> None:
        with self._lock:
            self._not_before = max(self._not_before, time.monotonic() + seconds)

    def _wait_until_allowed(self) -> None:
        """Wait out a pause that the service asked for; all threads wait."""
        left = self._not_before - time.monotonic()
        if left > 0:
            self.sleep(left)


def _call_within_time_limit(function: Callable[[], T]) -> T:
    """Call a function in a thread, up to SERVICES.total_timeout_s; a service may send its headers byte by byte for ever.

    The thread of a call that takes longer is left behind: it ends with the process, or once the service sends a piece.
    """
    import requests

    ended: Future[T] = Future()

    def call() -> None:
        try:
            ended.set_result(function())
        except BaseException as error:
            ended.set_exception(error)

    Thread(target=call, name="request", daemon=True).start()
    try:
        return ended.result(SERVICES.total_timeout_s)
    except TimeoutError:
        raise requests.Timeout("too slow") from None


def redact_url(url: str) -> str:
    """Return an address for messages, without user name and query, which may hold a signature."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"[:120]


def _read_pieces(response: Response, max_bytes: int, url: str) -> Iterator[bytes]:
    """Yield the bytes of an answer, up to `max_bytes` and SERVICES.total_timeout_s."""
    import requests

    ends, total = time.monotonic() + SERVICES.total_timeout_s, 0
    stated = response.headers.get("Content-Length", "")
    length = int(stated) if stated.isdecimal() else None
    if length is not None and length > max_bytes:
        raise RequestRejectedError(
            f"{redact_url(url)} has {length / 1e6:.0f} MB, over {max_bytes / 1e6:.0f}; take a smaller one by hand"
        )
    for piece in response.iter_content(_PIECE_BYTES):
        total += len(piece)
        if total > max_bytes:
            raise RequestRejectedError(
                f"{redact_url(url)} has over {max_bytes / 1e6:.0f} MB; take a smaller one by hand"
            )
        if time.monotonic() > ends:
            raise requests.Timeout("too slow")
        yield piece
    if length is not None and total < length:
        raise requests.ConnectionError(f"{total} of {length} bytes")


def _parse_retry_after(header: str | None) -> float | None:
    """Return the seconds of a Retry-After header, a number or a date; None if there is none."""
    if header is None:
        return None
    if header.strip().isdecimal():
        return float(header)
    try:
        return max(0.0, email.utils.parsedate_to_datetime(header).timestamp() - time.time())
    except ValueError:
        return None


def _remedy(status: int, url: str, token: ServiceToken | None) -> str:
    if status in (401, 403):
        if token is None:
            return "it wants a token; set STREETLOOM_IMAGERY_TOKEN"
        if urlsplit(url).netloc.lower() != token.host:  # another host serves pictures by signed, expiring addresses
            return "its address is no longer good; run again"
        return "its token is refused; renew it"
    return "it is gone, or never was there" if status in (404, 410) else "check the address"


def _error_name(error: Exception) -> str:
    """Return the kind of a request's error, without its address."""
    text = str(error)
    known = (("refused", "connection refused"), ("resolve", "unknown host"), ("timed out", "timed out"),
             ("too slow", "too slow"), ("bytes", "cut off"), ("IncompleteRead", "cut off"))  # fmt: skip
    return next((words for sign, words in known if sign in text), type(error).__name__)
