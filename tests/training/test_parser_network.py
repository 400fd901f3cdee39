from dataclasses import dataclass

import numpy as np
import pytest

from facade_core.core.errors import ImageError, ModelFileError
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass

pytest.importorskip("torch", reason="torch is absent: make train-setup")

import torch

from facade_core.parsing import network
from facade_core.parsing.segmenter import parse
from tests.training.progress import interrupt_at, listening
from training.datasets.facades import ANY_CLASS
from training.parser import network_export, network_training
from training.parser.network import ParserNetwork
from training.parser.network_training import TrainingSchedule

COURSE = TrainingSchedule(steps=4, per_step={"facades": 2})


@dataclass(frozen=True)
class Photo:
    image: np.ndarray
    possible: np.ndarray
    occluder: np.ndarray
    outside: np.ndarray


def photo(seed, classes=((FacadeClass.WALL,), (FacadeClass.WINDOW,), (FacadeClass.SKY,))):
    rng = np.random.default_rng(seed)
    part = np.zeros((96, 80), np.intp)
    part[30:60, 20:60], part[:20] = 1, 2
    colours = np.array([[210, 190, 160], [50, 60, 90], [190, 215, 240]])
    image = np.clip(colours[part] + rng.normal(0, 6, (96, 80, 3)), 0, 255).astype(np.uint8)
    possible = np.array([sum(1 << n for n in some) for some in classes], np.uint8)[part]
    occluder = np.zeros((96, 80), np.uint8)
    occluder[70:90, 30:60] = 1
    return Photo(image, possible, occluder, (part == 2).astype(np.uint8))


@pytest.fixture(scope="module")
def start():
    """Weights without ImageNet's: small random ones."""
    torch.manual_seed(0)
    return ParserNetwork().state_dict()


def copy(weights):
    return {name: value.clone() for name, value in weights.items()}


def train(start, course=COURSE, **options):
    return network_training.train_parser_network(
        {"facades": [photo(0), photo(1)]}, course, seed=5, start=copy(start), **options
    )


@pytest.fixture(scope="module")
def weights(start):
    return train(start)


def test_equal_seeds_give_equal_weights_and_steps_change_them(start, weights):
    again = train(start)
    assert all(torch.equal(weights[name], again[name]) for name in weights)
    assert not torch.equal(weights["head.weight"], start["head.weight"])
    assert not torch.equal(weights["stem.weight"], start["stem.weight"])


def test_an_interrupted_run_ends_where_an_uninterrupted_one_does(start, weights, tmp_path, monkeypatch):
    monkeypatch.setattr(network_training, "_SAVE_INTERVAL", 1)
    state = tmp_path / "run" / "network.state"
    with pytest.raises(KeyboardInterrupt), listening(interrupt_at(2)):
        train(start, state=state)
    with pytest.raises(ModelFileError, match="2 of 4 steps"):
        network_training.read_finished_weights(state)
    events = []
    with listening(events.append):
        resumed = train(start, state=state)
    assert [(event.stage, event.finished, event.total) for event in events] == [("network", n, 4) for n in (2, 3, 4)]
    assert all(torch.equal(weights[name], resumed[name]) for name in weights)
    assert all(
        torch.equal(weights[name], value) for name, value in network_training.read_finished_weights(state).items()
    )


def test_the_state_of_another_run_is_refused(start, tmp_path):
    state = tmp_path / "network.state"
    with pytest.raises(ModelFileError, match="no such file"):
        network_training.read_finished_weights(state)
    train(start, state=state)
    with pytest.raises(ModelFileError, match="another training run"):
        train(start, TrainingSchedule(4, {"facades": 3}), state=state)
    with pytest.raises(ModelFileError, match="another training run"):
        train(start, TrainingSchedule(9, {"facades": 2}), state=state)  # the rate has fallen already
    state.write_bytes(b"nothing")
    with pytest.raises(ModelFileError, match="not the state"):
        train(start, state=state)


def test_a_run_can_be_made_longer_while_the_rate_has_not_fallen(start, tmp_path, monkeypatch):
    monkeypatch.setattr(network_training, "_SAVE_INTERVAL", 1)
    state, long = tmp_path / "network.state", TrainingSchedule(10, {"facades": 2})
    with pytest.raises(KeyboardInterrupt), listening(interrupt_at(3)):
        train(start, long, state=state)
    with pytest.raises(ModelFileError, match="another training run"):
        train(start, TrainingSchedule(3, {"facades": 2}), state=state)  # there the rate would have fallen
    events = []
    with listening(events.append):
        train(start, TrainingSchedule(8, {"facades": 2}), state=state)
    assert (events[0].finished, events[0].total) == (3, 8)


def test_a_plateau_does_not_depend_on_the_number_of_steps():
    rates = [[network_training._rate_share(step, steps) for step in range(steps)] for steps in (2000, 4000)]
    assert rates[0][:1000] == rates[1][:1000]
    assert max(rates[0]) == 1
    assert rates[0][-1] < 0.01


def test_the_file_computes_what_the_network_does(weights, tmp_path):
    path = tmp_path / "own.onnx"
    network_export.save_network(weights, path, training_set=["facades/a"], seed=5)
    image = np.random.default_rng(2).uniform(0, 255, (1, 3, 128, 96)).astype(np.float32)
    place = network.cell_position_planes(128, 96, np.array([-1, -1, 1, 1]))[None]
    trained = ParserNetwork()
    trained.load_state_dict(weights)
    with torch.no_grad():
        expected = trained.eval()(torch.from_numpy(image), torch.from_numpy(place)).numpy()
    found = network.load_network(path).session.run(None, {"image": image, "place": place})[0]
    assert found.shape == (1, len(CLASSES) + 2, 64, 48)
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert parse(photo(3).image, model=path).labels.shape == (96, 80)


