"""Layouts as JSON lines: what is no layout is refused, the labels are mapped, and elements come back as they were."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalogs.readers.layouts import LAYOUT_LABELS
from facade_core.core.errors import InputError
from facade_core.core.types import Element
from training.datasets.layouts import read_layouts, split_layouts_for_training


def write(path, *records):
    path.write_text("".join(json.dumps(record) + "\n" for record in records))
    return path


def thing(label, *sides):
    return {"label": label, **dict(zip(("x0", "y0", "x1", "y1"), sides, strict=True))}


def test_labels_are_mapped_and_the_rest_is_counted(tmp_path):
    objects = [
        thing("facade", 10, 0, 90, 100),
        thing("window", 20, 20, 30, 40),
        thing("window", 20, 20, 30, 40),
        thing("store", 40, 80, 60, 99),
        thing("cornice", 10, 0, 90, 5),
        thing("cornice", 10, 50, 90, 55),
        thing("window", 20, 20, 20, 40),
        thing("door", 0, 80, 8, 99),
    ]
    path = write(tmp_path / "l.jsonl", {"image": "a.jpg", "width": 100, "height": 100, "objects": objects})
    (record,) = read_layouts(path)
    assert record.domain == (10, 0, 90, 100)
    assert record.elements == (Element("window", 20, 20, 30, 40), Element("shop", 40, 80, 60, 99))
    assert dict(record.dropped) == {"cornice": 2, "window": 1, "door": 1}
    assert record.name == "a.jpg#1"


def test_without_a_facade_the_domain_is_the_picture(tmp_path):
    (record,) = read_layouts(write(tmp_path / "l.jsonl", {"width": 8.5, "height": 12, "objects": []}))
    assert record.domain == (0, 0, 8.5, 12)


@pytest.mark.parametrize(
    "record",
    [
        {"width": 10, "height": 10},
        {"width": 0, "height": 10, "objects": []},
        {"width": 10, "height": 10, "objects": [{"label": "window", "x0": 1}]},
        {"width": 10, "height": float("nan"), "objects": []},
        [],
    ],
)
def test_a_line_that_is_no_layout_is_refused_by_number(tmp_path, record):
    path = write(tmp_path / "l.jsonl", {"width": 1, "height": 1, "objects": []}, record)
    with pytest.raises(InputError, match="line 2"):
        list(read_layouts(path))


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.jsonl"):
        list(read_layouts(tmp_path / "none.jsonl"))


def test_folds_part_the_layouts(tmp_path):
    path = write(tmp_path / "l.jsonl", *({"width": 1, "height": 1, "objects": []} for _ in range(7)))
    records = list(read_layouts(path))
    train, held_out = split_layouts_for_training(records, 1)
    assert [r.name for r in held_out] == ["layout#2", "layout#7"]
    assert len(train) == 5


@st.composite
def rectangles(draw: st.DrawFn, size: tuple[float, float]) -> dict[str, Any]:
    """A rectangle of the picture, or one that has no class or no area."""
    (x0, x1), (y0, y1) = (sorted(draw(st.tuples(*[st.floats(0, side)] * 2))) for side in size)
    return thing(draw(st.sampled_from([*LAYOUT_LABELS, "cornice"])), x0, y0, x1, y1)


@settings(max_examples=40)
@given(st.data())
def test_layouts_come_back(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    path: Path = tmp_path_factory.mktemp("layouts") / "l.jsonl"
    records = []
    for number in range(data.draw(st.integers(0, 3))):
        size = data.draw(st.tuples(*[st.floats(1, 1e4)] * 2))
        objects = data.draw(st.lists(rectangles(size), max_size=6))
        records.append({"image": f"{number}.jpg", "width": size[0], "height": size[1], "objects": objects})
    found = list(read_layouts(write(path, *records)))
    assert [layout.name for layout in found] == [f"{i}.jpg#{i + 1}" for i in range(len(records))]
    for layout, record in zip(found, records, strict=True):
        assert layout.domain == (0, 0, record["width"], record["height"])
        kept = [o for o in record["objects"] if o["label"] in LAYOUT_LABELS and o["x0"] < o["x1"] and o["y0"] < o["y1"]]
        elements = [Element(LAYOUT_LABELS[o["label"]], o["x0"], o["y0"], o["x1"], o["y1"]) for o in kept]
        assert layout.elements == tuple(dict.fromkeys(elements))
        assert dict(layout.dropped) == Counter(o["label"] for o in record["objects"] if o not in kept)
