import numpy as np
import pytest

from facade_core.core.types import Element

pytest.importorskip("torch", reason="torch is absent: make train-setup")

import torch

from facade_core.facade.layout.network.raster import CHANNELS, RASTER
from facade_core.facade.layout.network.windows import load_layout_network
from tests.training.progress import listening
from training.layout.network import LayoutNetwork
from training.layout.network_export import save_layout_network
from training.layout.network_training import NetworkSchedule, train_layout_network

LAYOUT = (
    [Element("window", x, y, x + 12, y + 14) for y in (10, 50) for x in (10, 40, 70, 100)],
    (0.0, 0.0, 120.0, 80.0),
)


def test_a_trained_network_is_exported_with_equal_outputs(tmp_path):
    events = []
    with listening(events.append):
        weights = train_layout_network([LAYOUT], [LAYOUT], NetworkSchedule(2, 2), seed=1)
    assert [(event.finished, event.total) for event in events] == [(0, 2), (1, 2), (2, 2)]
    save_layout_network(weights, tmp_path / "layout_network.onnx", training_set=["a"], seed=1)
    network = LayoutNetwork()
    network.load_state_dict(weights)
    network.eval()
    layout = np.random.default_rng(0).random((1, CHANNELS, *RASTER)).astype(np.float32)
    with torch.inference_mode():
        expected = network(torch.from_numpy(layout)).numpy()[0]
    np.testing.assert_allclose(load_layout_network(tmp_path / "layout_network.onnx")(layout), expected, atol=1e-3)
