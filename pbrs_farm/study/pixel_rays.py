"""The ray of each pixel as what networks are told beside colour (plan field `rays`); torch, no effects.

After DSINE (Bae and Davison 2024): which way a surface faces in the camera's frame depends on where
its pixel looks, and that on the lens, which a picture does not say. A ray is (x, y) of the direction
(x, y, 1), x right and y down, which runs evenly over the picture.
"""

from __future__ import annotations

import torch
from torch import Tensor


def rays_of_cameras(cameras: Tensor, height: int, width: int) -> Tensor:
    """(B, H, W, 2) the rays through the pixels' centres.

    cameras: (B, 4) fx, fy, cx, cy in pixels of that size; the picture's corner is at 0.
    """
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
    """The rays of views of which those where flips (B,) are turned left to right."""
    mirror = rays.flip(2) * rays.new_tensor([-1.0, 1.0])
    return torch.where(flips.view(-1, 1, 1, 1), mirror, rays)


def rays_at(rays: Tensor, grid: Tensor) -> Tensor:
    """The rays at places of the picture: grid (B, H, W, 2), -1..1 from edge to edge, also beyond them."""
    middle, half = _span(rays)
    return middle + half * grid


def places_of_rays(rays: Tensor, wanted: Tensor) -> Tensor:
    """Where in the picture of some rays others (B, H, W, 2) lie: the inverse of rays_at."""
    middle, half = _span(rays)
    return (wanted - middle) / half


def _span(rays: Tensor) -> tuple[Tensor, Tensor]:
    """(B, 1, 1, 2) the ray of the picture's middle, and from there to its edges."""
    height, width = rays.shape[1:3]
    first, last = rays[:, 0, 0], rays[:, -1, -1]
    # Between the centres of the outermost pixels lie one pixel less than between the edges.
    half = (last - first) / 2 * rays.new_tensor([width / (width - 1), height / (height - 1)])
    return ((first + last) / 2)[:, None, None], half[:, None, None]


def ray_channels(rays: Tensor) -> Tensor:
    """(B, 3, H, W) unit directions, as networks get them behind colour."""
    directions = torch.cat([rays, torch.ones_like(rays[..., :1])], -1)
    return torch.nn.functional.normalize(directions, dim=-1).permute(0, 3, 1, 2)
