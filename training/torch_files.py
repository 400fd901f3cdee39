"""Files of trainings: the state that a run resumes from, and networks as ONNX. Needs the `train` extra (torch, onnx)."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facade_core.core.errors import ModelFileError

if TYPE_CHECKING:
    from torch import Tensor, nn


def require_torch() -> None:
    """Raise ModelFileError where torch is missing."""
    if find_spec("torch") is None:
        raise ModelFileError("training a network needs torch; install the extra `train` (make train-setup)")


def read_state(path: Path) -> dict[str, Any]:
    """Read the state of a run, to the processor's memory.

    Raises
    ------
    ModelFileError
        The file is no such state.
    """
    import torch

    try:
        state: dict[str, Any] = torch.load(path, weights_only=True, map_location="cpu")
    except Exception as error:  # the type depends on how the archive is broken
        raise ModelFileError(f"{path}: not the state of a training run; remove it to start anew") from error
    return state


def write_state(path: Path, state: Mapping[str, object]) -> None:
    """Replace the file atomically: an interrupted write leaves the previous state."""
    import torch

    path.parent.mkdir(parents=True, exist_ok=True)
    written = path.with_name(path.name + ".new")
    torch.save(dict(state), written)
    written.replace(path)


def encode_onnx(
    network: nn.Module,
    inputs: Mapping[str, Tensor],
    outputs: Sequence[str],
    dynamic_axes: Mapping[str, Mapping[int, str]] | None = None,
) -> bytes:
    """Export a network as the bytes of an ONNX file.

    Parameters
    ----------
    network : network in evaluation mode.
    inputs : name and example of each input, in order.
    outputs : names of the outputs.
    dynamic_axes : names of the axes of variable length, by input or output and axis.
    """
    import torch

    content = io.BytesIO()
    torch.onnx.export(
        network,
        tuple(inputs.values()),
        content,
        input_names=list(inputs),
        output_names=list(outputs),
        dynamic_axes=dynamic_axes,
        opset_version=17,
        dynamo=False,
    )
    return content.getvalue()