def test_it_learns(start):
    """A few steps on one photo bring the loss down, though one class is told as one of two."""
    shown = {"facades": [photo(0, ((FacadeClass.WALL,), (FacadeClass.WINDOW, FacadeClass.WALL), (FacadeClass.SKY,)))]}
    course, losses = TrainingSchedule(12, {"facades": 2}, rate=5e-3), []
    backward = network_training._backward

    def noted(part, views):
        losses.append(backward(part, views))
        return losses[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network_training, "_backward", noted)
        network_training.train_parser_network(shown, course, seed=1, start=copy(start))
    assert np.mean(losses[-4:]) < 0.7 * np.mean(losses[:4])


class Fixed:
    """A network whose logits are given."""

    def __init__(self, logits):
        self.logits = torch.tensor(logits, dtype=torch.float32)[None, :, None, None].expand(1, 9, 4, 4)

    def __call__(self, image, place):
        return self.logits


def loss(logits, possible, occluder, outside=UNKNOWN):
    classes, hidden, beyond = (
        torch.full((1, 8, 8), value, dtype=torch.uint8) for value in (possible, occluder, outside)
    )
    image, place = torch.zeros((1, 8, 8, 3), dtype=torch.uint8), torch.zeros((1, 2, 1, 1))
    return network_training._loss(
        Fixed(logits), [image, classes, hidden, (hidden != UNKNOWN).float(), beyond, place]
    ).item()


def test_the_loss_sums_over_the_classes_that_a_pixel_may_be():
    logits = [1.0, 2.0, 0, 0, 0, 0, 0, 0, 0]
    share = np.exp(logits[:7]) / np.exp(logits[:7]).sum()
    assert loss(logits, 0b1, UNKNOWN) == pytest.approx(-np.log(share[0]), abs=1e-5)
    assert loss(logits, 0b11, UNKNOWN) == pytest.approx(-np.log(share[:2].sum()), abs=1e-5)
    assert loss(logits, ANY_CLASS, UNKNOWN) == 0
    for place in (0, 1):
        sure = [*logits[:7], *(50 if place == number else 0 for number in (0, 1))]
        answers = [[value if place == number else UNKNOWN for number in (0, 1)] for value in (1, 0)]
        assert loss(sure, ANY_CLASS, *answers[0]) == pytest.approx(0, abs=1e-5)
        assert loss(sure, ANY_CLASS, *answers[1]) > 1


def test_batch_normalisation_is_folded_in():
    rng = np.random.default_rng(0)
    trained = ParserNetwork()
    convolution, norm = torch.nn.Conv2d(3, 32, 3, stride=2, padding=1, bias=False), torch.nn.BatchNorm2d(32, eps=1e-3)
    for name in ("weight", "bias", "running_mean"):
        getattr(norm, name).data = torch.tensor(rng.normal(1, 0.2, 32), dtype=torch.float32)
    norm.running_var.data = torch.tensor(rng.uniform(0.5, 2, 32), dtype=torch.float32)
    weights = {"_conv_stem.weight": convolution.weight, **{f"_bn0.{k}": v for k, v in norm.state_dict().items()}}
    from training.parser import network as network_architecture

    network_architecture._fold_norm(trained.stem, weights, "_conv_stem", "_bn0")
    image = torch.rand(1, 3, 16, 16)
    with torch.no_grad():
        assert torch.allclose(trained.stem(image), norm.eval()(convolution(image)), atol=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image": np.zeros((96, 80, 4), np.uint8)}, "uint8 RGB"),
        ({"possible": np.zeros((5, 5), np.uint8)}, "size"),
    ],
)
def test_refuses_unusable_photos(start, change, message):
    broken = Photo(
        **{name: change.get(name, getattr(photo(0), name)) for name in ("image", "possible", "occluder", "outside")}
    )
    with pytest.raises(ImageError, match=f"facades 0.*{message}"):
        network_training.train_parser_network({"facades": [broken]}, COURSE, seed=0, start=copy(start))


def test_refuses_a_set_without_photos(start):
    with pytest.raises(ImageError, match="set facades"):
        network_training.train_parser_network({"facades": []}, COURSE, seed=0, start=copy(start))


def test_weights_come_back_from_the_file_of_a_network(weights, tmp_path):
    network_export.save_network(weights, tmp_path / "one.onnx", training_set=[], seed=5)
    back = network_export.read_weights(tmp_path / "one.onnx")
    assert back.keys() == weights.keys()
    network_export.save_network(back, tmp_path / "two.onnx", training_set=[], seed=5)
    one, two = (parse(photo(2).image, model=tmp_path / f"{name}.onnx").confidence for name in ("one", "two"))
    assert np.allclose(one, two, atol=1e-4)


def test_with_fixed_norms_what_is_normalised_by_stays(start):
    fixed = train(start, TrainingSchedule(steps=2, per_step={"facades": 2}, freeze_norms=True))
    assert torch.equal(fixed["norms.0.running_mean"], start["norms.0.running_mean"])
    assert not torch.equal(fixed["head.weight"], start["head.weight"])
