"""Keeps what a model was shown and what it answered, to be looked at."""

from __future__ import annotations

import os
from pathlib import Path

from .._pictures import png_bytes
from .._semfm import write_file
from ..sidecar.errors import SidecarError
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
            write_file(folder / f"{name}.png", png_bytes(part))
    write_file(folder / "question.md", _text("\n\n".join(lines) + "\n"))
    if outcome.reply:
        write_file(folder / "reply.txt", _text(outcome.reply.refusal or outcome.reply.text))
    for name, view, mask in zip(question.names, question.views, outcome.masks or []):
        answered = answer_picture(view, mask & view.on_object, drawing.side)
        write_file(folder / f"answer-{name}.png", png_bytes(answered))


def _text(text: str) -> bytes:
    return text.encode("utf-8", "replace")
