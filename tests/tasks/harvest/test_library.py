"""Style libraries from small pictures; what is found in them is given by the test, but for one."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar
from benchmarks.painter.facade import paint_facade
from catalogs.readers.pictures.folders import list_images
from facade_core.core.errors import ImageError, InputError
from facade_core.facade.exemplar_admission import CandidateAssessment
from facade_core.facade.exemplar_quality import ExemplarQuality
from facade_core.facade.harvesting import HarvestedFacade, harvest_facade
from facade_core.imagery.rectify.crop import FacadeCrop, crop_to_box
from flows.cli.commands import command_line
from tasks.harvest import MIN_SCORE
from tasks.harvest.library import Candidate, choose_candidates, harvest_style_library
from tasks.harvest.record import CANDIDATES_FOLDER
from tasks.harvest.sources import SourcePicture

SCALE = 0.05


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Three facades of which one is there twice, at other light, and a plain picture."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    facades = [paint_exemplar(index, seed=7, metres_per_pixel=SCALE).image for index in range(2)]
    darker = np.clip(0.8 * facades[0], 0, 255).astype(np.uint8)
    plain = np.full((90, 120, 3), 90, np.uint8)
    for name, image in (("a", facades[0]), ("b", facades[1]), ("c", darker), ("plain", plain)):
        Image.fromarray(image).save(folder / f"{name}.png")
    return folder


@pytest.fixture
def harvested(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """Take each picture for a facade whose score is its brightness; the sizes of those that were harvested."""
    sizes: list[tuple[int, ...]] = []

    def find(image: np.ndarray, focal: float | None, **more: object) -> HarvestedFacade:
        sizes.append(image.shape)
        rgb = np.ascontiguousarray(image[..., :3])
        if rgb.std() == 0:
            raise ImageError("photo: only 0 straight lines")
        score = float(rgb.mean()) / 255
        labels = np.zeros(rgb.shape[:2], np.uint8)
        labels[10:30, 10:30] = 1
        hidden = np.zeros(labels.shape, bool)
        judged = CandidateAssessment(ExemplarQuality(score, *[1.0] * 6), ())
        return HarvestedFacade(rgb, labels, hidden, SCALE, 3, 4, judged)

    monkeypatch.setattr("tasks.harvest.task.harvest_facade", find)
    return sizes


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.parent.name != "records"  # these hold seconds
    }


def test_a_facade_is_taken_once_and_each_rejected_one_is_listed(
    pictures: Path, tmp_path: Path, harvested: list[tuple[int, ...]]
) -> None:
    (pictures / "twin.png").write_bytes((pictures / "b.png").read_bytes())
    (pictures / "film.mp4").write_bytes(b"0")
    out = tmp_path / "style"
    found = harvest_style_library([pictures], out, most=10, workers=1, licence="mine")
    listing = json.loads((out / "exemplars.json").read_text())
    assert {each["file"] for each in listing["exemplars"]} == {"a.png", "b.png"}
    assert all(each["licence"] == "mine" and each["metres_per_pixel"] == SCALE for each in listing["exemplars"])
    reasons = {each["name"]: each["reason"] for each in listing["rejected"]}
    assert reasons["plain"].startswith("only 0 straight lines")
    assert reasons["c"] == "the facade of a, which is the better picture of it"
    assert {fault.id for fault in found.faults} == {"twin.png", "film.mp4"}
    assert [sheet.name for sheet in found.sheets] == ["exemplars-1.jpg", "rejected-1.jpg"]
    # a block reads the exemplars with their labels, and reports nothing else of the folder
    read, faults = list_images(out, "exemplar")
    assert [path.name for path in read] == ["a.png", "b.png"]
    assert faults == ()
    assert (np.asarray(Image.open(out / "a.labels.png"))[10:30, 10:30] == 1).all()


def test_a_second_harvest_does_only_what_is_new(
    pictures: Path, tmp_path: Path, harvested: list[tuple[int, ...]]
) -> None:
    out = tmp_path / "style"
    harvest_style_library([pictures], out, most=10, workers=1)
    before = files(out)
    harvested.clear()
    assert harvest_style_library([pictures], out, most=10, workers=1).earlier == 4
    assert harvested == []
    assert files(out) == before
    Image.fromarray(paint_exemplar(3, seed=7, metres_per_pixel=SCALE).image).save(pictures / "new.png")
    next((out / "harvest" / "records").iterdir()).write_text("{")  # a record that a broken disk cut off
    assert harvest_style_library([pictures], out, most=10, workers=1).earlier == 3
    assert len(harvested) == 2
    assert (out / "new.png").is_file()


def test_only_the_best_are_kept_and_worse_ones_of_before_go(
    pictures: Path, tmp_path: Path, harvested: list[tuple[int, ...]]
) -> None:
    out = tmp_path / "style"
    harvest_style_library([pictures], out, most=10, workers=1)
    found = harvest_style_library([pictures], out, most=1, workers=1)
    (kept,) = (one.record["name"] for one in found.exemplars)
    assert {path.name for path in out.glob("*.png")} == {f"{kept}.png", f"{kept}.labels.png"}
    assert any("raise --most" in reason for _, reason in found.rejected)


def test_the_families_of_a_style_keep_their_shares(tmp_path: Path) -> None:
    """Twelve houses of plaster, and eight of brick whose pictures are better."""
    candidates = [
        Candidate(
            SourcePicture(tmp_path / f"{number}.jpg", str(number), str(number)),
            {
                "name": str(number),
                "file": str(number),
                "score": 0.5 + 0.02 * number,
                "metres_per_pixel": SCALE,
                "width_m": 12.0,
                "height_m": 15.0,
                "floors": 4,
                "hidden": 0.0,
                "look": [40.0 if number >= 12 else 80.0, *[0.0] * 8],
            },
        )
        for number in range(20)
    ]
    (tmp_path / CANDIDATES_FOLDER).mkdir(parents=True)
    for one in candidates:
        noise = np.random.default_rng(int(one.record["name"])).integers(0, 255, (60, 80, 3), np.uint8)
        Image.fromarray(noise).save(tmp_path / CANDIDATES_FOLDER / f"{one.record['file']}.png")
    chosen, _, surplus = choose_candidates(candidates, tmp_path, 5)
    assert [one.record["name"] for one in chosen] == ["19", "18", "11", "10", "9"]
    assert len(surplus) == 15


def candidates_of_scores(folder: Path, scores: list[float]) -> list[Candidate]:
    """Facades of noise, each named after its score."""
    (folder / CANDIDATES_FOLDER).mkdir(parents=True)
    for score in scores:
        noise = np.random.default_rng(round(100 * score)).integers(0, 255, (60, 80, 3), np.uint8)
        Image.fromarray(noise).save(folder / CANDIDATES_FOLDER / f"{score}.png")
    return [
        Candidate(
            SourcePicture(folder / f"{score}.jpg", str(score), str(score)),
            {
                "name": str(score),
                "file": str(score),
                "score": score,
                "parts": {"clean": score, "foot": 0.99, "light": 1.0},
                "metres_per_pixel": SCALE,
                "width_m": 12.0,
                "height_m": 15.0,
                "floors": 4,
                "hidden": 0.0,
                "look": [0.0] * 9,
            },
        )
        for score in scores
    ]


def test_a_facade_of_low_score_is_no_exemplar(tmp_path: Path) -> None:
    candidates = candidates_of_scores(tmp_path, [0.9, 0.8, 0.7, MIN_SCORE, 0.2, 0.1])
    chosen, rejected, surplus = choose_candidates(candidates, tmp_path, 40)
    assert [one.record["name"] for one in chosen] == ["0.9", "0.8", "0.7", str(MIN_SCORE)]
    assert [one.record["name"] for one, _ in rejected] == ["0.1", "0.2"]
    assert rejected[1][1] == f"its score is 0.20, and {MIN_SCORE:.2f} is the least (clean 0.20 and foot 0.99)"
    assert surplus == []


def test_facades_of_low_score_are_kept_where_there_are_no_better_ones(tmp_path: Path) -> None:
    chosen, rejected, _ = choose_candidates(candidates_of_scores(tmp_path, [0.9, 0.2, 0.15, 0.1]), tmp_path, 40)
    assert [one.record["name"] for one in chosen] == ["0.9", "0.2", "0.15"]
    assert [one.record["name"] for one, _ in rejected] == ["0.1"]


def test_a_harvest_states_that_exemplars_are_of_low_score(tmp_path: Path, harvested: list[tuple[int, ...]]) -> None:
    dark = tmp_path / "dark.png"
    Image.fromarray(paint_exemplar(0, seed=7, metres_per_pixel=SCALE).image // 2).save(dark)
    shown = CliRunner().invoke(command_line, ["harvest", str(dark), "--out", str(tmp_path / "s"), "--workers", "1"])
    assert shown.exit_code == 0
    assert "1 of the exemplars is below the usual score" in shown.stderr
    assert (tmp_path / "s" / "dark.png").is_file()


def test_pictures_of_the_user_are_not_written_over(pictures: Path) -> None:
    with pytest.raises(InputError, match=r"holds pictures that were not harvested, such as a\.png; name a new folder"):
        harvest_style_library([pictures], pictures, most=10, workers=1)


def test_one_broken_picture_is_one_line(
    pictures: Path, tmp_path: Path, harvested: list[tuple[int, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tasks.engine.kernel_compilation.has_compiled_kernels", lambda: True)
    whole = (pictures / "a.png").read_bytes()
    (pictures / "a.png").write_bytes(whole[: len(whole) // 2])
    shown = CliRunner().invoke(
        command_line, ["harvest", str(pictures), "--out", str(tmp_path / "style"), "--workers", "1"]
    )
    assert shown.exit_code == 0, shown.output
    assert "streetloom: a.png: a.png is cut off; replace or remove it" in shown.stderr
    empty = tmp_path / "empty"
    empty.mkdir()
    shown = CliRunner().invoke(command_line, ["harvest", str(empty), "--out", str(tmp_path / "other")])
    assert shown.exit_code == 2
    assert shown.stderr.count("\n") == 1
    assert not (tmp_path / "other").exists()


def test_a_library_without_a_usable_facade_exits_with_2(tmp_path: Path, harvested: list[tuple[int, ...]]) -> None:
    plain = tmp_path / "plain.png"
    Image.fromarray(np.full((90, 120, 3), 90, np.uint8)).save(plain)
    shown = CliRunner().invoke(command_line, ["harvest", str(plain), "--out", str(tmp_path / "s"), "--workers", "1"])
    assert shown.exit_code == 2
    assert "no facade can be used" in shown.stderr


def test_a_panorama_is_cut_to_views(tmp_path: Path, harvested: list[tuple[int, ...]]) -> None:
    path = tmp_path / "round.png"
    rows = np.linspace(255, 0, 256).astype(np.uint8)
    panorama = np.repeat(rows[:, None, None], 512, axis=1).repeat(3, axis=2)
    panorama[100:140] = (10 * np.sin(np.arange(512) * 2 * np.pi / 64)[None, :, None] + 120).astype(np.uint8)
    Image.fromarray(panorama).save(path)
    harvest_style_library([path], tmp_path / "style", most=10, workers=1)
    assert len(harvested) == 8
    assert len({shape for shape in harvested}) == 1
    assert harvested[0][0] == harvested[0][1]


@pytest.mark.parametrize("is_night", [False, True])
def test_the_sky_of_the_whole_panorama_decides_on_daylight(
    tmp_path: Path, harvested: list[tuple[int, ...]], is_night: bool
) -> None:
    panorama = np.full((256, 512, 3), 60 if is_night else 220, np.uint8)
    panorama[120:] = 90
    panorama[20:140, 200:312] = 55  # a near wall in the shade, before which a view has no sky
    panorama[100:130, 240:270] = 250
    panorama += np.round(8 + 8 * np.sin(np.arange(512) / 20)).astype(np.uint8)[:, None]  # a flat colour is no data
    Image.fromarray(panorama).save(tmp_path / "round.png")
    result = harvest_style_library([tmp_path / "round.png"], tmp_path / "style", most=10, workers=1)
    assert len(harvested) == (0 if is_night else 8)
    assert all("at night" in reason for _, reason in result.rejected) == is_night


def street_photo() -> np.ndarray:
    """A painted facade below a sky, seen at an angle: (600, 800, 4) uint8."""
    painted = paint_facade((13.0, 12.0), floors=4, columns=4, style="plaster", metres_per_pixel=0.03, seed=5).image
    height, width = painted.shape[:2]
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    target = np.float32([[170, 110], [620, 60], [620, 560], [170, 520]])
    photo = np.full((600, 800, 3), (150, 190, 235), np.uint8)
    photo[530:] = (110, 108, 104)
    cv2.warpPerspective(
        painted, cv2.getPerspectiveTransform(corners, target), (800, 600), photo, borderMode=cv2.BORDER_TRANSPARENT
    )
    return np.dstack([photo, np.full((600, 800), 255, np.uint8)])


def test_the_facade_of_a_photo_is_cut_measured_and_judged() -> None:
    found = harvest_facade(street_photo(), None)
    assert found.floors == 4
    assert found.columns == 4
    assert 11.0 < found.labels.shape[0] * found.metres_per_pixel < 17.0
    assert (found.labels == 6).mean() == 0  # no sky is left


def test_a_facade_of_a_few_pixels_is_refused_in_plain_words(monkeypatch: pytest.MonkeyPatch) -> None:
    def crop_to_strip(image: np.ndarray, hidden: np.ndarray, *_: object, **__: object) -> FacadeCrop:
        return crop_to_box(image, hidden, np.zeros_like(hidden), (200, 100, 207, 224))

    monkeypatch.setattr("facade_core.facade.harvesting.crop_to_building", crop_to_strip)
    monkeypatch.setattr("facade_core.facade.harvesting.find_slope", lambda *_: None)
    with pytest.raises(ImageError, match="7 x 124 pixels are too little of a facade"):
        harvest_facade(street_photo(), None)


def test_a_border_without_data_reaches_no_exemplar() -> None:
    """A rectified picture with a black corner on its left and a grey one on its right."""
    painted = paint_facade((16.0, 13.0), floors=4, columns=5, style="plaster", metres_per_pixel=0.025, seed=5).image
    height, width = painted.shape[:2]
    wide = width // 7
    corners = np.array([[0, height // 8], [wide, height - 1], [0, height - 1]])
    image = cv2.fillPoly(painted.copy(), [corners], (0, 0, 0))
    image = cv2.fillPoly(image, [np.array([width - 1, 0]) + corners * [-1, 1]], (130, 130, 130))
    found = harvest_facade(np.dstack([image, np.full((height, width), 255, np.uint8)]), None)
    assert found.judgement.reasons == ()
    for fill, part in ((0, found.image[:, :wide]), (130, found.image[:, -wide:])):
        is_fill = (np.abs(part.astype(int) - fill) <= 3).all(axis=2).astype(np.uint8)
        assert cv2.morphologyEx(is_fill, cv2.MORPH_OPEN, np.ones((9, 9), np.uint8)).mean() < 0.002
