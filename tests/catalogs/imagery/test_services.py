"""What services offer: panoramas with a pose and a licence; what cannot be used, one line each, and the rest goes on."""

from __future__ import annotations

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from benchmarks.imagery_server import Imagery, Shot
from catalogs.features import Fault
from catalogs.imagery.fetch_log import read_fetch_log
from catalogs.imagery.fetching import fetch_panoramas
from catalogs.imagery.remote_panorama import PanoramaQuery, RemotePanorama, finite_float_or_none
from catalogs.imagery.services import TOKEN_VARIABLE, ImageryService, mapillary_service, resolve_service, stac_service
from facade_core.core.errors import InputError

BOX = (7.0, 48.0, 8.0, 49.0)
GOOD = Shot("good", 7.5, 48.5, 30.0)


def query_service(
    service: ImageryService, wanted: PanoramaQuery | None = None
) -> tuple[list[RemotePanorama], dict[str, str]]:
    """What a service offers, and why it does not offer others."""
    found = list(service.search(wanted or PanoramaQuery(BOX)))
    faults = {one.id: one.reason for one in found if isinstance(one, Fault)}
    assert all("\n" not in reason and ";" in reason for reason in faults.values()), "one line, with the remedy"
    return [one for one in found if isinstance(one, RemotePanorama)], faults


def test_a_stac_api_tells_pose_day_author_and_licence(served: Imagery) -> None:
    served.shots = [GOOD, replace(GOOD, id="elsewhere", lon=9.0), replace(GOOD, id="flat", field_of_view=70)]
    (offer,), faults = query_service(stac_service(served.stac()))
    assert faults == {}
    assert (offer.id, offer.captured, offer.author, offer.licence) == ("good", "2024-05-17", "anna", "CC-BY-SA-4.0")
    assert (offer.pose.x, offer.pose.y, offer.pose.heading, offer.size) == (7.5, 48.5, 30.0, (128, 256))
    assert offer.licence_url == "https://spdx.org/licenses/CC-BY-SA-4.0.html"


def test_a_heading_that_geovisio_rounds_is_taken_from_the_tag_beside_it(served: Imagery) -> None:
    served.shots = [GOOD]
    for tag, heading in (("3012/100", 30.12), ("200/1", 30.0), ("1/0", 30.0), ("", 30.0), (7, 30.0)):
        item = served.item(GOOD)
        item["properties"]["exif"] = {"Exif.GPSInfo.GPSImgDirection": tag}
        page = {"features": [item], "links": []}
        served.faults["/api/search"] = lambda *_, page=page: (200, {}, json.dumps(page).encode())
        assert query_service(stac_service(served.stac()))[0][0].pose.heading == heading


def test_a_span_of_days_is_asked_of_the_service(served: Imagery) -> None:
    served.shots = [GOOD, replace(GOOD, id="old", captured="2019-01-02")]
    offers, _ = query_service(stac_service(served.stac()), PanoramaQuery(BOX, "2023-01-01/.."))
    assert [offer.id for offer in offers] == ["good"]
    for wrong in ("2023", "2023-01-01", "2023-13-01/..", "x/y"):
        with pytest.raises(InputError, match=r"--dates .* is no span; give FROM/TO"):
            PanoramaQuery(BOX, wrong)
    with pytest.raises(InputError, match="is no box"):
        PanoramaQuery((8.0, 48.0, 7.0, 49.0))


def test_what_cannot_be_used_is_told_and_the_rest_goes_on(served: Imagery) -> None:
    served.shots = [
        GOOD,
        replace(GOOD, id="no-heading", heading=None),
        replace(GOOD, id="no-licence", licence=None),
        replace(GOOD, id="no-copies", licence="CC-BY-ND-4.0"),
        replace(GOOD, id="turned", heading=1e9),
    ]
    offers, faults = query_service(stac_service(served.stac()))
    assert [offer.id for offer in offers] == ["good"]
    assert faults["no-heading"].startswith("states a place but no heading; give its pose in a poses file")
    assert faults["no-licence"].startswith("states no licence; ask who took it")
    assert faults["no-copies"].startswith("is under CC-BY-ND-4.0, which forbids changed copies")
    assert "at most 3600" in faults["turned"]
    offers, faults = query_service(stac_service(served.stac()), PanoramaQuery(BOX, licence="CC0-1.0"))
    assert {offer.id: offer.licence for offer in offers} == {"good": "CC-BY-SA-4.0", "no-licence": "CC0-1.0"}
    assert set(faults) == {"no-heading", "no-copies", "turned"}


