"""Pictures for walls, drawn by a seed: abstracts, landscapes, line art, maps, words; no effects.

Every family is a function (rng, size, palette) -> (H, W, 3) float32, sRGB-encoded, 0..1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage

from pbrs_farm.core.arrays import F32, F64, Srgb8Image
from pbrs_farm.dress.style import Rgb, Style, mix, shade

Size = tuple[int, int]  # width and height in pixels
Palette = tuple[Rgb, ...]  # paper first, then from calm to loud
Family = Callable[[np.random.Generator, Size, Palette], F32]

_NONE: Mapping[str, int] = MappingProxyType({})
EDGE_PX = 400  # the longer edge of a picture
# fmt: off
_WORDS = (
    "home", "slow down", "be kind", "breathe", "less is more", "dream", "hello", "good things",
    "coffee first", "eat well", "stay wild", "paris", "tokyo", "lisboa", "havana", "rest",
    "today", "love", "light", "42", "&", "yes.", "gather", "the sea", "no. 7", "sunday",
)
# fmt: on


def print_pixels(
    rng: np.random.Generator, aspect: float, style: Style, drawn: Mapping[str, int] = _NONE
) -> tuple[Srgb8Image, str]:
    """(H, W, 3) uint8 of a new picture, and its family's name.

    aspect: width over height. drawn: how often each family was drawn before: others are liked more.
    """
    scale = EDGE_PX / max(aspect, 1.0)
    size = max(int(scale * aspect), 32), max(int(scale), 32)
    weights = _LIKED / (1 + 2 * np.array([drawn.get(name, 0) for name in FAMILIES]))
    name = str(rng.choice(list(FAMILIES), p=weights / weights.sum()))
    picture = FAMILIES[name](rng, size, palette_of(rng, style))
    # Paper and paint are never quite even.
    picture = picture + 0.012 * rng.standard_normal(picture.shape[:2], np.float32)[..., None]
    return np.asarray(np.clip(picture, 0.02, 0.97) * 255 + 0.5, np.uint8), name


def palette_of(rng: np.random.Generator, style: Style) -> Palette:
    """Six colours: mostly the home's, sometimes others; paper first."""
    paper = mix((0.96, 0.94, 0.9), style.palette[0], float(rng.uniform(0, 0.5)))
    if rng.random() < 0.7:
        colours = [style.accent, *style.textiles, *style.palette[2:]]
        colours = [colours[int(k)] for k in rng.permutation(len(colours))]
        return (paper, *colours[:5])
    hues = (rng.random() + np.array([0, 0.08, 0.5, 0.55, 0.33])) % 1.0
    return (paper, *(_from_hue(float(h), float(rng.uniform(0.3, 0.8))) for h in hues))


def _from_hue(hue: float, value: float) -> Rgb:
    r, g, b = (float(value * (0.7 + 0.3 * np.cos(2 * np.pi * (hue - k / 3)))) for k in range(3))
    return (r, g, b)


def _coordinates(size: Size) -> tuple[F32, F32]:
    # u to the right, v downwards, the shorter edge is 1.
    short = min(size)
    u, v = np.meshgrid(np.arange(size[0]) / short, np.arange(size[1]) / short)
    return u.astype(np.float32), v.astype(np.float32)


def _noise(rng: np.random.Generator, size: Size, beta: float, stretch: float = 1.0) -> F32:
    """(H, W) noise of mean 0 and deviation 1 with a spectrum k^-beta; stretch > 1: longer along u."""
    fy, fx = np.fft.fftfreq(size[1])[:, None], np.fft.rfftfreq(size[0])[None]
    k = np.hypot(fy * size[1], fx * size[0] * stretch).astype(np.float32)
    k[0, 0] = 1.0
    white = rng.standard_normal((size[1], size[0]), np.float32)
    spectrum = np.fft.rfft2(white) * k ** np.float32(-beta)
    spectrum[0, 0] = 0.0
    field = np.fft.irfft2(spectrum, s=(size[1], size[0]))
    return np.asarray(field / max(float(field.std()), 1e-9), np.float32)


def _mix_pixels(a: F32 | Rgb, b: F32 | Rgb, t: F32 | F64) -> F32:
    w = t.astype(np.float32)[..., None]
    return np.asarray(
        np.asarray(a, np.float32) * (1 - w) + np.asarray(b, np.float32) * w, np.float32
    )


def _one_colour(size: Size, colour: Rgb) -> F32:
    return np.broadcast_to(np.array(colour, np.float32), (size[1], size[0], 3)).copy()


def _smooth(x: F32, width: float) -> F32:
    return np.asarray(np.clip(x / width + 0.5, 0, 1), np.float32)


