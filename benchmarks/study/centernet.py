"""CenterNet that learned COCO's photographs, as npm's package `human` holds it. Effects: npm, ~/.cache.

The file is a graph of TensorFlow.js with half floats; its twenty kinds of nodes are run by torch.
Weights: @vladmandic/human (MIT), of MB3-CenterNet; Zhou et al. 2019, "Objects as points".
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import tarfile
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor
from torch.nn import functional

from pbrs_farm.assets.debian import cache_folder

_PACKAGE: Final = "@vladmandic/human@3.3.6"
_SHA256: Final = {
    "centernet.json": "bfb942eaacc5becf738d536663bc4580a0ae9e560722306e6d4dd7fe4a09de05",
    "centernet.bin": "1b635a15009071f506f9f2b3519b31c072c534888989f30d269ffd44734ef7ef",
}
_FOLDER: Final = cache_folder() / "centernet"
_SIZE: Final = 512  # of the picture it looks at, wide and high
_STRIDE: Final = 4  # of its map of centres
_MOST: Final = 100  # detections
_OVERLAP: Final = 0.5  # overlap from which a weaker detection of a class is a duplicate

COCO: Final = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow",
    "elephant", "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee",
    "skis", "snowboard", "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard",
    "tennis racket", "bottle", "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple",
    "sandwich", "orange", "broccoli", "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch",
    "potted plant", "bed", "dining table", "toilet", "tv", "laptop", "mouse", "remote", "keyboard",
    "cell phone", "microwave", "oven", "toaster", "sink", "refrigerator", "book", "clock", "vase", "scissors",
    "teddy bear", "hair drier", "toothbrush",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Detection:
    """An object in a picture."""

    name: str  # of COCO
    score: float  # 0 to 1
    box: tuple[float, float, float, float]  # left, top, right, bottom, pixels of the picture


def detect(colour: NDArray[np.uint8], least: float = 0.1) -> list[Detection]:
    """Objects in (H, W, 3) sRGB with at least this score, 0 to 1, highest first."""
    height, width = colour.shape[:2]
    squeezed = Image.fromarray(colour).resize((_SIZE, _SIZE), Image.Resampling.BILINEAR)
    scores, reach = _maps(np.asarray(squeezed, np.float32))
    # A centre is where no neighbour of its class is surer.
    peaks = scores * (functional.max_pool2d(scores, 3, 1, 1) == scores)
    values, indices = peaks.flatten().topk(_MOST)
    n_cells = scores.shape[-1]
    scale = np.array([width, height, width, height]) / _SIZE
    detections: list[Detection] = []
    for score, k in zip(values.tolist(), indices.tolist(), strict=True):
        kind, cell = divmod(k, n_cells**2)
        row, column = divmod(cell, n_cells)
        left, top, right, bottom = reach[0, :, row, column].tolist()
        x, y = column * _STRIDE, row * _STRIDE
        box = np.array([x - left, y - top, x + right, y + bottom]) * scale
        detection = Detection(COCO[kind], score, tuple(np.round(box, 1).tolist()))
        if score >= least and not any(
            kept_detection.name == detection.name
            and overlap(kept_detection.box, detection.box) > _OVERLAP
            for kept_detection in detections
        ):
            detections.append(detection)
    return detections


def overlap(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Intersection over union of two boxes (left, top, right, bottom)."""
    across = min(a[2], b[2]) - max(a[0], b[0])
    down = min(a[3], b[3]) - max(a[1], b[1])
    intersection = max(across, 0) * max(down, 0)
    areas = sum((box[2] - box[0]) * (box[3] - box[1]) for box in (a, b))
    return intersection / max(areas - intersection, 1e-9)


def _maps(picture: NDArray[np.float32]) -> tuple[Tensor, Tensor]:
    """(1, 80, 128, 128) scores, and (1, 4, 128, 128) pixels from a centre to its box's edges, of (512, 512, 3) 0..255."""
    graph, weights = _network()
    values: dict[str, Tensor] = {
        "tower_0/images": torch.from_numpy(picture.copy()).permute(2, 0, 1)[None]
    }

    def value(name: str) -> Tensor:
        if name not in values:
            node = graph[name]
            inputs = [
                weights[source] if source in weights else value(source)
                for source in node.get("input", ())
            ]
            values[name] = run_node(node["op"], inputs, node.get("attr", {}))
        return values[name]

    with torch.no_grad():
        return value("tower_0/keypoints"), value("tower_0/wh")


