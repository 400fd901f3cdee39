"""Photos of facades as taken from the street, read, rectified and sized for their facade."""

from __future__ import annotations

import struct
import zlib
from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.errors import ImageError
from facade_core.imagery.detect.detection import FacesPlatesAndText, detectors_available
from facade_core.imagery.detect.text import TextLine
from facade_core.imagery.rectify.crop import FacadeCrop
from facade_core.imagery.rectify.level_lines import find_slope
from facade_core.imagery.rectify.photo_state import check_daylight, check_photo_state
from facade_core.imagery.rectify.settings import PHOTO_FIT
from facade_core.parsing.segmenter import Surroundings
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.facades.photos import BLURRED, crop_facade_photo, describe_crop, read_facade_photo
from tasks.stages.shared.images import capture_date, read_bounded_picture

PAINTED = paint((16.0, 14.0), floors=4, columns=5, style="haussmann", metres_per_pixel=0.03, seed=4)
# Below a pale sky, and with the dark ground floor of a street.
OUTDOORS = PAINTED.image.copy()
OUTDOORS[: len(OUTDOORS) // 8] = (200, 205, 215)
OUTDOORS[4 * len(OUTDOORS) // 5 :] //= 2


def from_below(image: np.ndarray) -> np.ndarray:
    """The image on a wall as seen by a camera that stands to the left of its middle and looks up."""
    height, width = image.shape[:2]
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    seen = np.float32([[190, 90], [900, 210], [880, 880], [110, 960]])
    turned = cv2.getPerspectiveTransform(corners, seen)
    background = np.full((1050, 1000, 3), (170, 190, 215), np.uint8)
    return cv2.warpPerspective(image, turned, (1000, 1050), background, borderMode=cv2.BORDER_TRANSPARENT)


def likeness(a: np.ndarray, b: np.ndarray) -> float:
    soft = [cv2.GaussianBlur(x, (0, 0), 3).astype(float) for x in (a, b)]
    return float(np.corrcoef(soft[0].ravel(), soft[1].ravel())[0, 1])


def test_a_photo_as_taken_is_rectified_to_its_facade(tmp_path: Path) -> None:
    path = tmp_path / "w1-f1.png"
    Image.fromarray(from_below(PAINTED.image)).save(path)
    size = (PAINTED.image.shape[0] // 2, PAINTED.image.shape[1] // 2)
    truth = cv2.resize(PAINTED.image, size[::-1], interpolation=cv2.INTER_AREA)
    as_taken = cv2.resize(from_below(PAINTED.image), size[::-1], interpolation=cv2.INTER_AREA)
    found = read_facade_photo(path, False, size)
    assert found.image.shape == truth.shape
    assert found.photo.hidden.mean() < 0.2
    assert likeness(found.image, truth) > likeness(as_taken, truth) + 0.2


def test_a_photo_without_a_facade_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "w1-f2.png"
    Image.fromarray(np.full((300, 400, 3), 128, np.uint8)).save(path)
    with pytest.raises(ImageError, match=r"w1-f2\.png: .*lines"):
        read_facade_photo(path, False, (100, 100))


def test_focal_length_is_that_of_the_exif(tmp_path: Path) -> None:
    image, path = Image.new("RGB", (3600, 2400)), tmp_path / "photo.jpg"
    image.save(path)
    assert read_bounded_picture(path).state.focal_px is None
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    image.save(path, exif=exif)
    assert read_bounded_picture(path).state.focal_px == pytest.approx(2800)


@pytest.mark.parametrize(
    ("told", "day"),
    [("2024:05:17 10:31:00", "2024-05-17"), ("0000:00:00 00:00:00", None), ("yesterday", None), (None, None)],
)
def test_the_day_is_that_of_the_exif(tmp_path: Path, told: str | None, day: str | None) -> None:
    path, image = tmp_path / "a.jpg", Image.new("RGB", (40, 40))
    exif = image.getexif()
    if told is not None:
        exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.DateTimeOriginal] = told
    image.save(path, exif=exif)
    assert capture_date(path) == day


def test_what_is_private_on_a_photo_comes_to_its_texels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "w1-f3.png"
    Image.fromarray(PAINTED.image).save(path)
    size = (PAINTED.image.shape[0] // 2, PAINTED.image.shape[1] // 2)
    assert not read_facade_photo(path, True, size).seen.has_private_boxes() or detectors_available()
    looks = []

    def look(image: np.ndarray) -> FacesPlatesAndText:
        looks.append(image.shape)
        return FacesPlatesAndText(faces=np.array([[40.0, 60, 60, 84]]))

    monkeypatch.setattr("tasks.stages.facades.photos.detect_faces_plates_text", look)
    photo = read_facade_photo(path, True, size)
    factor = np.array([size[1] / looks[0][1], size[0] / looks[0][0]] * 2)
    assert np.allclose(photo.seen.faces, np.array([40, 60, 60, 84]) * factor)
    assert describe_crop(photo)["cut_found"]
    assert describe_crop(photo)["stretched"] == pytest.approx(1, abs=0.2)
    evidence = read_evidence("photo", None, 0, size, FacadeImagery(photo=path), {}, [])
    assert describe_crop(evidence) == describe_crop(photo)
    assert evidence.masked == evidence.seen.private_boxes(size) != ()


def test_how_a_photo_fits_its_wall_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "w1-f4.png"
    image = np.zeros((200, 100, 3), np.uint8)
    Image.fromarray(image).save(path)
    box = np.s_[:150, 20:70]
    hidden = np.zeros((150, 50), bool)
    cut = FacadeCrop(image[box], hidden, hidden, (20, 0, 70, 150), has_facade=False, notes=("neighbour cut off",))
    asked = []

    def crop(image: np.ndarray, hidden: np.ndarray, centre: float, aspect: float, **_: object) -> FacadeCrop:
        asked.append((centre, aspect))
        return cut

    monkeypatch.setattr("tasks.stages.facades.photos.crop_to_building", crop)
    monkeypatch.setattr("tasks.stages.facades.photos.detect_faces_plates_text", lambda image: FacesPlatesAndText())
    fit = describe_crop(read_facade_photo(path, True, (300, 200)))
    assert fit["cut_kept"] == pytest.approx(150 * 50 / (200 * 100))
    assert not fit["cut_found"]
    assert fit["stretched"] == pytest.approx(2.0), "the wall is 2 by 3, what was cut out 1 by 3"
    assert fit["cut_notes"] == ["neighbour cut off", BLURRED], "50 pixels for 200 texels across"
    assert asked == [(50.0, pytest.approx(2 / 3))]
    assert describe_crop(read_facade_photo(path, True, (300, 300)))["stretched"] == pytest.approx(3.0), (
        "rectified by its user"
    )


def test_a_photo_of_other_proportions_than_its_wall_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "w1-f6.png"
    Image.fromarray(from_below(PAINTED.image)).save(path)
    with pytest.raises(ImageError, match=r"w1-f6\.png: its facade is .* times as wide as high, its wall 5: it shows"):
        read_facade_photo(path, False, (80, 400))


def test_the_outline_is_that_in_the_photo(tmp_path: Path) -> None:
    path = tmp_path / "w1-f5.png"
    Image.fromarray(from_below(PAINTED.image)).save(path)
    corners = crop_facade_photo(path, False).corners
    assert np.abs(corners - [[190, 90], [900, 210], [880, 880], [110, 960]]).max() < 60


def test_a_photo_that_is_upside_down_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "w1-f6.png"
    Image.fromarray(OUTDOORS[::-1, ::-1]).save(path)
    with pytest.raises(ImageError, match=r"w1-f6\.png: it is upside down; turn it by 180 degrees"):
        crop_facade_photo(path, True)


@pytest.mark.parametrize(("turns", "way"), [(1, "clockwise"), (3, "counterclockwise")])
def test_a_photo_on_its_side_is_refused(tmp_path: Path, turns: int, way: str) -> None:
    path = tmp_path / "w1-f6.png"
    Image.fromarray(np.rot90(OUTDOORS, turns)).save(path)
    with pytest.raises(ImageError, match=rf"w1-f6\.png: it lies on its side; turn it {way} by 90 degrees"):
        crop_facade_photo(path, True)


def test_a_photo_as_taken_is_no_rectified_one(tmp_path: Path) -> None:
    path = tmp_path / "w1-f6.png"
    height, width = PAINTED.labels.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    from_the_left = corners * [0.7, 1] + np.array([[0, 0], [0, 0.3], [0, -0.15], [0, 0]]) * height
    turn = cv2.getPerspectiveTransform(corners, from_the_left.astype(np.float32))
    Image.fromarray(cv2.warpPerspective(PAINTED.image, turn, (round(0.7 * width), height))).save(path)
    with pytest.raises(
        ImageError, match=r"slope by \d+ degrees: it is not rectified; rectify it, or .*`rectified: false`"
    ):
        crop_facade_photo(path, True)


def test_braces_of_a_rectified_facade_are_no_slope() -> None:
    facade = np.full((600, 600, 3), 200, np.uint8)
    for row in range(40, 600, 40):
        cv2.line(facade, (0, row), (600, row), (60, 50, 40), 6)
    for column in range(0, 600, 40):
        cv2.line(facade, (column, 600), (column + 800, 200), (60, 50, 40), 6)
        cv2.line(facade, (column, 200), (column - 800, 600), (60, 50, 40), 6)
    assert find_slope(facade, np.zeros((600, 600), bool)) is None


def test_a_facade_that_is_mostly_hidden_is_refused_in_a_photo_as_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "w1-f8.png"
    Image.fromarray(from_below(OUTDOORS)).save(path)
    is_tree = np.zeros(crop_facade_photo(path, False).hidden.shape, bool)
    is_tree[:, round(PHOTO_FIT.min_seen_share * is_tree.shape[1]) :] = True
    monkeypatch.setattr("tasks.stages.facades.photos.occluder_mask", lambda *_: is_tree)
    with pytest.raises(ImageError, match=r"w1-f8\.png: only \d+% of its facade is seen beside trees, .*; take it from"):
        crop_facade_photo(path, False)


def test_a_small_photo_is_said_to_be_blurred(tmp_path: Path) -> None:
    path = tmp_path / "w1-f6.png"
    Image.fromarray(PAINTED.image).save(path)
    size = np.array(PAINTED.labels.shape)
    assert BLURRED not in read_facade_photo(path, True, tuple((size * 1.5).astype(int))).photo.notes
    assert BLURRED in read_facade_photo(path, True, tuple(size * 3)).photo.notes


def test_a_photo_taken_at_night_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "w1-f7.png"
    Image.fromarray((PAINTED.image * 0.25).astype(np.uint8)).save(path)
    with pytest.raises(ImageError, match=r"w1-f7\.png: it was taken at night: .*; give one taken by day"):
        crop_facade_photo(path, True)


@pytest.mark.parametrize(("sky", "wall", "is_night"), [(30, 140, True), (90, 60, False), (60, 70, False)])
def test_a_lit_wall_below_a_dark_sky_is_of_the_night_and_one_in_the_shade_is_not(
    sky: int, wall: int, is_night: bool
) -> None:
    image, hidden = np.full((100, 80, 3), wall, np.uint8), np.zeros((100, 80), bool)
    image[:20], image[20:45, :60] = sky, 150
    labels = np.where(np.arange(100)[:, None] < 20, 6, np.where(np.arange(100)[:, None] < 85, 0, 5))
    labels = np.broadcast_to(labels, (100, 80)).astype(np.uint8)
    with pytest.raises(ImageError, match="at night") if is_night else nullcontext():
        check_photo_state(image, hidden, Surroundings(labels == 6, labels), is_day=False)
    check_photo_state(image, hidden, Surroundings(labels == 6, labels), is_day=True)


@pytest.mark.parametrize(
    ("seconds", "iso", "is_night"), [((1, 8), 1600, True), ((1, 60), 100, False), ((0, 1), 100, False)]
)
def test_a_photo_whose_exposure_is_that_of_lamps_is_refused(
    tmp_path: Path, seconds: tuple[int, int], iso: int, is_night: bool
) -> None:
    exif = Image.Exif()
    exif.get_ifd(ExifTags.IFD.Exif).update(
        {
            ExifTags.Base.FNumber: 2.8,
            ExifTags.Base.ExposureTime: IFDRational(*seconds),
            ExifTags.Base.ISOSpeedRatings: iso,
        }
    )
    path = tmp_path / "w1-f9.jpg"
    Image.fromarray(from_below(PAINTED.image)).save(path, exif=exif)
    with pytest.raises(ImageError, match=r"w1-f9\.jpg: it was taken at night") if is_night else nullcontext():
        crop_facade_photo(path, False)


@pytest.mark.parametrize(("sky", "is_night"), [(90, True), (140, False)])
def test_a_sky_that_is_dark_in_a_photo_as_taken_is_of_the_night(sky: int, is_night: bool) -> None:
    photo = from_below(PAINTED.image)
    shades = sky + np.round(8 * np.sin(np.arange(photo.shape[1]) / 40)).astype(np.int64)  # one flat colour is no data
    beside = (photo == photo[0, 0]).all(axis=2)
    photo[beside] = np.broadcast_to(shades[:, None], photo.shape)[beside]
    with pytest.raises(ImageError, match="at night") if is_night else nullcontext():
        check_daylight(photo, np.zeros(photo.shape[:2], bool), None)


def test_a_photo_with_a_dark_upper_quarter_is_of_the_night_without_a_sky() -> None:
    photo = PAINTED.image.copy()
    quarter = len(photo) // 4
    photo[:quarter] = photo[:quarter] // 6 + 15
    with pytest.raises(ImageError, match="at night"):
        check_daylight(photo, np.zeros(photo.shape[:2], bool), None)
    hidden = np.zeros(photo.shape[:2], bool)
    hidden[:quarter] = True
    check_daylight(photo, hidden, None)
    check_daylight(photo, np.zeros(photo.shape[:2], bool), 12.0)  # by day, under a dark arch


def sign(text: str, score: float) -> TextLine:
    return TextLine(np.array([[0.0, 0], [60, 0], [60, 12], [0, 12]]), text, score)


def test_a_photo_whose_signs_read_in_its_mirror_image_only_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "w1-f8.png"
    Image.fromarray(PAINTED.image).save(path)
    size = PAINTED.image.shape[:2]
    legible, illegible = [sign("BAKERY", 0.95), sign("FLOWERS", 0.97)], [sign("YЯƎKAB", 0.4), sign("2ЯEWO", 0.5)]
    answers: list[list[TextLine]] = []

    def detect(image: np.ndarray) -> FacesPlatesAndText:
        return FacesPlatesAndText(lines=answers.pop(0))

    monkeypatch.setattr("tasks.stages.facades.photos.detect_faces_plates_text", detect)
    answers += [illegible, legible]
    with pytest.raises(ImageError, match=r"w1-f8\.png: it is mirrored: .*; flip it"):
        read_facade_photo(path, True, size)
    for lines in ([illegible, illegible], [legible], [[*illegible, sign("BANK", 0.9)]], [[]]):
        answers += lines
        read_facade_photo(path, True, size)
        assert not answers


def test_a_picture_of_400_megapixels_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    path = tmp_path / "w1-f9.png"
    Image.fromarray(PAINTED.image).save(path)
    content = bytearray(path.read_bytes())
    content[16:24] = struct.pack(">II", 20_000, 20_000)
    content[29:33] = struct.pack(">I", zlib.crc32(content[12:29]))
    path.write_bytes(content)
    with pytest.raises(ImageError, match=r"w1-f9\.png .*pixels"):
        read_facade_photo(path, False, (100, 100))