@pytest.mark.parametrize(
    "change",
    [
        {"geometry": None},
        {"geometry": {"type": "Point", "coordinates": ["east", 48]}},
        {"geometry": {"type": "Point", "coordinates": [7.5, 480]}},
        {"assets": {}},
        {"assets": {"hd": {"href": None}}},
        {"assets": {"hd": {"href": "http://127.0.0.1/a.jpg", "type": "image/jpeg", "roles": 5}}},
        {"links": 5},
        {"properties": {"pers:interior_orientation": {"field_of_view": 360}, "license": {}}},
    ],
)
def test_an_item_that_is_broken_is_one_fault(served: Imagery, change: dict[str, Any]) -> None:
    served.shots = [GOOD]
    item = served.item(GOOD) | change
    page = {"type": "FeatureCollection", "features": [item, served.item(replace(GOOD, id="other"))], "links": []}
    served.faults["/api/search"] = lambda *_: (200, {}, json.dumps(page).encode())
    offers, faults = query_service(stac_service(served.stac()))
    assert [offer.id for offer in offers] == ["other"]
    assert list(faults) == ["good"]


def test_pages_are_followed_and_those_without_end_are_left(served: Imagery) -> None:
    served.shots, served.limit = [replace(GOOD, id=f"p{i}") for i in range(7)], 3
    offers, faults = query_service(stac_service(served.stac()))
    assert [offer.id for offer in offers] == [f"p{i}" for i in range(7)]
    assert (served.asked["/api/search"], faults) == (3, {})
    following = {"rel": "next", "href": f"{served.stac()}/search?again", "type": "application/geo+json"}
    page = {"type": "FeatureCollection", "features": [served.item(GOOD)], "links": [following]}
    served.faults["/api/search"] = lambda *_: (200, {}, json.dumps(page).encode())
    offers, faults = query_service(stac_service(served.stac()))
    assert [offer.id for offer in offers] == ["good"]
    (reason,) = faults.values()
    assert "pages without end (page 2 brings nothing new)" in reason


