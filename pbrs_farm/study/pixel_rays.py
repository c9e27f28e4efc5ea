"""The ray of each pixel as an input of networks beside colour (plan field `rays`).

After DSINE (Bae and Davison 2024): the orientation of a surface in the camera's frame depends on the
direction of its pixel, which depends on the lens. A ray is (x, y) of the direction (x, y, 1), x right
and y down, a linear function of the pixel.
"""

from __future__ import annotations

import torch
from torch import Tensor


def rays_of_cameras(cameras: Tensor, height: int, width: int) -> Tensor:
    """(B, H, W, 2) rays of the pixels' centres; cameras: (B, 4) fx, fy, cx, cy in pixels, from the corner."""
    fx, fy, cx, cy = cameras.float().unbind(1)
    columns = torch.arange(width, device=cameras.device) + 0.5
    rows = torch.arange(height, device=cameras.device) + 0.5
    x = (columns - cx[:, None]) / fx[:, None]
    y = (rows - cy[:, None]) / fy[:, None]
    n = len(cameras)
    return torch.stack(
        [x[:, None].expand(n, height, width), y[:, :, None].expand(n, height, width)], -1
    )


def mirrored_rays(rays: Tensor, flips: Tensor) -> Tensor:
    """The rays with some views mirrored left to right; flips (B,) bool."""
    mirror = rays.flip(2) * rays.new_tensor([-1.0, 1.0])
    return torch.where(flips.view(-1, 1, 1, 1), mirror, rays)


def rays_at(rays: Tensor, grid: Tensor) -> Tensor:
    """The rays at grid (B, H, W, 2), -1..1 from edge to edge of the picture, also outside."""
    middle, half = _span(rays)
    return middle + half * grid


def places_of_rays(rays: Tensor, others: Tensor) -> Tensor:
    """Grid positions of other rays (B, H, W, 2): the inverse of rays_at."""
    middle, half = _span(rays)
    return (others - middle) / half


def _span(rays: Tensor) -> tuple[Tensor, Tensor]:
    """(B, 1, 1, 2) the ray of the middle, and the distance to the rays of the edges."""
    height, width = rays.shape[1:3]
    first, last = rays[:, 0, 0], rays[:, -1, -1]
    # The centres of the outermost pixels are one pixel closer than the edges.
    half = (last - first) / 2 * rays.new_tensor([width / (width - 1), height / (height - 1)])
    return ((first + last) / 2)[:, None, None], half[:, None, None]


def focal_lengths(rays: Tensor) -> Tensor:
    """(B,) focal lengths in pixels, the geometric mean of both axes."""
    return (rays[:, 1, 1] - rays[:, 0, 0]).prod(-1).rsqrt()


def ray_channels(rays: Tensor) -> Tensor:
    """(B, 3, H, W) unit directions, the input channels after colour."""
    directions = torch.cat([rays, torch.ones_like(rays[..., :1])], -1)
    return torch.nn.functional.normalize(directions, dim=-1).permute(0, 3, 1, 2)
