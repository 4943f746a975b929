"""The one exception of the sidecar."""

from __future__ import annotations


class SidecarError(Exception):
    """Bad input or a failed run, in words for the user.

    The message names the file or setting, the place in it, what was expected and what was found.
    The command line prints it and exits with code 2.
    """


def expected(where: object, place: str, wanted: object, found: object) -> SidecarError:
    """An error in the project's one sentence for things that are not as they must be."""
    return SidecarError(f"{where}: {place}: expected {wanted}, found {found}")
