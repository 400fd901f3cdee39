import json
import shutil

import numpy as np
import pytest

from facade_core.core.errors import ImageError, ModelError
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.parsing import forest
from facade_core.parsing.segmenter import parse

pytest.importorskip("skl2onnx")

from facade_core.parsing import forest_training


def facade(seed):
    rng = np.random.default_rng(seed)
    labels = np.full((96, 80), FacadeClass.WALL, np.uint8)
    labels[:12] = FacadeClass.SKY
    labels[12:24] = FacadeClass.ROOF
    for y in (32, 64):
        for x in (8, 32, 56):
            labels[y : y + 20, x : x + 14] = FacadeClass.WINDOW
    labels[90:, :5] = UNKNOWN
    colour = np.zeros((256, 3))
    colour[[FacadeClass.WALL, FacadeClass.WINDOW, FacadeClass.ROOF, FacadeClass.SKY]] = [
        [210, 190, 160],
        [50, 60, 90],
        [110, 60, 50],
        [190, 215, 240],
    ]
    image = colour[labels] + rng.normal(0, 6, (96, 80, 3))
    return np.clip(image, 0, 255).astype(np.uint8), labels


@pytest.fixture(scope="module")
def samples():
    return [facade(seed) for seed in range(3)]


@pytest.fixture(scope="module")
def model(samples):
    return forest_training.train(samples, seed=3)


def test_a_trained_model_parses_what_it_was_taught(samples, model, tmp_path):
    path = tmp_path / "own.onnx"
    forest_training.save(model, path, training_set=["a", "b", "c"], seed=3, figures={"pixel_accuracy": 1.0})
    record = json.loads(path.with_suffix(".json").read_text())
    assert (record["training_set"], record["seed"]) == (["a", "b", "c"], 3)
    image, labels = facade(9)
    found = parse(image, model=path)
    known = labels != UNKNOWN
    assert (found.labels[known] == labels[known]).mean() > 0.9
    unseen = [CLASSES.index(name) for name in ("balcony", "door", "shop")]
    assert found.confidence[..., unseen].max() == 0


def test_equal_seeds_give_equal_bytes_and_progress_is_told(samples, model):
    told = []
    assert forest_training.train(samples, seed=3, progress=lambda *step: told.append(step)) == model
    assert {step for step, _, _ in told} == {"features", "first forest", "held-out votes", "second forest"}
    assert all(done < total for _, done, total in told)


def test_one_sample_is_enough(samples):
    assert forest_training.train(samples[:1], seed=0)


def test_the_file_votes_as_the_forests_do(tmp_path):
    rng = np.random.default_rng(0)
    forests, rows = {}, {}
    for name, width in ((forest.FIRST, 150), (forest.SECOND, 325)):
        rows[name] = rng.normal(size=(600, width)).astype(np.float32)
        target = rng.integers(0, 5, 600) + (rows[name][:, 0] > 0)
        target[target == 2] = 3
        forests[name] = forest_training._fit(rows[name], target, 5, rng)
    path = tmp_path / "two.onnx"
    forest_training.save(forest_training._to_onnx(*forests.values()), path, training_set=[], seed=0)
    loaded = forest.load(path)
    for name in forests:
        expected = forest_training._vote(forests[name], rows[name])
        np.testing.assert_allclose(loaded.vote(name, rows[name][None])[0], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("image", "labels"),
    [
        (np.zeros((8, 8, 4), np.uint8), np.zeros((8, 8), np.uint8)),
        (np.zeros((8, 8, 3), np.uint8), np.zeros((8, 9), np.uint8)),
        (np.zeros((8, 8, 3), np.uint8), np.full((8, 8), 12, np.uint8)),
        (np.zeros((8, 8, 3), np.uint8), np.full((8, 8), UNKNOWN, np.uint8)),
    ],
)
def test_refuses_unusable_samples(image, labels):
    with pytest.raises(ImageError, match="training sample 0"):
        forest_training.train([(image, labels)], seed=0)


def test_refuses_no_samples():
    with pytest.raises(ImageError, match="no training samples"):
        forest_training.train([], seed=0)


@pytest.fixture
def copy(tmp_path):
    for suffix in (".onnx", ".json"):
        shutil.copy(forest.SHIPPED.with_suffix(suffix), tmp_path / f"forest{suffix}")
    return tmp_path / "forest.onnx"


def test_a_changed_file_is_refused(copy):
    forest.load(copy)
    content = bytearray(copy.read_bytes())
    content[len(content) // 2] ^= 1
    copy.write_bytes(content)
    with pytest.raises(ModelError, match="checksum"):
        forest.load(copy)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"feature_version": 0}, "other classes or features"), ({"classes": ["wall"]}, "other classes or features")],
)
def test_a_model_of_other_features_is_refused(copy, change, message):
    record = json.loads(copy.with_suffix(".json").read_text())
    copy.with_suffix(".json").write_text(json.dumps(record | change))
    with pytest.raises(ModelError, match=message):
        forest.load(copy)


def test_broken_records_and_files_are_refused(copy):
    record = json.loads(copy.with_suffix(".json").read_text())
    copy.with_suffix(".json").write_text("{")
    with pytest.raises(ModelError, match="not valid JSON"):
        forest.load(copy)
    import hashlib

    copy.write_bytes(b"no model")
    copy.with_suffix(".json").write_text(json.dumps(record | {"sha256": hashlib.sha256(b"no model").hexdigest()}))
    with pytest.raises(ModelError, match="onnxruntime"):
        forest.load(copy)
    copy.with_suffix(".json").unlink()
    with pytest.raises(ModelError, match="no such file"):
        forest.load(copy)


def test_the_shipped_model_is_small_and_described():
    assert forest.SHIPPED.stat().st_size < 10e6
    record = json.loads(forest.SHIPPED.with_suffix(".json").read_text())
    assert record["figures"]["ecp"]["pixel_accuracy"] > 0.82
    assert forest.SHIPPED.with_suffix(".md").is_file()