def _colour_field(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Two or three soft rectangles on a ground, layered paint."""
    u, v = _coordinates(size)
    w, h = float(u.max()), float(v.max())
    picture = _one_colour(size, mix(palette[1], palette[2], 0.5))
    edges = np.sort(rng.uniform(0.25, 0.75, int(rng.integers(1, 3)))) * h
    bands = list(zip([0.06 * h, *(edges + 0.02)], [*(edges - 0.02), 0.94 * h], strict=True))
    wobble = 0.02 * _noise(rng, size, 1.6)
    for k, (top, bottom) in enumerate(bands):
        inside = np.minimum(np.minimum(u - 0.07 * w, 0.93 * w - u), np.minimum(v - top, bottom - v))
        picture = _mix_pixels(picture, palette[1 + k % 5], 0.9 * _smooth(inside + wobble, 0.06))
    return picture * (1 + 0.05 * _noise(rng, size, 1.3)[..., None])


def _shapes(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Discs, arches and slabs that overlap, in flat colours."""
    image = Image.new("RGB", (2 * size[0], 2 * size[1]), _rgb_bytes(palette[0]))
    pen = ImageDraw.Draw(image)
    w, h = image.size
    for _ in range(int(rng.integers(4, 8))):
        r = float(rng.uniform(0.12, 0.34)) * min(w, h)
        x, y = float(rng.uniform(0.15, 0.85)) * w, float(rng.uniform(0.15, 0.85)) * h
        colour = _rgb_bytes(palette[1 + int(rng.integers(5))])
        kind = int(rng.integers(4))
        if kind == 0:
            pen.ellipse((x - r, y - r, x + r, y + r), fill=colour)
        elif kind == 1:
            start = float(rng.choice([0, 90, 180, 270]))
            pen.pieslice((x - r, y - r, x + r, y + r), start, start + 180, fill=colour)
        elif kind == 2:
            pen.rectangle((x - r, y - 0.25 * r, x + r, y + 0.25 * r), fill=colour)
        else:
            for k in range(4):
                q = r * (1 - k / 4)
                ink = colour if k % 2 == 0 else _rgb_bytes(palette[0])
                pen.pieslice((x - q, y - q, x + q, y + q), 180, 360, fill=ink)
    return _halved(image)


def _ridges(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Mountains behind mountains in haze."""
    u, v = _coordinates(size)
    h = float(v.max())
    high, low = shade(palette[1], 1.5), mix(palette[2], (1.0, 0.93, 0.82), 0.7)
    picture = _mix_pixels(high, low, np.clip(v / (0.7 * h), 0, 1))
    # Hang a sun or a moon.
    x, y, r = float(rng.uniform(0.2, 0.8) * u.max()), 0.25 * h, float(rng.uniform(0.05, 0.1))
    picture = _mix_pixels(picture, (1.0, 0.96, 0.86), _smooth(r - np.hypot(u - x, v - y), 0.012))
    n = int(rng.integers(4, 7))
    dark = shade(palette[int(rng.integers(1, 6))], 0.45)
    for k in range(n):
        line = _noise(rng, (size[0], 2), 1.25)[0] * (0.03 + 0.025 * k / n) + h * (
            0.42 + 0.5 * k / n
        )
        ink = mix(low, dark, (k + 0.6) / n)
        picture = _mix_pixels(picture, ink, _smooth(v - line[None, :], 0.008))
        # Haze gathers at the feet.
        fog = np.clip(1 - (v - line[None, :]) / 0.2, 0, 1) * (v > line[None, :])
        picture = _mix_pixels(
            picture, low, np.asarray(0.25 * (1 - fog) * (v > line[None, :]), np.float32)
        )
    return picture


def _sea(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Sky, horizon, water and its glitter: as a photograph."""
    u, v = _coordinates(size)
    h, w = float(v.max()), float(u.max())
    horizon = h * float(rng.uniform(0.35, 0.6))
    warm = mix((0.98, 0.72, 0.45), palette[1], 0.25)
    cool = mix((0.25, 0.42, 0.6), palette[2], 0.25)
    sky = _mix_pixels(cool, warm, np.clip(v / horizon, 0, 1) ** 2)
    clouds = np.clip(_noise(rng, size, 1.7, 3.0) - 0.4, 0, 2) * 0.35
    sky = _mix_pixels(sky, (1.0, 0.95, 0.9), np.clip(clouds, 0, 0.7))
    depth = np.clip((v - horizon) / (h - horizon), 0, 1)
    water = _mix_pixels(mix(warm, cool, 0.55), shade(cool, 0.45), depth)
    ripple = _noise(rng, size, 1.0, 8.0) * (0.03 + 0.07 * depth)
    glitter = np.exp(-(((u - 0.5 * w) / (0.06 + 0.2 * depth)) ** 2)) * np.clip(
        _noise(rng, size, 0.8, 6.0), 0, 2
    )
    water = water + ripple[..., None] + 0.22 * (glitter * (1 - 0.6 * depth))[..., None]
    return _mix_pixels(sky, water, _smooth(v - horizon, 0.006))


def _forest(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Trunks in fog, dark in front: as a photograph."""
    u, v = _coordinates(size)
    h, w = float(v.max()), float(u.max())
    fog = mix((0.86, 0.89, 0.86), palette[1], 0.15)
    picture = _mix_pixels(fog, shade(fog, 0.75), v / h)
    dark = mix((0.1, 0.13, 0.11), palette[2], 0.15)
    for k in range(22):
        near = k / 21
        x = float(rng.uniform(0, w)) + 0.02 * _noise(rng, (size[1], 2), 1.5)[0][: size[1], None]
        half = 0.006 + 0.035 * near**2 * float(rng.uniform(0.6, 1.4))
        ink = mix(fog, dark, 0.15 + 0.85 * near)
        foot = h * (0.62 + 0.4 * near)
        trunk = _smooth(half - np.abs(u - x), 0.006) * _smooth(foot - v, 0.02)
        picture = _mix_pixels(picture, ink, trunk)
    ground = _smooth(v - h * 0.8 + 0.03 * _noise(rng, size, 1.2), 0.2)
    picture = _mix_pixels(picture, shade(dark, 1.3), 0.8 * ground)
    leaves = np.clip(_noise(rng, size, 0.9) - 0.6 + 1.2 * (0.35 - v / h), 0, 1)
    return _mix_pixels(picture, mix(dark, (0.3, 0.42, 0.2), 0.4), 0.7 * leaves)


def _bokeh(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Lights out of focus, as a photograph of a street at night."""
    u, v = _coordinates(size)
    picture = _mix_pixels(shade(palette[1], 0.25), shade(palette[2], 0.12), v / float(v.max()))
    for _ in range(26):
        x, y = float(rng.uniform(0, u.max())), float(rng.normal(0.55, 0.18) * v.max())
        r = float(rng.uniform(0.02, 0.09))
        glow = shade(mix(palette[int(rng.integers(1, 6))], (1.0, 0.8, 0.5), 0.5), 1.3)
        disc = _smooth(r - np.hypot(u - x, v - y), 0.01) * float(rng.uniform(0.2, 0.6))
        picture = _mix_pixels(picture, glow, disc)
    return picture


def _line_drawing(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """One line that wanders, or a face of a few lines, on paper; a colour behind it."""
    image = Image.new("RGB", (2 * size[0], 2 * size[1]), _rgb_bytes(palette[0]))
    pen = ImageDraw.Draw(image)
    w, h = image.size
    r = 0.28 * min(w, h)
    x, y = w * float(rng.uniform(0.35, 0.65)), h * float(rng.uniform(0.35, 0.65))
    if rng.random() < 0.7:
        blot = mix(palette[1], palette[0], 0.3)
        pen.ellipse((x - r, y - r * 1.1, x + r, y + r * 1.1), fill=_rgb_bytes(blot))
    # Sum a few turning arms: a smooth closed curve.
    t = np.linspace(0, 2 * np.pi, 600)
    n = int(rng.integers(3, 6))
    arms = rng.normal(size=(n, 4)) / np.arange(1, n + 1)[:, None]
    turns = np.arange(1, n + 1)[:, None] * t
    xs = (arms[:, :1] * np.cos(turns) + arms[:, 1:2] * np.sin(turns)).sum(0)
    ys = (arms[:, 2:3] * np.cos(turns) + arms[:, 3:] * np.sin(turns)).sum(0)
    points = [
        (float(w / 2 + 0.34 * w * a), float(h / 2 + 0.34 * h * b))
        for a, b in zip(xs / np.abs(xs).max(), ys / np.abs(ys).max(), strict=True)
    ]
    pen.line(points, fill=_rgb_bytes(shade(palette[5], 0.3)), width=max(w // 120, 3), joint="curve")
    return _halved(image)


def _botanical(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """A stem with leaves, pressed on paper."""
    # Draw at twice the size and halve it at the end: antialiased lines.
    image = Image.new("RGB", (2 * size[0], 2 * size[1]), _rgb_bytes(palette[0]))
    pen = ImageDraw.Draw(image)
    w, h = image.size
    short = min(w, h)
    green = mix((0.27, 0.4, 0.24), palette[int(rng.integers(1, 6))], 0.35)
    # The stem rises from 8 % above the lower edge to 12 % below the upper, bent as a parabola.
    bend = float(rng.uniform(-0.15, 0.15)) * w
    stem = [(w / 2 + bend * (k / 30) ** 2, h * (0.92 - 0.8 * k / 30)) for k in range(31)]
    pen.line(stem, fill=_rgb_bytes(shade(green, 0.7)), width=max(w // 110, 3), joint="curve")
    slim = float(rng.uniform(0.12, 0.3))
    for k in range(3, 31, int(rng.integers(2, 4))):
        length = 0.3 * short * (1 - 0.6 * k / 31) * float(rng.uniform(0.85, 1.1))
        for side in (-1.0, 1.0):
            angle = side * float(rng.uniform(0.7, 1.1)) - np.pi / 2
            t = np.linspace(0, 1, 20)
            # A leaf's outline: half widths along its length, there and back, turned into place.
            half = slim * length * np.sin(np.pi * t**0.8)
            along = np.concatenate([t, t[::-1]]) * length
            across = np.concatenate([half, -half[::-1]])
            c, s = np.cos(angle), np.sin(angle)
            x, y = stem[k]
            leaf = [
                (x + c * a - s * b, y + s * a + c * b) for a, b in zip(along, across, strict=True)
            ]
            pen.polygon(leaf, fill=_rgb_bytes(shade(green, float(rng.uniform(0.8, 1.25)))))
            pen.line([leaf[0], leaf[19]], fill=_rgb_bytes(shade(green, 0.75)), width=2)
    return _halved(image)


def _map(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Land and sea of no known world, with coasts and meridians."""
    u, v = _coordinates(size)
    height = _noise(rng, size, 1.75) - 0.25
    sea = mix((0.75, 0.84, 0.88), palette[1], 0.3)
    picture = _mix_pixels(
        sea, shade(sea, 1.15), np.clip(0.5 + 0.5 * np.sin(height * 14), 0, 1) * (height < 0)
    )
    land = _mix_pixels(
        mix((0.88, 0.83, 0.68), palette[2], 0.3),
        mix((0.6, 0.5, 0.36), palette[3], 0.3),
        np.clip(height, 0, 1.6) / 1.6,
    )
    picture = _mix_pixels(picture, land, _smooth(height, 0.05))
    picture = _mix_pixels(picture, (0.25, 0.22, 0.2), 0.8 * _smooth(0.035 - np.abs(height), 0.03))
    graticule = np.minimum(np.abs((u * 6) % 1 - 0.5), np.abs((v * 6) % 1 - 0.5))
    return _mix_pixels(picture, (0.35, 0.35, 0.35), 0.3 * _smooth(0.012 - graticule, 0.012))


def _tile_poster(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """A grid of quarter discs and halves: the Bauhaus poster."""
    n = int(rng.integers(3, 6))
    u, v = _coordinates(size)
    cell_u, cell_v = np.floor(u * n).astype(int), np.floor(v * n).astype(int)
    shape = cell_v.max() + 1, cell_u.max() + 1
    ground = np.array(palette, np.float32)[rng.integers(0, 6, shape)]
    ink = np.array(palette, np.float32)[rng.integers(0, 6, shape)]
    corner = rng.integers(0, 4, shape)[cell_v, cell_u]
    x, y = u * n - cell_u, v * n - cell_v
    x, y = np.where(corner % 2 == 1, 1 - x, x), np.where(corner >= 2, 1 - y, y)
    kind = rng.integers(0, 3, shape)[cell_v, cell_u]
    inside = np.select(
        [kind == 0, kind == 1], [1 - np.hypot(x, y), x - y], 0.5 - np.hypot(x - 0.5, y - 0.5)
    )
    t = _smooth(np.asarray(inside, np.float32), 0.04)
    return np.asarray(
        ground[cell_v, cell_u] * (1 - t[..., None]) + ink[cell_v, cell_u] * t[..., None]
    )


def _marbled(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """Paint that ran: a field bent by another."""
    u, v = _coordinates(size)
    field = _noise(rng, size, 1.8)
    # Look the field up at places that two other fields moved (domain warping).
    rows = v * min(size) + 40 * _noise(rng, size, 1.9)
    columns = u * min(size) + 40 * _noise(rng, size, 1.9)
    bent = ndimage.map_coordinates(field, [rows, columns], order=1, mode="reflect")
    # Six paints along the bent field; the cube keeps each flat nearly up to the next.
    t = np.clip((bent + 1.8) / 3.6, 0, 0.999) * 5
    colours = np.array(palette, np.float32)
    k = t.astype(int)
    f = (t - k)[..., None] ** 3
    picture = colours[k] * (1 - f) + colours[np.minimum(k + 1, 5)] * f
    vein = _smooth(np.asarray(0.05 - np.abs(bent % 0.6 - 0.3), np.float32), 0.04)
    return _mix_pixels(np.asarray(picture, np.float32), (0.85, 0.72, 0.42), 0.5 * vein)


def _word_poster(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """A word or two, large, with a rule or a coloured field."""
    dark = rng.random() < 0.3
    paper, ink = (
        (palette[0], shade(palette[5], 0.25)) if not dark else (shade(palette[1], 0.5), palette[0])
    )
    image = Image.new("RGB", size, _rgb_bytes(paper))
    pen = ImageDraw.Draw(image)
    w, h = size
    if rng.random() < 0.4:
        pen.rectangle((0, int(0.62 * h), w, h), fill=_rgb_bytes(palette[2]))
    words = str(rng.choice(_WORDS)).split(" ")
    text = "\n".join(words)
    font = ImageFont.load_default(size=20.0)
    left, top, right, bottom = pen.multiline_textbbox((0, 0), text, font=font)
    # Fill three quarters of the width.
    scale = min(0.76 * w / max(right - left, 1), 0.6 * h / max(bottom - top, 1))
    font = ImageFont.load_default(size=float(20 * scale))
    pen.multiline_text(
        (w / 2, 0.47 * h), text, font=font, fill=_rgb_bytes(ink), anchor="mm", align="center"
    )
    pen.rectangle((int(0.3 * w), int(0.86 * h), int(0.7 * w), int(0.87 * h)), fill=_rgb_bytes(ink))
    return np.asarray(np.asarray(image, np.float32) / 255, np.float32)


def _skyline(rng: np.random.Generator, size: Size, palette: Palette) -> F32:
    """A town in black and white or at dusk, with lit windows."""
    image = Image.new("RGB", (2 * size[0], 2 * size[1]))
    w, h = image.size
    grey = rng.random() < 0.6
    sky = (0.82, 0.82, 0.82) if grey else mix(palette[1], (0.9, 0.6, 0.5), 0.5)
    # The sky is brighter towards the horizon; y runs down.
    ramp = np.linspace(0.75, 1.1, h)[:, None, None] * np.array(sky)[None, None]
    image.paste(
        Image.fromarray(np.broadcast_to(np.clip(ramp, 0, 1) * 255, (h, w, 3)).astype(np.uint8))
    )
    pen = ImageDraw.Draw(image)
    # Three rows of houses, the nearest last: darker, lower, with lit windows.
    for layer in range(3):
        tone = shade(sky, 0.62 - 0.22 * layer)
        x = -20
        while x < w:
            wide = int(rng.uniform(0.05, 0.13) * w)
            roof = int(h * (rng.uniform(0.25, 0.6) + 0.12 * layer))
            pen.rectangle((x, roof, x + wide, h), fill=_rgb_bytes(tone))
            step = max(w // 60, 6)
            for wy in range(roof + step, h, 2 * step):
                for wx in range(x + step, x + wide - step, 2 * step):
                    if layer and rng.random() < 0.35:
                        pen.rectangle(
                            (wx, wy, wx + step // 2, wy + step), fill=_rgb_bytes(shade(sky, 1.25))
                        )
            x += wide + int(rng.uniform(-0.01, 0.02) * w)
    return _halved(image)


def _rgb_bytes(colour: Rgb) -> tuple[int, int, int]:
    r, g, b = (int(min(max(c, 0.0), 1.0) * 255) for c in colour)
    return (r, g, b)


def _halved(image: Image.Image) -> F32:
    half = image.resize((image.width // 2, image.height // 2), Image.Resampling.BOX)
    return np.asarray(np.asarray(half, np.float32) / 255, np.float32)


# fmt: off
FAMILIES: dict[str, Family] = {
    "shapes": _shapes, "colour field": _colour_field, "ridges": _ridges, "sea": _sea,
    "forest": _forest, "bokeh": _bokeh, "lines": _line_drawing, "botanical": _botanical, "map": _map,
    "tiles": _tile_poster, "marbled": _marbled, "words": _word_poster, "skyline": _skyline,
}
# fmt: on
_LIKED = np.array([1.4, 1.0, 1.2, 1.2, 1.0, 0.6, 1.2, 1.3, 0.7, 1.0, 1.0, 0.7, 0.8])
