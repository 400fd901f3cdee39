"""Networks that a user fetches or exports: an .onnx file without a record, checked by its inputs and a trial run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.core.arrays import Float32Array
from facade_core.core.errors import ModelFileError
from facade_core.core.model_file import open_inference_session

if TYPE_CHECKING:
    from onnxruntime import InferenceSession, NodeArg

# Constant, so that results do not depend on the number of cores.
_INTRA_OP_THREADS = 2
# Where exports with the right inputs and outputs are described.
REMEDY = "export it as docs/networks.md says"


@dataclass(frozen=True, slots=True)
class ExternalNetwork:
    """Network of a file in an inference session.

    Attributes
    ----------
    path : its file.
    session : its session.
    size : height and width of its pictures in pixels; None where they are free.
    """

    path: Path
    session: InferenceSession
    size: tuple[int, int] | None

    def run(self, **inputs: Float32Array) -> dict[str, Float32Array]:
        """Run the network once; inputs and outputs by name.

        Raises
        ------
        ModelFileError
            If it fails.
        """
        names = [node.name for node in self.session.get_outputs()]
        try:
            return dict(zip(names, self.session.run(names, inputs), strict=True))
        except Exception as error:  # the runtime has no public root for its errors
            height, width = next(iter(inputs.values())).shape[2:]
            raise ModelFileError(f"{self.path}: fails on a picture of {width} x {height} pixels; {REMEDY}") from error


def open_network(path: Path, channels: Mapping[str, int]) -> ExternalNetwork:
    """Open an .onnx file whose inputs are pictures (1, channels, H, W) float32.

    Parameters
    ----------
    path : the file.
    channels : channels of each input by name.

    Raises
    ------
    ModelFileError
        If the file is no ONNX file or has other inputs.
    """
    session = open_inference_session(path, None, threads=_INTRA_OP_THREADS)
    nodes = session.get_inputs()
    sizes = {_picture_size(node, channels) for node in nodes}
    if len(nodes) != len(channels) or len(sizes) != 1 or () in sizes:
        found = ", ".join(f"{node.name} {node.shape} {node.type}" for node in nodes)
        wanted = ", ".join(f"{name} [1, {count}, height, width] tensor(float)" for name, count in channels.items())
        raise ModelFileError(f"{path}: its inputs are {found}, not {wanted}; both sides fixed, or both free; {REMEDY}")
    (size,) = sizes
    return ExternalNetwork(path, session, None if size is None else (size[0], size[1]))


def _picture_size(node: NodeArg, channels: Mapping[str, int]) -> tuple[int, ...] | None:
    """Return height and width of an input; None where both are free, () where the input is another."""
    if node.name not in channels or node.type != "tensor(float)" or len(node.shape) != 4:
        return ()
    batch, count, *size = node.shape
    if batch not in (1, None) and not isinstance(batch, str):
        return ()
    if isinstance(count, int) and count != channels[node.name]:
        return ()
    fixed = [side for side in size if isinstance(side, int)]
    return tuple(fixed) if len(fixed) == 2 else None if not fixed else ()
