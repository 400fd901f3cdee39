"""Pictures matched to the entries of a file by the ends of their paths; the right entries are stated beside each case."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from pathlib import Path

import pytest

from catalogs.readers.pictures.picture_matches import find_names, find_unmatched_names, picture_id, select_entries

FOLDER = Path("/data/images")
CASES: dict[str, tuple[Sequence[str], dict[str, str]]] = {
    "plain": (["0.jpg", "1.jpg"], {"0.jpg": "0.jpg", "1.jpg": "1.jpg"}),
    "stems": (["0", "1"], {"0.jpg": "0"}),
    "folders of a rig": (["left/0.jpg", "right/0.jpg"], {"left/0.jpg": "left/0.jpg", "right/0.jpg": "right/0.jpg"}),
    "folders of another machine": (
        ["C:\\run\\left\\0.jpg", "C:\\run\\right\\0.jpg"],
        {"left/0.jpg": "C:\\run\\left\\0.jpg"},
    ),
    "folders in capitals": (["Left/0.JPG", "Right/0.JPG"], {"left/0.jpg": "Left/0.JPG", "right/0.jpg": "Right/0.JPG"}),
    "one folder of the rig": (["images/0.jpg", "right/0.jpg"], {"0.jpg": "images/0.jpg"}),
    "thumbnails in a folder": (["0.jpg"], {"0.jpg": "0.jpg", "thumbs/0.jpg": ""}),
    "current folder": (["./0.jpg"], {"0.jpg": "./0.jpg", "thumbs/0.jpg": ""}),
    "names of Finder": (
        [unicodedata.normalize("NFD", "Bäcker.jpg")],
        {"Bäcker.jpg": unicodedata.normalize("NFD", "Bäcker.jpg")},
    ),
    "two suffixes": (["0.jpg", "0.png"], {"0.png": "0.png", "0.jpg": "0.jpg"}),
    "letter case alone": (["a.jpg", "A.jpg"], {"a.jpg": "a.jpg", "A.jpg": "A.jpg"}),
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_pictures_have_the_entries_of_their_paths(case: tuple[Sequence[str], dict[str, str]]) -> None:
    names, expected = case
    found = select_entries({name: (name,) for name in names}, "poses.csv", FOLDER, [FOLDER / one for one in expected])
    assert {path.relative_to(FOLDER).as_posix(): entry for path, entry in found.items()} == {
        picture: (name,) for picture, name in expected.items() if name
    }


def test_what_may_be_several_is_named() -> None:
    paths = [FOLDER / "a/0.jpg", FOLDER / "b/0.jpg"]
    found = select_entries({"0.jpg": 1, "1.jpg": 2}, "poses.csv", FOLDER, paths)
    assert (
        found[paths[0]]
        == "a/0.jpg and b/0.jpg may both be 0.jpg of poses.csv; name pictures and their folders as there"
    )
    found = select_entries({"a/0.jpg": 1, "b/0.jpg": 2}, "poses.csv", FOLDER, [FOLDER / "0.jpg"])
    assert found[FOLDER / "0.jpg"] == (
        "a/0.jpg and b/0.jpg in poses.csv may both be it; name pictures and their folders as there"
    )
    assert find_unmatched_names(["a/0.jpg", "9.jpg"], paths) == ["9.jpg"]


def test_ends_of_names() -> None:
    names = ["left/0.jpg", "right/0.jpg", "right/1.jpg"]
    assert find_names("0", names) == names[:2]
    assert find_names("Right/0.jpg", names) == ["right/0.jpg"]
    assert picture_id(FOLDER / "left/0.jpg", FOLDER) == "left-0"