def run_node(op: str, inputs: list[Tensor], attributes: dict[str, Any]) -> Tensor:
    """Result of a node; pictures are (B, C, H, W), constants as stored."""
    x = inputs[0]
    if op in ("_FusedConv2D", "Conv2D", "FusedDepthwiseConv2dNative", "DepthwiseConv2dNative"):
        return _convolved(op, inputs, attributes)
    if op == "Mean":
        return x.mean((2, 3), keepdim=True)
    if op == "ConcatV2":
        return torch.cat(inputs[:-1], 1)
    if op == "ResizeBilinear":
        return _enlarged(x, int(inputs[1][0]))
    functions = {
        "Mul": torch.mul, "Add": torch.add, "Relu6": functional.relu6, "Relu": torch.relu,
        "Sigmoid": torch.sigmoid, "Identity": torch.clone,
    }  # fmt: skip
    return functions[op](*inputs)


def _convolved(op: str, inputs: list[Tensor], attributes: dict[str, Any]) -> Tensor:
    x, kernel = inputs[:2]
    stride = int(attributes["strides"]["list"]["i"][1])
    is_deep = "Depthwise" in op
    # Stored (h, w, in, out), of a channel alone (h, w, in, 1).
    kernel = kernel.permute(2, 3, 0, 1) if is_deep else kernel.permute(3, 2, 0, 1)
    # "Same" at a stride of 2 pads more at the end.
    pads: list[int] = []
    for n, k in ((x.shape[3], kernel.shape[3]), (x.shape[2], kernel.shape[2])):
        total = max((-(-n // stride) - 1) * stride + k - n, 0)
        pads += [total // 2, total - total // 2]
    bias = inputs[2] if len(inputs) > 2 else None
    y = functional.conv2d(
        functional.pad(x, pads), kernel, bias, stride, groups=x.shape[1] if is_deep else 1
    )
    # Base64 of what follows the sum.
    fused = attributes.get("fused_ops", {}).get("list", {}).get("s", [])
    return torch.relu(y) if "UmVsdQ==" in fused else y


def _enlarged(x: Tensor, size: int) -> Tensor:
    """As TensorFlow's first resize: the new pixel k samples the old position k / 2, without half-pixel offset."""
    for axis in (2, 3):
        positions = torch.arange(size) * (x.shape[axis] / size)
        low = positions.floor().long()
        high = (low + 1).clamp(max=x.shape[axis] - 1)
        share = (positions - low).view(-1, *(1,) * (3 - axis))
        x = x.index_select(axis, low) * (1 - share) + x.index_select(axis, high) * share
    return x


@cache
def _network() -> tuple[dict[str, dict[str, Any]], dict[str, Tensor]]:
    """Nodes by name, and constants."""
    folder = fetched()
    model = json.loads((folder / "centernet.json").read_bytes())
    data, weights, offset = (folder / "centernet.bin").read_bytes(), {}, 0
    for row in model["weightsManifest"][0]["weights"]:
        kind = np.float16 if "quantization" in row else np.int32
        array = np.frombuffer(data, kind, int(np.prod(row["shape"])), offset)
        offset += array.nbytes
        tensor = torch.from_numpy(array.astype(np.float32)).reshape(row["shape"])
        # A constant of one number, or of one a channel, is broadcast as those of pictures are.
        weights[row["name"]] = tensor
    return {node["name"]: node for node in model["modelTopology"]["node"]}, weights


def fetched() -> Path:
    """The folder of the two files; fetched by npm the first time (28.6 MB, of which 4 are kept)."""
    if not all(_is_whole(_FOLDER / name) for name in _SHA256):
        _FOLDER.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as scratch:
            words = ["npm", "pack", "--silent", _PACKAGE, "--pack-destination", scratch]
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
            with tarfile.open(next(Path(scratch).glob("*.tgz"))) as archive:
                for name in _SHA256:
                    file = archive.extractfile(f"package/models/{name}")
                    assert file is not None
                    with (_FOLDER / name).open("wb") as out:
                        shutil.copyfileobj(file, out)
        for name in _SHA256:
            if not _is_whole(_FOLDER / name):
                raise RuntimeError(f"{_FOLDER / name}: not the file of {_PACKAGE}")
    return _FOLDER


def _is_whole(path: Path) -> bool:
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == _SHA256[path.name]
