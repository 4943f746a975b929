"""Masks of hand and object out of what changed between a picture without a hand and one with it.

An edit that keeps object, camera and background leaves one thing that is new: the hand. So

* the object is what stands out from the plain background of the picture without a hand;
* the hand is the largest patch of change that touches the object, with others of its colour;
* a background that only became darker, in its own colour, is a shadow of the hand and no hand
  (Horprasert, Harwood & Davis, *A Statistical Approach for Real-time Robust Background Subtraction
  and Shadow Detection*, 1999: brightness distortion against chromaticity distortion);
* the object's mask is the object less the hand.

The step holds only where the rest stayed as it was, and that can be told: no part of the object may
have become background, which a hand cannot do, and what of it lies outside of the hand must not
have changed. Otherwise the picture was redrawn, and it is refused instead of giving a mask of
something else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from ..sidecar.errors import SidecarError
from ..vlm.segments import components

Mask = NDArray[np.bool_]

#: Radius of the blur before pictures are compared, as a share of the shorter side: outlines that
#: an edit moved by a pixel are none, fingers are ten times as wide.
_BLUR = 0.002
#: A pixel changed from this difference on (largest of the three channels, 0 to 255), and from six
#: times the noise on, where that is more. JPEG of quality 75 changes 99.9 % of the pixels of two
#: photographs and two rendered pictures by 17 or less (tried once; no command repeats it).
_CHANGED = 24.0
_CHANGED_BY_NOISE = 6.0
#: The border of the reference is plain where this share of it is within `_CHANGED` of its median.
_PLAIN_BORDER = 0.9
#: Shadow: brightness over that of the reference, and the most that the colour may be off, 0 to 255.
_SHADOW = (0.4, 1.0)
_SHADOW_COLOR = 12.0
#: Patches of change below this share of the largest are noise.
_PATCH = 0.05
#: Patches of one hand have medians within this difference (largest channel, 0 to 255): light and
#: shade on skin differ by less, skin and most other things by more.
_SKIN = 60.0
#: A hand, as a share of the picture.
_HAND = (0.002, 0.6)
#: Of the object, its outline left out, at most this share may have become background (of nine
#: pairings of rendered mugs and pictures, 0 where they belong together and .024 to .22 elsewhere);
#: of what is outside of the hand, at most this share may have changed; this share must be seen.
_VACATED = 0.01
_REDRAWN = 0.1
_SEEN = 0.2
#: How far from the object a hand may end and still touch it, as a share of the shorter side.
_REACH = 0.01


@dataclass(frozen=True)
class Masks:
    """Where object and hand are seen, (height × width) bool each; they do not overlap.

    Attributes
    ----------
    object, hand
        The masks.
    changed_share
        Of the object outside of the hand, the share that changed: how far the picture was redrawn.
    """

    object: Mask
    hand: Mask
    changed_share: float


class MaskError(SidecarError):
    """Pictures from which no masks come; the message says why, and what to do."""


_INSTEAD = "give `mask` and `hand_mask` with a `picture`, or --mask-command"
_REDRAW = f"it was redrawn; ask for another picture (`attempt` in the plan), or {_INSTEAD}"


def masks_of_change(without: Image.Image, picture: Image.Image) -> Masks:
    """The masks of object and hand in a picture, from the same picture without a hand.

    Parameters
    ----------
    without
        The object alone on a plain background, or with an alpha channel that cuts it out.
    picture
        With a hand, of the same shape; it may have another size.

    Raises
    ------
    MaskError
        If the shapes differ, the background is not plain, nothing changed, no changed patch touches
        the object, or the object itself was redrawn.
    """
    ratio = (picture.width * without.height) / (picture.height * without.width)
    if abs(ratio - 1) > 0.01:
        sizes = [f"{image.width} × {image.height}" for image in (without, picture)]
        raise MaskError(f"shape: expected that of the reference, {sizes[0]}, found {sizes[1]}")
    before = _pixels(on_white(without), picture.size)
    after = _pixels(picture, picture.size)
    plain = _background(without, before)
    item = _foreground(without, before, plain)
    difference = np.abs(after - before).max(axis=2)
    threshold = max(_CHANGED, _CHANGED_BY_NOISE * float(np.median(difference)))
    changed = (difference > threshold) & ~(_is_shadow(before, after) & ~item)
    reach = max(1, round(_REACH * min(picture.size)))
    _check_place(item & ~_grown(~item, reach), before, after, plain)
    hand = _touching(changed, _grown(item, reach), after)
    _check_hand(hand, item)
    rest = item & ~_grown(hand, reach)
    redrawn = float((difference > threshold)[rest].mean()) if rest.any() else 1.0
    if redrawn > _REDRAWN:
        found = f"{100 * redrawn:.0f} % of what the hand leaves free changed"
        raise MaskError(
            f"object: expected it to be as in the reference, found that {found}: {_REDRAW}"
        )
    return Masks(item & ~hand, hand, redrawn)


def on_white(picture: Image.Image) -> Image.Image:
    """As RGB; what is transparent is white."""
    if "A" not in picture.getbands() and "transparency" not in picture.info:
        return picture.convert("RGB")
    white = Image.new("RGBA", picture.size, (255, 255, 255, 255))
    return Image.alpha_composite(white, picture.convert("RGBA")).convert("RGB")


def _pixels(picture: Image.Image, size: tuple[int, int]) -> NDArray[np.float64]:
    """A little blurred, at a size: (height × width × 3), 0 to 255."""
    sized = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    blurred = sized.filter(ImageFilter.GaussianBlur(max(0.7, _BLUR * min(size))))
    return np.asarray(blurred, dtype=np.float64)


def _alpha(without: Image.Image, size: tuple[int, int]) -> Mask | None:
    """What is opaque, where an alpha channel tells it."""
    if "A" not in without.getbands():
        return None
    alpha = np.asarray(without.getchannel("A").resize(size, Image.Resampling.LANCZOS))
    return alpha >= 128 if alpha.min() < 128 <= alpha.max() else None


def _background(without: Image.Image, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """The colour (3) of the reference's background, which must be plain."""
    if _alpha(without, without.size) is not None:
        return np.full(3, 255.0)  # what is transparent was made white
    border = np.concatenate([before[0], before[-1], before[:, 0], before[:, -1]])
    plain = np.median(border, axis=0)
    is_plain = np.abs(border - plain).max(axis=1) <= _CHANGED
    if is_plain.mean() < _PLAIN_BORDER:
        found = f"{100 * is_plain.mean():.0f} % of its border in one colour"
        raise MaskError(f"reference: expected a plain background, found {found}; {_INSTEAD}")
    return plain


