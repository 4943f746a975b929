"""Commands of the user's own in place of a stage: words with places for file names, no shell."""

from __future__ import annotations

import os
import shlex
import string
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass

from ..sidecar.errors import SidecarError, expected

#: So much of what a command said last is told where it fails.
_SAID = 400


@dataclass(frozen=True)
class CommandTemplate:
    """A command line with ``{places}``.

    Attributes
    ----------
    option
        Where it came from, for messages.
    words
        The words, with places still in them.
    """

    option: str
    words: tuple[str, ...]

    @staticmethod
    def parse(option: str, text: str, places: tuple[str, ...]) -> CommandTemplate:
        """Splits a command line as a shell does, and checks its places.

        Raises
        ------
        SidecarError
            For no word, an open quote, an unknown place, or one of ``places`` that is missing.
        """
        try:
            words = tuple(shlex.split(text))
            named = {name for word in words for _, name, _, _ in string.Formatter().parse(word)}
        except ValueError as error:
            raise expected("settings", option, "a command line", f"{text!r}: {error}") from None
        found = {name for name in named if name is not None}
        if not words or found != set(places):
            wanted = "a command with " + ", ".join(f"{{{place}}}" for place in places)
            raise expected("settings", option, wanted, repr(text))
        return CommandTemplate(option, words)

    def run(self, values: Mapping[str, object]) -> None:
        """Runs it with values for its places; its stdout is not looked at.

        Raises
        ------
        SidecarError
            If there is no such program, or it ends with another code than 0; with what it said.
        """
        run_command([word.format(**values) for word in self.words], self.option)


def run_command(words: list[str], name: str) -> None:
    """Runs a command; raises SidecarError as :meth:`CommandTemplate.run` does."""
    try:
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace"
        )
    except OSError as error:
        raise SidecarError(f"{name}: {words[0]}: {error.strerror or error}") from error
    if done.returncode != 0:
        said = _without_keys(done.stderr.strip() or done.stdout.strip())[-_SAID:]
        raise SidecarError(f"{name}: exit code {done.returncode}: {said or 'without a word'}")


def _without_keys(said: str) -> str:
    """What a command said, without the keys of endpoints that it finds in its environment."""
    for name, value in os.environ.items():
        if name.endswith("_API_KEY") and value.strip():
            said = said.replace(value.strip(), f"[{name}]")
    return said
