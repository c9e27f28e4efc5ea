"""The three losses against closed forms, and where their gradients vanish."""

from __future__ import annotations

import math

import pytest
import torch

from pbrs_farm.study.tasks.losses import class_loss, edge_loss, normal_loss

pytestmark = pytest.mark.study


def _normals() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    torch.manual_seed(0)
    truth = torch.nn.functional.normalize(torch.randn(2, 3, 6, 8), dim=1)
    output = torch.randn(2, 3, 6, 8, requires_grad=True)
    return output, truth, torch.rand(2, 6, 8) > 0.4


@pytest.mark.parametrize("kind", ["cosine", "chord"])
@pytest.mark.parametrize("over", ["valid", "all"])
def test_the_gradient_of_invalid_pixels_is_exactly_zero(kind: str, over: str) -> None:
    output, truth, valid = _normals()
    normal_loss(output, truth, valid, kind=kind, over=over).mean().backward()
    assert output.grad is not None
    gradient = output.grad.abs().sum(1)
    assert (gradient[~valid] == 0).all()
    assert (gradient[valid] > 0).all()


def test_a_normal_turned_by_an_angle_costs_one_minus_its_cosine() -> None:
    truth = torch.tensor([0.0, 0, 1]).view(1, 3, 1, 1).expand(1, 3, 4, 4)
    angle = math.radians(40)
    turned = torch.tensor([math.sin(angle), 0, math.cos(angle)]).view(1, 3, 1, 1) * 3.5
    valid = torch.ones(1, 4, 4, dtype=torch.bool)
    output = turned.expand(1, 3, 4, 4)
    loss = normal_loss(output, truth, valid, kind="cosine", over="valid")
    assert loss.item() == pytest.approx(1 - math.cos(angle), abs=1e-6)
    chord = normal_loss(output, truth, valid, kind="chord", over="valid")
    assert chord.item() == pytest.approx(2 * math.sin(angle / 2), abs=1e-4)


def test_invalid_pixels_dilute_the_mean_over_all() -> None:
    output, truth, valid = _normals()
    over_valid = normal_loss(output, truth, valid, kind="cosine", over="valid").mean()
    over_all = normal_loss(output, truth, valid, kind="cosine", over="all").mean()
    share = valid.float().mean()
    assert over_all.item() == pytest.approx((over_valid * share).item(), rel=1e-5)


def test_pixels_without_a_class_do_not_count() -> None:
    torch.manual_seed(1)
    scores, labels = torch.randn(1, 5, 4, 4, requires_grad=True), torch.randint(1, 6, (1, 4, 4))
    labels[0, :2] = 0
    loss = class_loss(scores, labels, over="valid")
    expected = torch.nn.functional.cross_entropy(scores[:, :, 2:], labels[:, 2:] - 1)
    assert loss.item() == pytest.approx(expected.item(), rel=1e-6)
    loss.mean().backward()
    assert scores.grad is not None
    assert (scores.grad[:, :, :2] == 0).all()


def test_without_any_label_there_is_no_loss() -> None:
    assert class_loss(torch.randn(1, 5, 4, 4), torch.zeros(1, 4, 4), over="valid").item() == 0


def test_edges_weigh_as_much_as_all_else() -> None:
    edges = torch.zeros(1, 8, 10, dtype=torch.bool)
    edges[0, 3, 2:6] = True
    scores = torch.zeros(1, 1, 8, 10, requires_grad=True)
    loss = edge_loss(scores, edges, as_sum=True)
    share = 4 / 80
    assert loss.item() == pytest.approx(math.log(2) * (4 * (1 - share) + 76 * share), rel=1e-5)
    loss.mean().backward()
    assert scores.grad is not None
    assert scores.grad[0, 0][edges[0]].sum().item() == pytest.approx(
        -scores.grad[0, 0][~edges[0]].sum().item(), rel=1e-5
    )
    mean = edge_loss(scores.detach(), edges, as_sum=False)
    assert mean.item() == pytest.approx(loss.item() / 80, rel=1e-6)


def test_six_sides_cost_their_sum() -> None:
    torch.manual_seed(2)
    scores, edges = torch.randn(2, 6, 5, 7), torch.rand(2, 5, 7) > 0.7
    each = [edge_loss(scores[:, k : k + 1], edges, as_sum=True) for k in range(6)]
    assert torch.allclose(edge_loss(scores, edges, as_sum=True), torch.stack(each).sum(0))