def test_an_answer_that_is_cut_off_is_asked_by_quarters_and_each_picture_comes_once(served: Imagery) -> None:
    """GeoVisio has no pages: what is beyond its limit does not come."""
    served.shots = [replace(GOOD, id=f"p{i}", lon=7 + (i % 25) / 25, lat=48 + (i // 25) / 25) for i in range(300)]
    served.limit, served.paged = 100, False
    offers, faults = query_service(stac_service(served.stac()))
    assert (len(offers), {offer.id for offer in offers}) == (300, {shot.id for shot in served.shots})
    assert faults == {}


def test_a_next_page_that_names_a_file_is_not_read(served: Imagery, tmp_path: Path) -> None:
    (tmp_path / "page.json").write_text('{"features": [{"id": "stolen"}]}')
    for href in (str(tmp_path / "page.json"), f"file://{tmp_path}/page.json"):
        page = {"features": [served.item(GOOD)], "links": [{"rel": "next", "href": href}]}
        served.faults["/api/search"] = lambda *_, page=page: (200, {}, json.dumps(page).encode())
        with pytest.raises(InputError, match="is no address"):
            query_service(stac_service(served.stac()))


@pytest.mark.parametrize("content", [b"<html>", b"[1]", b"{}", b'{"type": "Catalog"}', b"[" * 100_000])
def test_what_is_no_stac_api_is_refused_in_one_line(served: Imagery, content: bytes) -> None:
    served.faults["/api"] = lambda *_: (200, {}, content)
    with pytest.raises(InputError, match="is no STAC API that can be searched") as error:
        query_service(stac_service(served.stac()))
    assert "\n" not in str(error.value)


def test_mapillary_wants_a_token_that_is_nowhere_to_be_found_afterwards(
    served: Imagery, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    served.shots = [GOOD, replace(GOOD, id="no-heading", heading=None), replace(GOOD, id="flat", field_of_view=70)]
    with pytest.raises(InputError, match=f"Mapillary wants a token: set {TOKEN_VARIABLE}"):
        query_service(mapillary_service(served.address))
    monkeypatch.setenv(TOKEN_VARIABLE, "MLY|17|secret")
    service, near = mapillary_service(served.address), PanoramaQuery((7.49, 48.49, 7.51, 48.51))
    with caplog.at_level(logging.DEBUG):
        offers, faults = query_service(service, near)
        account = read_fetch_log(tmp_path / "pictures")
        fetch_panoramas(service.name, offers, account, service.download, lambda _: None, lambda _: None)
        account.write_poses()
    (offer,) = offers
    assert (offer.captured, offer.author, offer.licence) == ("2024-05-17", "anna", "CC-BY-SA-4.0")
    assert faults == {"no-heading": faults["no-heading"]}
    assert served.headers["/images"]["authorization"] == "OAuth MLY|17|secret"
    assert "secret" not in caplog.text
    written = [path for path in (tmp_path / "pictures").iterdir()]
    assert len(written) == 3
    assert not any(b"secret" in path.read_bytes() for path in written)


def test_mapillary_is_asked_small_boxes(served: Imagery, monkeypatch: pytest.MonkeyPatch) -> None:
    """It refuses those of more than 0.01 square degrees."""
    monkeypatch.setenv(TOKEN_VARIABLE, "MLY|17|secret")
    served.shots = [replace(GOOD, id=f"p{i}", lon=7.0 + 0.011 * i, lat=48.05) for i in range(15)]
    offers, _ = query_service(mapillary_service(served.address), PanoramaQuery((7.0, 48.0, 7.16, 48.06)))
    assert {offer.id for offer in offers} == {shot.id for shot in served.shots[:15]}
    assert served.asked["/images"] == 8


def test_pages_of_mapillary_are_followed_without_the_token_that_their_addresses_repeat(
    served: Imagery, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv(TOKEN_VARIABLE, "MLY|17|secret")
    served.shots = [GOOD, replace(GOOD, id="second")]
    records = json.loads(served.answer("/images?limit=2000", {"authorization": "OAuth x"})[2])["data"]
    following = f"{served.address}/images?after=1&access_token=MLY%7C17%7Csecret"
    pages = [{"data": records[:1], "paging": {"next": following}}, {"data": records[1:], "paging": {"next": following}}]
    seen: list[str] = []

    def paged(path: str, headers: object) -> tuple[int, dict[str, str], bytes]:
        seen.append(path)
        return 200, {}, json.dumps(pages[min(len(seen), 2) - 1]).encode()

    served.faults["/images"] = paged
    with caplog.at_level(logging.DEBUG):
        offers, faults = query_service(mapillary_service(served.address), PanoramaQuery((7.49, 48.49, 7.51, 48.51)))
    assert [offer.id for offer in offers] == ["good", "second"]
    assert ["pages without end (page 3" in reason for reason in faults.values()] == [True]
    assert not any("secret" in path for path in seen)
    assert "secret" not in caplog.text


def test_mapillary_is_asked_for_a_span_of_days(served: Imagery, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN_VARIABLE, "MLY|17|secret")
    days = ("2019-01-02", "2023-12-31", "2024-05-17")
    served.shots = [replace(GOOD, id=day, captured=day) for day in days]
    spans = {"2023-12-31/..": days[1:], "../2019-12-31": days[:1], "2023-01-01/2023-12-31": days[1:2], "../..": days}
    for span, expected in spans.items():
        offers, _ = query_service(mapillary_service(served.address), PanoramaQuery((7.49, 48.49, 7.51, 48.51), span))
        assert sorted(offer.id for offer in offers) == list(expected)


def test_a_folder_is_a_service_too(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    for blue, name in enumerate(("posed", "unposed", "elsewhere"), start=150):
        Image.new("RGB", (64, 32), (90, 120, blue)).save(folder / f"{name}.jpg")
    poses = {
        "posed.jpg": {"lon": 7.5, "lat": 48.5, "heading": 12.0, "z": 140.0, "captured": "2024-05-17"},
        "elsewhere.jpg": {"lon": 9.5, "lat": 48.5, "heading": 0.0},
    }
    (folder / "poses.json").write_text(json.dumps({"poses": poses}))
    (offer,), faults = query_service(
        resolve_service(str(folder)), PanoramaQuery(BOX, licence="mine", frame="EPSG:32632")
    )
    assert (offer.id, offer.captured, offer.licence, offer.pose.z) == ("posed", "2024-05-17", "mine", 140.0)
    assert (offer.pose.x, offer.pose.y, offer.pose.heading) == pytest.approx((7.5, 48.5, 12.0), abs=0.01)
    assert list(faults) == ["unposed.jpg"]
    with pytest.raises(InputError, match="--poses: panoramax tells where"):
        resolve_service("panoramax", folder / "poses.json")


def test_numbers_that_are_none_are_left() -> None:
    assert [finite_float_or_none(value) for value in (3, 1.5, True, "3", 10**400, float("nan"))] == [
        3.0,
        1.5,
        *[None] * 4,
    ]
