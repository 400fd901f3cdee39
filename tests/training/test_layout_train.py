"""What the layout network learns from."""

from facade_core.core.labels import ELEMENT_CLASSES
from training.layout.train import MAX_PLAN_ELEMENTS, MIN_ELEMENTS, _plan_layouts


def test_plans_of_painted_facades_are_layouts() -> None:
    layouts = _plan_layouts(12)
    assert layouts == _plan_layouts(12)
    assert len(layouts) == 12
    for elements, domain in layouts:
        assert MIN_ELEMENTS <= len(elements) <= MAX_PLAN_ELEMENTS
        assert {e.label for e in elements} <= set(ELEMENT_CLASSES)
        assert all(0 <= (e.x0 + e.x1) / 2 <= domain[2] and 0 <= (e.y0 + e.y1) / 2 <= domain[3] for e in elements)
