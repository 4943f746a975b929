"""The pictures that a model is shown, and the one in which its answer can be looked at."""

from __future__ import annotations

import colorsys

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .object_views import ObjectView
from .segments import FRAGMENT, components, depth_inside, neighbours

#: Largest number of a coordinate in answers; the ruler is drawn every tenth of it.
UNITS = 1000
RED = (230, 20, 30)
_RULER_STEP = UNITS // 10


def source_picture(view: ObjectView, region: np.ndarray, side: int) -> Image.Image:
    """A view with a region (height × width) bool in red with a white outline.

    ``side`` is about how many pixels the picture's longer side gets, by a whole factor.
    """
    factor = _factor(view, side)
    return _tint(_enlarge(view.rgb, factor), region, factor)


def target_picture(view: ObjectView, side: int, ruler: bool) -> Image.Image:
    """A view as it is, with a ruler in the units of answers or without."""
    picture = _enlarge(view.rgb, _factor(view, side))
    return _draw_ruler(picture) if ruler else picture


def answer_picture(view: ObjectView, answered: np.ndarray, side: int) -> Image.Image:
    """A view of the target with what the model marked, for people; drawn as the source is."""
    return source_picture(view, answered, side)


def marks_picture(view: ObjectView, segments: np.ndarray, side: int) -> Image.Image:
    """A view whose patches (height × width) int, 0 outside, are tinted, outlined and numbered."""
    factor = _factor(view, side)
    large = np.kron(segments, np.ones((factor, factor), int))
    colours = np.array([(0, 0, 0), *(_colour(n) for n in range(1, segments.max() + 1))])
    rgb = np.asarray(_enlarge(view.rgb, factor)).astype(float)
    rgb = np.where((large > 0)[..., None], 0.6 * rgb + 0.4 * colours[large], rgb)
    border = np.zeros(large.shape, bool)
    for near in neighbours(large, 0):
        border |= (near != large) & (large > 0)
    rgb[border] = 25
    picture = Image.fromarray(rgb.round().astype(np.uint8))
    _draw_numbers(picture, segments, factor)
    return picture


def _factor(view: ObjectView, side: int) -> int:
    return max(1, round(side / max(view.rgb.shape[:2])))


def _enlarge(rgb: np.ndarray, factor: int) -> Image.Image:
    height, width = rgb.shape[:2]
    size = (width * factor, height * factor)
    return Image.fromarray(rgb).convert("RGB").resize(size, Image.Resampling.LANCZOS)


def _tint(picture: Image.Image, mask: np.ndarray, factor: int) -> Image.Image:
    """The picture with a mask in red; the outline is white and dark, to show on any colour."""
    small = Image.fromarray(mask.astype(np.uint8) * 255)
    smooth = np.asarray(small.resize(picture.size, Image.Resampling.BICUBIC)) >= 128
    rgb = np.asarray(picture).astype(float)
    # Keep the shading, in red: most of the picture's brightness and some plain red.
    red = 0.7 * rgb.mean(-1, keepdims=True) * np.array(RED) / 160 + 0.3 * np.array(RED)
    rgb = np.where(smooth[..., None], red, rgb)
    for width, colour in ((factor + 1, (60, 0, 0)), (max(1, factor - 1), (255, 255, 255))):
        rgb[_rim(smooth, width)] = colour
    return Image.fromarray(rgb.clip(0, 255).round().astype(np.uint8))


def _rim(mask: np.ndarray, width: int) -> np.ndarray:
    """The pixels just outside a mask, ``width`` of them across."""
    grown = mask
    for _ in range(width):
        grown = grown | np.logical_or.reduce(neighbours(grown.astype(int), 0))
    return grown & ~mask


def _draw_ruler(picture: Image.Image) -> Image.Image:
    layer = Image.new("RGBA", picture.size, (0, 0, 0, 0))
    draw = ImageDraw.Draw(layer)
    width, height = picture.size
    font = _font(max(11, width // 48))
    for units in range(_RULER_STEP, UNITS, _RULER_STEP):
        x, y = units / UNITS * width, units / UNITS * height
        for line in ((x, 0, x, height), (0, y, width, y)):
            draw.line(line, fill=(0, 90, 200, 90), width=1)
        for place, anchor in (((x, 3), "ma"), ((4, y), "lm")):
            draw.text(
                place,
                str(units),
                font=font,
                anchor=anchor,
                fill=(0, 60, 160, 255),
                stroke_width=2,
                stroke_fill=(255, 255, 255, 255),
            )
    return Image.alpha_composite(picture.convert("RGBA"), layer).convert("RGB")


def _draw_numbers(picture: Image.Image, segments: np.ndarray, factor: int) -> None:
    """A number in the middle of every piece that is large enough; large pieces choose first."""
    draw = ImageDraw.Draw(picture)
    font = _font(max(12, max(picture.size) // 40))
    parts, depth = components(segments), depth_inside(segments)
    sizes = np.bincount(parts.ravel())
    least = FRAGMENT * (segments > 0).sum()
    largest = {int(n): sizes[parts[segments == n]].max() for n in np.unique(segments[segments > 0])}
    taken: list[tuple[float, float, float, float]] = []
    for part in np.argsort(-sizes, kind="stable").tolist():
        inside = parts == part
        number = int(segments[inside][0])
        # Of a patch in small pieces the largest still gets its number.
        if not number or sizes[part] < min(least, largest[number]):
            continue
        for row, col in _places(inside, depth):
            place = ((col + 0.5) * factor, (row + 0.5) * factor)
            left, top, right, bottom = draw.textbbox(place, str(number), font=font, anchor="mm")
            box = (left - 3, top - 2, right + 3, bottom + 2)
            if not any(_overlap(box, other) for other in taken):
                taken.append(box)
                draw.rounded_rectangle(box, 4, fill=(0, 0, 0), outline=_colour(number))
                draw.text(place, str(number), font=font, anchor="mm", fill=(255, 255, 255))
                break


def _places(inside: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Pixels (n × 2) of a piece, as (row, col), from its middle outwards, deep ones only."""
    deep = np.argwhere(inside & (2 * depth >= depth[inside].max()))
    deepest = deep[depth[tuple(deep.T)] == depth[inside].max()]
    middle = deepest[np.argmin(((deepest - deepest.mean(0)) ** 2).sum(1))]
    return deep[np.argsort(((deep - middle) ** 2).sum(1), kind="stable")]


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _colour(number: int) -> tuple[int, int, int]:
    """Hues a golden angle apart, so that neighbouring numbers look different."""
    hue, value = (0.13 + number * 0.618034) % 1, (1.0, 0.75)[number % 2]
    red, green, blue = (round(255 * x) for x in colorsys.hsv_to_rgb(hue, 0.75, value))
    return red, green, blue


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)  # Pillow's own, so the same on every machine
