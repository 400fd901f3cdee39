"""`streetloom complete`: ranked completions of a picture or of a layout file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from benchmarks.painter.facade import paint_facade
from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tasks.ranked_completions import complete_file


def write_layout(path: Path, **more: object) -> Path:
    """Write a layout whose right half is hidden."""
    windows = [
        {"label": "window", "x0": x, "y0": y, "x1": x + 10, "y1": y + 15} for x in (10, 30, 50) for y in (10, 40, 70)
    ]
    layout = {"width": 140, "height": 100, "objects": windows, "visible": [{"x0": 0, "y0": 0, "x1": 65, "y1": 100}]}
    path.write_text(json.dumps(layout | more))
    return path


def test_completions_are_ranked_and_begin_with_what_is_observed(tmp_path: Path) -> None:
    shown = CliRunner().invoke(command_line, ["complete", str(write_layout(tmp_path / "layout.json")), "--n", "3"])
    assert shown.exit_code == 0, shown.output
    found = json.loads(shown.output)
    assert found["domain"] == [0, 0, 140, 100]
    scores = [one["score"] for one in found["completions"]]
    assert 1 <= len(scores) <= 3
    assert scores == sorted(scores, reverse=True)
    objects = found["completions"][0]["objects"]
    assert [e["is_observed"] for e in objects] == [True] * 9 + [False] * (len(objects) - 9)
    assert all(e["x0"] >= 65 for e in objects[9:])
    assert len(objects) > 9


def test_each_completion_has_a_picture_in_which_added_elements_are_filled(tmp_path: Path) -> None:
    arguments = [str(write_layout(tmp_path / "layout.json")), "--n", "2", "--to", str(tmp_path / "new" / "pictures")]
    shown = CliRunner().invoke(command_line, ["complete", *arguments])
    assert shown.exit_code == 0, shown.output
    completions = json.loads(shown.output)["completions"]
    files = [Path(one["picture"]) for one in completions]
    assert files == [tmp_path / "new" / "pictures" / f"completion-{rank}.png" for rank in range(1, len(files) + 1)]
    drawn = np.asarray(Image.open(files[0]).convert("RGB"))
    scale = drawn.shape[1] / 140
    for e in completions[0]["objects"]:
        middle = drawn[int((e["y0"] + e["y1"]) / 2 * scale), int((e["x0"] + e["x1"]) / 2 * scale)]
        assert (np.ptp(middle.astype(int)) > 0) != e["is_observed"], "grey inside an outline"


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/pictures: cannot be written"):
        complete_file(write_layout(tmp_path / "layout.json"), 1, tmp_path / "file" / "pictures")


def test_a_picture_is_completed_where_it_is_transparent(tmp_path: Path) -> None:
    painted = paint_facade((12.0, 14.0), floors=3, columns=5, style="classicism", metres_per_pixel=0.08, seed=3)
    alpha = np.full(painted.labels.shape, 255, np.uint8)
    alpha[:, alpha.shape[1] * 3 // 5 :] = 0
    Image.fromarray(np.dstack([painted.image, alpha])).save(tmp_path / "facade.png")
    found = complete_file(tmp_path / "facade.png", 3, tmp_path)
    assert found["completions"]
    for one in found["completions"]:
        assert np.asarray(Image.open(one["picture"])).shape[1] % painted.labels.shape[1] == 0
        assert any(e["is_observed"] for e in one["objects"])
    assert any(not e["is_observed"] for e in found["completions"][0]["objects"])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"visible": [1]}, "is no layout"),
        ({"objects": [{"label": "window"}]}, "is no layout"),
        ({"width": 0}, "no area"),
    ],
)
def test_files_that_are_no_layout_are_refused(tmp_path: Path, more: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        complete_file(write_layout(tmp_path / "layout.json", **more), 2)
