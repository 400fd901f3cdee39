"""Fetching: none twice, whatever a kill cut off; what is no panorama is told; no name leads out of the folder."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.imagery_server import Imagery, Shot, commented, jpeg, picture_path
from catalogs.imagery import http_client
from catalogs.imagery.fetch_log import FETCH_LOG_NAME, read_fetch_log
from catalogs.imagery.fetching import fetch_panoramas
from catalogs.imagery.http_client import ServiceUnavailableError
from catalogs.imagery.remote_panorama import PanoramaQuery, RemotePanorama
from catalogs.imagery.services import stac_service
from catalogs.imagery.settings import SERVICES
from catalogs.readers.pictures.panoramas import read_panoramas
from facade_core.core.errors import ImageError, InputError

BOX = (7.0, 48.0, 8.0, 49.0)
GOOD = Shot("good", 7.5, 48.5, 30.0)


def fetched(served: Imagery, folder: Path, look=lambda _: None) -> dict[str, str]:
    """Fetch all that is offered; why pictures cannot be used, by id."""
    service, account = stac_service(served.stac()), read_fetch_log(folder)
    offers = [one for one in service.search(PanoramaQuery(BOX)) if isinstance(one, RemotePanorama)]
    faults = fetch_panoramas(service.name, offers, account, service.download, look, lambda _: None)
    account.write_poses()
    assert not (folder / ".arriving").exists()
    assert all("\n" not in fault.reason and ";" in fault.reason for fault in faults)
    return {fault.id: fault.reason for fault in faults}


def pictures(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix == ".jpg")


def test_what_was_fetched_is_read_as_the_panoramas_of_a_block(served: Imagery, tmp_path: Path) -> None:
    from pyproj import CRS

    served.shots = [GOOD, replace(GOOD, id="second", captured="2019-01-02", lon=7.6)]
    assert fetched(served, tmp_path / "p") == {}
    found = read_panoramas(tmp_path / "p", tmp_path / "p" / "poses.json", CRS.from_epsg(32632))
    assert [(one.id, one.captured) for one in found.items] == [("good", "2024-05-17"), ("second", "2019-01-02")]
    assert found.items[0].pose.heading == pytest.approx(30.0, abs=1.5), "turned from true north to the grid's"
    told = json.loads((tmp_path / "p" / "poses.json").read_text())["poses"]["good.jpg"]
    assert (told["licence"], told["author"], told["source"], len(told["sha256"])) == (
        "CC-BY-SA-4.0",
        "anna",
        served.stac(),
        64,
    )
    fetched(served, tmp_path / "p")
    assert served.asked[picture_path("good")] == 1
    (tmp_path / "p" / "good.jpg").unlink()
    fetched(served, tmp_path / "p")
    assert (served.asked[picture_path("good")], served.asked[picture_path("second")]) == (2, 1)


def _fisheye() -> bytes:
    import numpy as np

    x, y = np.meshgrid(np.linspace(-2, 2, 256), np.linspace(-1, 1, 128))
    inside = np.hypot((x % 2) - 1, y) < 1
    written = io.BytesIO()
    Image.fromarray((inside[..., None] * np.array([150, 160, 170])).astype(np.uint8)).save(written, "JPEG")
    return written.getvalue()


def test_what_is_no_panorama_is_told_and_not_fetched_again(served: Imagery, tmp_path: Path) -> None:
    from facade_core.imagery.rectify.fisheye import is_fisheye
    from tasks.stages.shared.images import read_image_and_mask

    def look(path: Path) -> None:
        if is_fisheye(read_image_and_mask(path)[0]):
            raise ImageError("is of a fisheye lens; leave it out")

    whole = jpeg(128, 256)
    served.shots = [
        GOOD,
        replace(GOOD, id="a-twin", content=commented(whole, "good")),
        replace(GOOD, id="square", content=jpeg(128, 128)),
        replace(GOOD, id="fisheye", content=_fisheye()),
        replace(GOOD, id="text", content=b"<html>no picture</html>"),
        replace(GOOD, id="cut", content=whole[: len(whole) // 2]),
    ]
    told = fetched(served, tmp_path / "p", look)
    assert told["a-twin"] == "is the same picture as good, which is used; nothing is to be done"
    assert told["square"].startswith("is 128 x 128 pixels, and an equirectangular panorama is twice as wide as high; ")
    assert told["fisheye"].startswith("is of a fisheye lens")
    assert told["text"].startswith("cannot be opened as a picture")
    assert told["cut"] == "is cut off; replace or remove it"
    assert pictures(tmp_path / "p") == ["good.jpg"]
    assert fetched(served, tmp_path / "p", look) == told
    again = {name: served.asked[picture_path(name)] for name in ("good", "a-twin", "square", "fisheye", "cut")}
    assert again == {"good": 1, "a-twin": 1, "square": 1, "fisheye": 1, "cut": 2}, "one that is cut off may be mended"
    assert set(json.loads((tmp_path / "p" / "poses.json").read_text())["poses"]) == {"good.jpg"}


def test_a_checksum_that_differs_is_told(served: Imagery, tmp_path: Path) -> None:
    offer = RemotePanorama("good", f"{served.address}/x", stac_pose(), licence="CC0-1.0", sha256="0" * 64)
    served.faults["/x"] = lambda *_: (200, {}, jpeg(32, 64))
    account, service = read_fetch_log(tmp_path / "p"), stac_service(served.stac())
    (fault,) = fetch_panoramas("s", [offer], account, service.download, lambda _: None, lambda _: None)
    assert "checksum differs" in fault.reason
    assert account.pictures == {}


def stac_pose():
    from catalogs.readers.pictures.poses import LONLAT
    from catalogs.readers.pictures.source_poses import SourcePose

    return SourcePose(LONLAT, 7.5, 48.5, None, 0.0)


def test_ids_name_files_of_the_folder_only(served: Imagery, tmp_path: Path) -> None:
    ids = [
        "../../etc/passwd",
        "/etc/passwd",
        "..",
        ".hidden",
        "a/b",
        "A-b",
        "a-B",
        "nul\x00",
        "x" * 400,
        "e\u0301",
        "-rf",
        "C:\\x",
    ]
    served.shots = [replace(GOOD, id=name, content=jpeg(32, 64, seed)) for seed, name in enumerate(ids)]
    offers = [
        RemotePanorama(name, f"{served.address}/{seed}", stac_pose(), licence="CC0-1.0")
        for seed, name in enumerate(ids)
    ]
    for seed in range(len(ids)):
        served.faults[f"/{seed}"] = lambda *_, seed=seed: (200, {}, jpeg(32, 64, seed))
    account, service = read_fetch_log(tmp_path / "deep" / "p"), stac_service(served.stac())
    assert fetch_panoramas("s", offers, account, service.download, lambda _: None, lambda _: None) == []
    names = pictures(tmp_path / "deep" / "p")
    assert len({name.casefold() for name in names}) == len(ids), "also where letters' case does not count"
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["p"]
    assert not any(name.startswith(".") for name in names)


def test_a_service_that_goes_away_ends_the_fetching(
    served: Imagery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_client, "SERVICES", replace(http_client.SERVICES, max_attempts=1))
    served.shots = [replace(GOOD, id=f"p{i}") for i in range(100)]
    for i in range(5, 100):
        served.faults[picture_path(f"p{i}")] = lambda *_: (503, {}, b"")
    with pytest.raises(ServiceUnavailableError, match="answers 503"):
        fetched(served, tmp_path / "p")
    # Each of the five that come may do so when all but one of those that end it are lost; then the others' threads end too.
    assert (
        sum(served.asked[picture_path(f"p{i}")] for i in range(5, 100))
        <= 5 * (SERVICES.max_consecutive_failures - 1) + SERVICES.max_consecutive_failures + SERVICES.max_downloads - 1
    )
    assert len(pictures(tmp_path / "p")) == 5, "what came stays"


FETCH = """
import sys
from pathlib import Path
from catalogs.imagery.fetch_log import read_fetch_log
from catalogs.imagery.fetching import fetch_panoramas
from catalogs.imagery.remote_panorama import PanoramaQuery
from catalogs.imagery.services import stac_service
service, fetch_log = stac_service(sys.argv[1]), read_fetch_log(Path(sys.argv[2]))
panoramas = list(service.search(PanoramaQuery((7.0, 48.0, 8.0, 49.0))))
fetch_panoramas(service.name, panoramas, fetch_log, service.download, lambda _: None, lambda _: None)
fetch_log.write_poses()
"""


def command(served: Imagery, folder: Path) -> Sequence[str]:
    return (sys.executable, "-c", FETCH, served.stac(), str(folder))


def test_after_a_kill_nothing_that_arrived_is_fetched_again(served: Imagery, tmp_path: Path) -> None:
    served.shots, served.delay_s = [replace(GOOD, id=f"p{i}") for i in range(30)], 0.05
    folder = tmp_path / "p"
    process = subprocess.Popen(command(served, folder))
    while not folder.is_dir() or len(pictures(folder)) < 8:
        assert process.poll() is None, "it ended before it could be killed"
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    there = pictures(folder)
    assert 8 <= len(there) < 30
    with (folder / FETCH_LOG_NAME).open("ab") as file:
        file.write(b'{"source": "cut o')  # as a full disk or a kill leaves a line
    asked = {shot.id: served.asked[picture_path(shot.id)] for shot in served.shots}
    subprocess.run(command(served, folder), check=True)
    assert len(pictures(folder)) == 30
    for name in there:
        identifier = name.removesuffix(".jpg")
        assert served.asked[picture_path(identifier)] == asked[identifier] == 1
    assert max(served.asked[picture_path(shot.id)] for shot in served.shots) <= 2
    assert len(read_fetch_log(folder).pictures) == 30
    assert len(json.loads((folder / "poses.json").read_text())["poses"]) == 30


def test_a_folder_of_others_and_a_line_that_names_another_place_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "photo.jpg").write_bytes(b"")
    with pytest.raises(InputError, match="holds files that were not fetched; name a new folder"):
        read_fetch_log(tmp_path / "mine")
    line = {"source": "s", "id": "1", "file": "../x.jpg", "sha256": "", "bytes": 1, "lon": 0, "lat": 0, "heading": 0}
    for text in (json.dumps(line), "no json", "[]", json.dumps({"id": "1"}), json.dumps(line | {"file": None})):
        (tmp_path / "p").mkdir(exist_ok=True)
        (tmp_path / "p" / FETCH_LOG_NAME).write_text(text + "\n")
        with pytest.raises(InputError, match="line 1 "):
            read_fetch_log(tmp_path / "p")
