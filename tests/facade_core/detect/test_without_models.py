"""What needs no model: what is taken for a plate or a name, what is hidden, and that nothing is looked for without models."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.labels import FacadeClass
from facade_core.imagery.detect import detection as seen
from facade_core.imagery.detect import models
from facade_core.imagery.detect.detection import (
    FacesPlatesAndText,
    detect_faces_plates_text,
    detect_on_panorama_strip,
    detectors_available,
)
from facade_core.imagery.detect.faces import box_ious, non_maximum_suppression
from facade_core.imagery.detect.image_tiles import split_tiles
from facade_core.imagery.detect.plates import is_plate
from facade_core.imagery.detect.signs import shop_names
from facade_core.imagery.detect.text import TextLine
from tasks.doctor.machine import check_detectors
from tasks.engine.stage_code import stage_code_digest


def line(text: str, x: float, y: float, length: float = 60, height: float = 13, score: float = 0.95) -> TextLine:
    return TextLine(np.array([[x, y], [x + length, y], [x + length, y + height], [x, y + height]]), text, score)


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "MODEL_FILES", {"faces": ("no-such-package", "models/none.onnx")})
    monkeypatch.setattr("facade_core.imagery.detect.detection.models_digest", models.models_digest.__wrapped__)


@pytest.mark.usefixtures("without")
def test_without_the_models_nothing_is_looked_for_and_the_doctor_says_so() -> None:
    assert not detectors_available()
    seen = detect_faces_plates_text(np.zeros((40, 60, 3), np.uint8))
    assert not seen.has_private_boxes()
    assert not seen.lines
    assert not seen.private_mask((40, 60)).any()
    found = check_detectors()
    assert (found.concern, found.is_well) == ("privacy", None)
    assert "as no-such-package is missing" in found.message
    assert found.message.endswith("`make detect-setup` in Streetloom's folder installs them")


def test_a_face_across_the_border_of_a_panorama_is_whole_and_at_both_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    def bright(image: np.ndarray, low: float) -> FacesPlatesAndText:
        columns = np.flatnonzero(image[10, :, 0])
        runs = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
        return FacesPlatesAndText(faces=np.array([[run[0], 10, run[-1] + 1, 20] for run in runs], float))

    monkeypatch.setattr(seen, "detect_faces_plates_text", bright)
    strip = np.zeros((40, 800, 3), np.uint8)
    strip[10:20, :30] = strip[10:20, 780:] = strip[10:20, 400:440] = 255
    boxes = detect_on_panorama_strip(strip).faces.tolist()
    assert [780, 10, 830, 20] in boxes
    assert [-20, 10, 30, 20] in boxes
    hidden = detect_on_panorama_strip(strip).private_mask((40, 800))
    assert hidden[15, :30].all()
    assert hidden[15, 780:].all()
    assert hidden[15].sum() < 30 + 20 + 40 + 4 * 0.4 * 60


def test_what_takes_pictures_in_stands_on_the_models(monkeypatch: pytest.MonkeyPatch) -> None:
    def codes() -> dict[str, str]:
        stage_code_digest.cache_clear()
        return {stage: stage_code_digest(stage) for stage in ("facades", "exemplars", "poses", "streets", "surfaces")}

    found = []
    for digest in ("", "one", "other", ""):
        monkeypatch.setattr("tasks.engine.stage_code.models_digest", lambda digest=digest: digest)
        found.append(codes())
    stage_code_digest.cache_clear()
    assert found[0] == found[3]
    for stage, differs in {"facades": 3, "exemplars": 3, "poses": 1, "streets": 1, "surfaces": 1}.items():
        assert len({codes[stage] for codes in found}) == differs, stage


@pytest.mark.parametrize("text", ["AB-123-CD", "FU697334", "B MW 1234", "7AB O12", "PS11H", "1234 BCD"])
def test_a_plate_is_letters_and_digits_that_stand_low(text: str) -> None:
    assert is_plate(line(text, 10, 300), 200)
    assert not is_plate(line(text, 10, 100), 200), "too high on the facade"
    assert not is_plate(line(text, 10, 300, length=200), 200), "too long"


@pytest.mark.parametrize("text", ["BOULANGERIE", "Cafe 24", "TAXIS", "12", "06 12 34 56 78 90", ""])
def test_a_sign_is_no_plate(text: str) -> None:
    assert not is_plate(line(text, 10, 300), 200)


def test_names_are_read_over_shops_without_numbers_addresses_and_titles() -> None:
    labels = np.full((200, 300), FacadeClass.WALL, np.uint8)
    labels[150:, 20:280] = FacadeClass.SHOP
    hidden = np.zeros(labels.shape, bool)
    hidden[150:, 200:] = True
    lines = [
        line("GREEN SPRING", 120, 140),
        line("Fleurs.", 30, 160),
        line("fleurs", 110, 160),  # again
        line("UPSTAIRS", 30, 100),  # no shop, nor just under one
        line("unsure", 30, 175, score=0.7),
        line("01 42 34 56 78", 30, 165),
        line("tel 0142345678", 30, 168),
        line("me@shop.fr", 30, 170),
        line("AB-123-CD", 100, 185),
        line("On a van", 220, 170),
        *(
            line(text, 30, 172)
            for text in ("Dr. med. Anna Schmidt", "Notaris J. de Vries", "Inh. Hans Meier", "Telephone 0301")
        ),
        *(line(text, 30, 174) for text in ("info(a)meier.de", "www.fleurs", "fleurs-monge.fr")),
    ]
    plates = np.array([lines[8].box])
    assert shop_names(lines, labels, hidden, plates, 20.0) == ["Fleurs", "GREEN SPRING"]
    assert shop_names(lines, np.full_like(labels, FacadeClass.WALL), hidden, plates, 20.0) == []


def test_what_is_hidden_is_larger_than_what_is_found_and_moves_with_the_picture() -> None:
    seen = FacesPlatesAndText(np.array([[10.0, 20, 20, 32]]), np.array([[90.0, 90, 120, 99]]), [line("x", 4, 6)])
    assert seen.has_private_boxes()
    assert seen.private_boxes((100, 110)) == ((5, 15, 25, 37), (78, 78, 110, 100))
    assert seen.private_mask((100, 110)).sum() == 20 * 22 + 32 * 22
    moved = seen.translate(5, 7).rescale(2, 1)
    assert (moved.faces == [[30, 27, 50, 39]]).all()
    assert (moved.lines[0].box == [18, 13, 138, 26]).all()


def test_tiles_cover_all_and_overlap() -> None:
    image = np.arange(100 * 250).reshape(100, 250, 1).repeat(3, axis=2)
    covered = np.zeros((100, 250), int)
    for part, x, y in split_tiles(image, 90, 20):
        assert (part == image[y : y + part.shape[0], x : x + part.shape[1]]).all()
        covered[y : y + part.shape[0], x : x + part.shape[1]] += 1
    assert covered.min() == 1
    assert [(x, y) for _, x, y in split_tiles(image[:50, :60], 90, 20)] == [(0, 0)]


def test_of_boxes_that_overlap_the_surest_stays() -> None:
    boxes = np.array([[0.0, 0, 10, 10], [1, 0, 11, 10], [20, 0, 30, 10]])
    assert box_ious(boxes[0], boxes).round(3).tolist() == [1.0, 0.818, 0.0]
    kept, scores = non_maximum_suppression(boxes, np.array([0.5, 0.9, 0.4]), 0.3)
    assert kept.tolist() == boxes[[1, 2]].tolist()
    assert scores.tolist() == [0.9, 0.4]


def test_a_face_that_is_private_is_made_anew() -> None:
    from facade_core.facade.evidence import Evidence
    from facade_core.facade.photo_facade import build_facade_from_photo

    painted = paint((9.0, 8.0), floors=2, columns=3, style="haussmann", metres_per_pixel=0.05, seed=2)
    nothing = np.zeros(painted.labels.shape, bool)
    private = nothing.copy()
    private[-30:-20, 40:50] = True
    plain, none, hidden = (
        build_facade_from_photo(Evidence(image=painted.image, hidden=nothing, private=p, is_clean=True))
        for p in (None, nothing, private)
    )
    assert (plain.image == none.image).all()
    faded = binary_dilation(private, np.ones((3, 3)), 3)  # what is made anew fades into the photo
    assert hidden.occluded[private].all()
    assert not hidden.occluded[~faded].any()
    assert (hidden.image[~faded] == painted.image[~faded]).all()
    assert (hidden.provenance[private] != plain.provenance[private]).all()
