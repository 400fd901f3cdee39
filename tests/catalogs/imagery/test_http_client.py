"""Requests: asked again where a service says so, bounded, and a token for its own host alone."""

from __future__ import annotations

import time
from dataclasses import replace
from email.utils import formatdate
from pathlib import Path

import pytest

from benchmarks.imagery_server import Imagery, serving
from catalogs.imagery import http_client
from catalogs.imagery.http_client import HttpClient, RequestRejectedError, ServiceToken, ServiceUnavailableError
from catalogs.imagery.services import TOKEN_VARIABLE, resolve_service, stac_service
from catalogs.imagery.settings import SERVICES
from facade_core.core.errors import InputError


def test_a_service_that_is_busy_is_asked_again_after_the_pause_that_it_wants(served: Imagery) -> None:
    answers = [
        (503, {"Retry-After": "150"}, b""),
        (429, {"Retry-After": formatdate(time.time() + 280, usegmt=True)}, b""),
    ]
    served.faults["/x"] = lambda *_: answers.pop(0) if answers else (200, {}, b"here")
    slept: list[float] = []
    assert HttpClient(sleep=slept.append).fetch_text(f"{served.address}/x") == "here"
    assert served.asked["/x"] == 3
    assert 0 < slept[0] <= 150 < slept[1] <= 280


def test_a_service_that_stays_away_is_left_after_a_few_attempts(served: Imagery) -> None:
    served.faults["/x"] = lambda *_: (502, {}, b"")
    with pytest.raises(ServiceUnavailableError, match=r"^http://127.0.0.1:\d+/x answers 502, 5 times; run again later"):
        HttpClient(sleep=lambda _: None).fetch_text(f"{served.address}/x", params={"access_token": "secret"})
    assert served.asked["/x"] == SERVICES.max_attempts
    served.faults["/x"] = lambda *_: (429, {"Retry-After": "86400"}, b"")
    with pytest.raises(ServiceUnavailableError, match="wants a pause of 86400 s; run again after that"):
        HttpClient().fetch_text(f"{served.address}/x")
    with pytest.raises(ServiceUnavailableError, match="connection refused"):
        HttpClient(sleep=lambda _: None).fetch_text("http://127.0.0.1:9/x")


@pytest.mark.parametrize(
    ("status", "words"), [(404, "gone, or never was there"), (401, f"set {TOKEN_VARIABLE}"), (400, "check the address")]
)
def test_what_another_try_would_not_change_is_asked_once(served: Imagery, status: int, words: str) -> None:
    served.faults["/x"] = lambda *_: (status, {}, b"")
    with pytest.raises(RequestRejectedError, match=words):
        HttpClient().fetch_text(f"{served.address}/x")
    assert served.asked["/x"] == 1


def test_a_token_goes_to_its_own_host_alone_also_over_a_redirect(served: Imagery) -> None:
    host = served.address.removeprefix("http://")
    asked = HttpClient(ServiceToken(host, "Bearer secret"))
    with serving(Imagery(())) as other:
        other.faults["/there"] = lambda *_: (200, {}, b"there")
        served.faults["/moved"] = lambda *_: (302, {"Location": f"{other.address}/there"}, b"")
        assert asked.fetch_text(f"{served.address}/moved") == "there"
        assert served.headers["/moved"]["authorization"] == "Bearer secret"
        assert "authorization" not in other.headers["/there"]
        asked.fetch_text(f"{other.address}/there")
        assert "authorization" not in other.headers["/there"]
    assert "secret" not in repr(asked)


def test_a_refusal_is_told_by_who_refuses(served: Imagery) -> None:
    served.faults["/x"] = lambda *_: (403, {}, b"")
    for host, words in ((served.address.removeprefix("http://"), "its token is refused"), ("elsewhere", "run again")):
        with pytest.raises(RequestRejectedError, match=words):
            HttpClient(ServiceToken(host, "OAuth secret")).fetch_text(f"{served.address}/x")


def test_redirects_end_and_lead_to_no_file(served: Imagery) -> None:
    served.faults["/round"] = lambda *_: (302, {"Location": "/round"}, b"")
    with pytest.raises(RequestRejectedError, match="leads to another address"):
        HttpClient().fetch_text(f"{served.address}/round")
    served.faults["/file"] = lambda *_: (302, {"Location": "file:///etc/passwd"}, b"")
    with pytest.raises(RequestRejectedError, match="cannot be asked"):
        HttpClient().fetch_text(f"{served.address}/file")
    for address in ("file:///etc/passwd", "ftp://host/x", "/etc/passwd"):
        with pytest.raises(RequestRejectedError, match="no address of http or https"):
            HttpClient().fetch_text(address)


def test_what_is_larger_than_a_picture_may_be_is_not_read(
    served: Imagery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_client, "SERVICES", replace(http_client.SERVICES, max_picture_bytes=1000))
    served.faults["/told"] = lambda *_: (200, {}, b"x" * 2000)
    served.faults["/untold"] = lambda *_: (200, {"Content-Length": "", "Connection": "close"}, b"x" * 2000)
    for path in ("/told", "/untold"):
        with pytest.raises(RequestRejectedError, match="take a smaller one by hand"):
            HttpClient().download(f"{served.address}{path}", tmp_path / "picture")
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_is_cut_off_on_its_way_is_asked_for_again(served: Imagery, tmp_path: Path) -> None:
    answers = [(200, {"Content-Length": "100"}, b"x" * 10)]
    served.faults["/p"] = lambda *_: answers.pop() if answers else (200, {}, b"x" * 100)
    HttpClient(sleep=lambda _: None).download(f"{served.address}/p", tmp_path / "picture")
    assert (tmp_path / "picture").stat().st_size == 100
    served.faults["/p"] = lambda *_: (200, {"Content-Length": "100"}, b"x" * 10)
    with pytest.raises(ServiceUnavailableError, match=r"cannot be read \(cut off\), 5 times"):
        HttpClient(sleep=lambda _: None).download(f"{served.address}/p", tmp_path / "other")
    assert [path.name for path in tmp_path.iterdir()] == ["picture"]


def test_what_drips_is_left(served: Imagery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_client, "SERVICES", replace(http_client.SERVICES, total_timeout_s=-1.0))
    served.faults["/p"] = lambda *_: (200, {}, b"x")
    with pytest.raises(ServiceUnavailableError, match="too slow"):
        HttpClient(sleep=lambda _: None).download(f"{served.address}/p", tmp_path / "picture")


def test_a_token_is_not_sent_where_others_can_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN_VARIABLE, "secret")
    with pytest.raises(InputError, match="would be read by others") as error:
        stac_service("http://panoramax.example.org/api")
    assert "secret" not in str(error.value)
    assert "secret" not in repr(stac_service("https://panoramax.example.org/api"))
    with pytest.raises(InputError, match="is no folder here; give one, panoramax, mapillary"):
        resolve_service("atlantis")
