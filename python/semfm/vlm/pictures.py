"""Keeps what a model was shown and what it answered, to be looked at."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import IO

from PIL import Image

from ..sidecar.errors import SidecarError
from ..sidecar.replacing import replacing
from .baseline import Outcome
from .marking import answer_picture
from .question import Drawing


def write_pictures(folder: str | os.PathLike[str], outcome: Outcome, drawing: Drawing) -> None:
    """Write one pair's question and answer into a folder.

    ``question.md`` is the prompt with the pictures ``S1.png``, ``T1.png`` …; ``reply.txt`` the
    reply as it came; ``answer-T1.png`` … the target's views with the answered region in red.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SidecarError(f"{folder}: {error.strerror or error}") from error
    question, lines, name = outcome.question, [outcome.question.system], ""
    for part in question.parts:
        if isinstance(part, str):
            lines.append(part)
            name = part.rstrip(":")
        else:
            lines.append(f"![{name}]({name}.png)")
            _write(folder / f"{name}.png", _png(part))
    _write(folder / "question.md", _text("\n\n".join(lines) + "\n"))
    if outcome.reply:
        _write(folder / "reply.txt", _text(outcome.reply.refusal or outcome.reply.text))
    for name, view, mask in zip(question.names, question.views, outcome.masks or []):
        answered = answer_picture(view, mask & view.on_object, drawing.side)
        _write(folder / f"answer-{name}.png", _png(answered))


def _write(path: Path, into: Callable[[IO[bytes]], object]) -> None:
    with replacing(path) as file:
        into(file)


def _png(picture: Image.Image) -> Callable[[IO[bytes]], object]:
    return lambda file: picture.save(file, "PNG")


def _text(text: str) -> Callable[[IO[bytes]], object]:
    return lambda file: file.write(text.encode("utf-8", "replace"))
