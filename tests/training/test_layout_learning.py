import json

import numpy as np
import pytest

from facade_core.core.errors import LayoutError, ModelFileError
from facade_core.core.types import Element
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.model import (
    SHIPPED_LAYOUT_MODEL,
    LayoutModel,
    default_layout_model,
    load_layout_model,
)
from training.layout import learning
from training.layout.train import save_layout_model

DOMAIN = (0.0, 0.0, 200.0, 160.0)


def layouts(count=12):
    rng = np.random.default_rng(0)
    found = []
    for _ in range(count):
        columns, floors = rng.integers(3, 6), rng.integers(2, 4)
        xs, ys = (np.arange(columns) + 0.5) * 200 / columns, (np.arange(floors) + 0.5) * 120 / floors
        elements = [Element("window", x - 8, y - 12, x + 8, y + 12) for y in ys for x in xs]
        elements.append(Element("door", xs[1] - 10, 128, xs[1] + 10, 160))
        found.append((elements, DOMAIN))
    return found


@pytest.fixture(scope="module")
def trained() -> LayoutModel:
    made = layouts()
    return learning.learn_layout_model(made, names=[str(k) for k in range(len(made))], seed=3)


@pytest.mark.long
def test_what_is_learned(trained):
    assert trained.weights.min() > 0
    assert np.linalg.norm(trained.weights) == pytest.approx(1)
    assert trained.label_shares[0] > 0.8
    assert trained.label_shares.sum() == pytest.approx(1)
    assert trained.training_set == tuple(str(k) for k in range(12))
    assert trained.priors.floor_progressions.shape[1] == 4
    assert ((trained.min_probability >= 0.05) & (trained.min_probability <= 0.5)).all()
    assert trained.priors.door_sizes[0, 0] == pytest.approx(20 / 16, rel=0.05)


def test_a_saved_model_completes_alike(trained, tmp_path):
    save_layout_model(trained, tmp_path / "m.json", seed=3)
    save_layout_model(load_layout_model(tmp_path / "m.json"), tmp_path / "again.json", seed=3)
    assert (tmp_path / "m.json").read_bytes() == (tmp_path / "again.json").read_bytes()
    elements, domain = layouts()[0]
    region = [(0.0, 0.0, 100.0, 160.0)]
    seen = [e for e in elements if e.x0 < 100]
    model = load_layout_model(tmp_path / "m.json")
    assert complete(seen, domain, region, model=model) == complete(seen, domain, region, model=trained)
    for saved, own in zip(model.trees, trained.trees, strict=True):
        np.testing.assert_array_equal(saved, own)


def test_too_few_layouts_are_refused():
    with pytest.raises(LayoutError, match="too few"):
        learning.learn_layout_model(layouts(3), names=["a", "b", "c"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.update(sha256="0"), "checksum"),
        (lambda r: r.update(labels=["window"]), "another version"),
        (lambda r: r["model"].pop("weights"), "checksum"),
        (lambda r: r.pop("model"), "not a layout model"),
    ],
)
def test_damaged_models_are_refused(tmp_path, change, message):
    record = json.loads(SHIPPED_LAYOUT_MODEL.read_text())
    change(record)
    (tmp_path / "m.json").write_text(json.dumps(record))
    with pytest.raises(ModelFileError, match=message):
        load_layout_model(tmp_path / "m.json")


def test_missing_and_garbled_files_are_refused(tmp_path):
    with pytest.raises(ModelFileError, match="no such layout model"):
        load_layout_model(tmp_path / "none.json")
    (tmp_path / "m.json").write_text("{")
    with pytest.raises(ModelFileError, match="not valid JSON"):
        load_layout_model(tmp_path / "m.json")


def test_the_shipped_model_holds_every_fifth_facade_out():
    numbers = {int(name.rsplit("#", 1)[1]) for name in default_layout_model().training_set}
    assert all((number - 1) % 5 for number in numbers)
    assert len(numbers) == 253


def test_sizes_of_shops_leave_out_those_that_hang_higher():
    windows = [Element("window", x, y, x + 1, y + 1.5) for x in (1, 4) for y in (1, 4)]
    shop, sign = Element("shop", 1, 8, 3, 9.9), Element("shop", 1, 3, 1.5, 7.9)
    sizes = learning._typical_sizes([([*windows, shop, sign], (0.0, 0.0, 6.0, 10.0))] * 4, "shop", 2, 0)
    assert sizes[:, 2].max() < 0.5
    assert sizes[:, 0] == pytest.approx([2.0] * len(sizes))
