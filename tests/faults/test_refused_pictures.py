"""A picture that cannot be used: its wall is made from the next source, and the reason told. Machine faults are others."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace as Value
from typing import Any

import numpy as np
import pytest
from PIL import Image

from facade_core.core.errors import FacadeError, ImageError
from facade_core.core.types import SHIPPED_MODELS, Pose
from facade_core.facade.evidence import Evidence
from facade_core.imagery.rectify.fusion import ChartView
from tasks.engine.forecast import describe_rejected_inputs
from tasks.stages.facades import evidence, exemplar_facades
from tasks.stages.facades import worker as facade
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.imagery import ChosenExemplar, FacadeImagery
from tasks.stages.shared.images import read_panorama, read_textures

POSE = Pose(0.0, 0.0, 2.5, 0.0)
SIZE = (24, 32)
PANORAMAS = ((Path("one.jpg"), POSE), (Path("two.jpg"), POSE))


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, Any, str, list[Exception]]]:
    """Make a facade of some imagery: by the kind of the source, the facade, the source and what was refused.

    shown: what each source shows, or is refused by.
    """
    plan: Any = Value(
        facades=Value(
            id=["a-0"],
            chart=[0],
            height=[8.0],
            width=[10.0],
            floors=[2],
            house=[7],
            run=[0],
            along=[0.0],
            role=[0],
            roofed=[False],
        ),
        scene=Value(placement=Value(shape=lambda _: SIZE, texels_per_metre=[4.0])),
        street_density=[4.0],
    )

    def maker(
        imagery: FacadeImagery, shown: dict[str, Any], walls: str = "exemplar"
    ) -> tuple[str, Any, str, list[Exception]]:
        def evidence_of(source: str, *_: Any) -> Evidence | None:
            if isinstance(shown[source], Exception):
                raise shown[source]
            return shown[source]

        monkeypatch.setattr(facade, "read_evidence", evidence_of)
        monkeypatch.setattr(exemplar_facades, "load_exemplar_analysis", lambda *_, **__: (None, 0.05))
        monkeypatch.setattr(exemplar_facades, "facade_wall", lambda *_: None)
        monkeypatch.setattr(exemplar_facades, "build_facade_from_exemplar", lambda *_, **__: "made")
        refused: list[Exception] = []
        view = Value(plan=plan, scene=plan.scene, charts=(0,), run=None)
        views = dict.fromkeys(("view", "between", "house_view", "own"), view)
        seeds = dict.fromkeys(("seed", "wall_seed", "building_seed"), 1)
        others = {"models": SHIPPED_MODELS, "walls": walls, "texture_files": {}, "coloured_by": ()}
        inputs: Any = Value(**vars(imagery), **views, **seeds, **others)
        group: Any = None
        made = facade.texture_from_pictures(0, inputs, refused)
        if made is None:
            made = facade._texture_from_exemplar(group, 0, inputs, lambda _: None, lambda _: None, ())
        return made.kind, made.facade, made.source, refused

    return maker


def test_the_next_source_is_taken(make: Callable[..., Any]) -> None:
    broken = ImageError("a-0.png: broken")
    hidden = Evidence(
        image=np.zeros((*SIZE, 3), np.uint8), hidden=np.ones(SIZE, bool), confidence=np.zeros(SIZE), source="p"
    )
    both = FacadeImagery(photo=Path("a-0.png"), panoramas=PANORAMAS, exemplar=ChosenExemplar(0, "brick"))
    kind, made, source, refused = make(both, {"photo": broken, "panoramas": hidden})
    assert (kind, made, source) == ("", "made", "brick")
    assert [str(error) for error in refused] == ["a-0.png: broken"], "panoramas were not taken of this facade"
    _, _, source, refused = make(both, {"photo": hidden, "panoramas": None})
    assert source == "brick"
    assert str(refused[0]).startswith("p: only 0.0% of the facade is seen")
    kind, made, source, refused = make(both, {"photo": None, "panoramas": None})
    assert (kind, source, refused) == ("", "brick", [])
    left = FacadeImagery(photo=Path("a-0.png"))
    assert make(left, {"photo": broken}, walls="translate")[:3] == ("", None, "translator")
    with pytest.raises(FacadeError, match="no picture of it and no usable exemplar"):
        make(left, {"photo": broken})


@pytest.mark.parametrize("fault", [MemoryError(), OSError(errno.EIO, "Input/output error")])
def test_a_fault_of_the_machine_refuses_no_picture(make: Callable[..., Any], fault: Exception) -> None:
    with pytest.raises(type(fault)):
        make(FacadeImagery(photo=Path("a-0.png"), exemplar=ChosenExemplar(0, "brick")), {"photo": fault})


def test_of_several_panoramas_those_that_serve_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []

    def view(plan: Any, chart: int, path: Path, pose: Pose, size: tuple[int, int], parser: None) -> Any:
        if path.stem == "one":
            raise ImageError("one.jpg: broken")
        taken.append(path.name)
        return path, np.zeros(SIZE, np.uint8)

    seen = np.ones(SIZE, bool)
    fused = Value(
        seen=seen,
        occluded=~seen,
        rgb=np.zeros((*SIZE, 3), np.uint8),
        confidence=np.ones(SIZE),
        source=np.zeros(SIZE, np.int8),
    )
    monkeypatch.setattr(evidence, "_view_of_panorama", view)
    monkeypatch.setattr(
        evidence, "_reject_other_planes", lambda plan, chart, newest, earlier, refused: (newest, earlier)
    )
    monkeypatch.setattr(evidence, "fuse_views", lambda views: fused)
    monkeypatch.setattr(evidence, "capture_date", {Path("two.jpg"): "2024-05-17"}.get)
    refused: list[Exception] = []
    plan: Any = None
    found = read_evidence("panoramas", plan, 0, SIZE, FacadeImagery(panoramas=PANORAMAS), {}, refused)
    assert found is not None
    assert (found.source, taken, found.captured) == ("two.jpg", ["two.jpg"], "2024-05-17")
    assert list(map(str, refused)) == ["one.jpg: broken"]
    assert read_evidence("panoramas", plan, 0, SIZE, FacadeImagery(panoramas=PANORAMAS[:1]), {}, refused) is None


@pytest.mark.parametrize(
    ("shown", "metres", "textured", "enough"),
    [
        (0.4, (4.0, 3.0), True, True),
        (0.25, (10.0, 26.0), False, True),  # the foot of a tall building
        (0.25, (10.0, 8.0), False, False),  # 20 square metres
        (0.15, (40.0, 26.0), False, False),  # 156 of a front that is mostly a guess
        (0.25, (10.0, 26.0), True, False),  # the model's texture shows more
    ],
)
def test_a_facade_of_which_pictures_show_little_is_completed_where_that_is_two_storeys(
    monkeypatch: pytest.MonkeyPatch, shown: float, metres: tuple[float, float], textured: bool, enough: bool
) -> None:
    seen = np.broadcast_to(np.arange(SIZE[0])[:, None] >= SIZE[0] * (1 - shown), SIZE)
    view = ChartView(np.zeros((*SIZE, 3), np.uint8), seen, seen.astype(np.float32))
    monkeypatch.setattr(evidence, "_view_of_panorama", lambda *_: (view, view.rgb[..., 0]))
    monkeypatch.setattr(evidence, "capture_date", lambda path: None)
    monkeypatch.setattr(evidence, "_reject_other_planes", lambda plan, chart, newest, earlier, _: (newest, earlier))
    monkeypatch.setattr(evidence, "wall_surroundings_mask", lambda *_, **__: None)
    plan: Any = Value(scene=Value(charts=Value(size=np.array([metres]))))
    imagery = FacadeImagery(panoramas=PANORAMAS, textured=textured)
    assert (read_evidence("panoramas", plan, 0, SIZE, imagery, {}, []) is not None) == enough


def test_a_picture_of_another_building_is_refused_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    view = ChartView(np.zeros((*SIZE, 3), np.uint8), np.ones(SIZE, bool), np.ones(SIZE, np.float32))
    monkeypatch.setattr(evidence, "_view_of_panorama", lambda *_: (view, view.rgb[..., 0]))
    monkeypatch.setattr(evidence, "capture_date", lambda path: None)
    monkeypatch.setattr(evidence, "camera_in_chart_frame", lambda *_: None)
    monkeypatch.setattr(evidence, "explain_other_planes", lambda *_: ["", "turned by 25 degrees"])
    plan: Any = Value(scene=Value(placement=Value(shape=lambda _: SIZE, texels_per_metre=[4.0])))
    refused: list[Exception] = []
    found = read_evidence("panoramas", plan, 0, SIZE, FacadeImagery(panoramas=PANORAMAS), {}, refused)
    assert found is not None
    assert found.source == "one.jpg"
    (reason,) = map(str, refused)
    assert reason.startswith("two.jpg: shows another plane than this wall, turned by 25 degrees; ")
    monkeypatch.setattr(evidence, "explain_other_planes", lambda *_: ["turned by 25 degrees"] * 2)
    assert read_evidence("panoramas", plan, 0, SIZE, FacadeImagery(panoramas=PANORAMAS), {}, refused) is None


def test_what_is_set_aside_is_told_before_anything_is_done() -> None:
    aside = [
        ("photo", "z-9.png", "no facade has the id z-9"),
        ("building", "7", "crosses itself"),
        ("photo", "y.png", "r"),
    ]
    outline: Any = Value(set_aside=tuple(aside))
    assert describe_rejected_inputs(outline.set_aside) == [
        "photo set aside: z-9.png: no facade has the id z-9; 1 more photo",
        "building set aside: 7: crosses itself",
    ]


def test_a_texture_that_cannot_be_read_leaves_the_others(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.png" for name in ("one", "two")]
    Image.new("RGB", (16, 16), (9, 9, 9)).save(paths[0])
    paths[1].write_bytes(b"no picture")
    refused: list[Exception] = []
    assert read_textures(dict(enumerate(paths)), refused).keys() == {0}
    assert ["two.png" in str(error) for error in refused] == [True]


def test_a_panorama_that_changed_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "one.png"
    for number, colour in enumerate((10, 20)):  # a worker serves many runs
        Image.new("RGB", (32, 16), (colour, 0, 0)).save(path)
        os.utime(path, ns=(number, number))
        assert read_panorama(path)[0, 0, 0] == colour