def _foreground(
    without: Image.Image, before: NDArray[np.float64], plain: NDArray[np.float64]
) -> Mask:
    """The object in the reference: what is opaque, else what has not the background's colour."""
    height, width = before.shape[:2]
    if (opaque := _alpha(without, (width, height))) is not None:
        return opaque
    item = _filled(_largest(~_is_like(before, plain), _PATCH))
    if not item.any():
        raise MaskError(f"reference: expected an object on the background, found none; {_INSTEAD}")
    return item


def _is_like(pixels: NDArray[np.float64], color: NDArray[np.float64]) -> Mask:
    return np.abs(pixels - color).max(axis=2) <= _CHANGED


def _check_place(
    inner: Mask,
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    plain: NDArray[np.float64],
) -> None:
    """Refuses a picture in which the object, less its outline, is background now."""
    was_there = inner & ~_is_like(before, plain)
    vacated = float(_is_like(after, plain)[was_there].mean()) if was_there.any() else 0.0
    if vacated > _VACATED:
        found = f"background at {100 * vacated:.0f} % of it"
        raise MaskError(
            f"object: expected it where it is in the reference, found {found}: {_REDRAW}"
        )


def _check_hand(hand: Mask, item: Mask) -> None:
    """Refuses what is too small or too large for a hand, and one that hides the object."""
    share = float(hand.mean())
    if not _HAND[0] <= share <= _HAND[1]:
        wanted = f"{100 * _HAND[0]:g} to {100 * _HAND[1]:g} % of the picture"
        raise MaskError(
            f"hand: expected a change at the object, {wanted}, found {100 * share:.2g} %; "
            f"{_INSTEAD}"
        )
    if (item & ~hand).sum() < _SEEN * item.sum():
        found = f"{100 * (item & ~hand).sum() / item.sum():.0f} %"
        raise MaskError(
            f"object: expected {100 * _SEEN:g} % of it beside what changed, found {found}: "
            f"{_REDRAW}"
        )


def _is_shadow(before: NDArray[np.float64], after: NDArray[np.float64]) -> Mask:
    """Pixels whose colour is that of the reference times a factor below 1.

    With b the pixel before and a the one after, the factor k = a·b / b·b minimises |a − k b|
    (brightness distortion), and what is left is the chromaticity distortion.
    """
    k = (after * before).sum(axis=2) / np.maximum((before * before).sum(axis=2), 1e-9)
    off = np.abs(after - k[:, :, None] * before).max(axis=2)
    return (k >= _SHADOW[0]) & (k <= _SHADOW[1]) & (off <= _SHADOW_COLOR)


def _touching(changed: Mask, near: Mask, after: NDArray[np.float64]) -> Mask:
    """The largest patch of change that touches the object, and those that touch it, too, and have
    its colour: fingers are seen on both sides of what they hold. Without specks and holes.
    """
    patches = _largest(_opened(changed), _PATCH)
    labels = components(patches.astype(np.int64))
    names = np.unique(labels[patches & near])
    if len(names) == 0:
        return np.zeros_like(changed)
    sizes = np.bincount(labels.ravel())
    skin = np.median(after[labels == names[sizes[names].argmax()]], axis=0)
    colors = [np.median(after[labels == name], axis=0) for name in names]
    alike = [name for name, color in zip(names, colors) if np.abs(color - skin).max() <= _SKIN]
    return _filled(np.isin(labels, alike))


def _largest(mask: Mask, share: float) -> Mask:
    """Connected patches that have at least a share of the largest one's pixels."""
    if not mask.any():
        return mask
    labels = components(mask.astype(np.int64))
    counts = np.bincount(labels[mask], minlength=labels.max() + 1)
    return mask & (counts[labels] >= share * counts.max())


def _filled(mask: Mask) -> Mask:
    """Without holes: what the picture's border cannot reach is inside."""
    padded = np.pad(mask, 1)
    labels = components(padded.astype(np.int64))
    return (padded | (labels != labels[0, 0]))[1:-1, 1:-1]


def _opened(mask: Mask) -> Mask:
    """Without threads and specks narrower than three pixels."""
    picture = Image.fromarray(np.where(mask, 255, 0).astype(np.uint8))
    opened = picture.filter(ImageFilter.MinFilter(3)).filter(ImageFilter.MaxFilter(3))
    return np.asarray(opened) > 0


def _grown(mask: Mask, reach: int) -> Mask:
    """With all pixels up to so many away (in a square): along rows, then along columns."""
    for _ in range(2):
        sides = np.pad(mask, ((0, 0), (reach, reach)))
        width = mask.shape[1]
        mask = np.any([sides[:, i : i + width] for i in range(2 * reach + 1)], axis=0).T
    return mask
