"""The sidecar's own exception; files that Rust refuses raise `semfm.FormatError` and the like."""

from __future__ import annotations

from ..errors import SemfmError


class SidecarError(SemfmError):
    """Bad input or a failed run, in words for the user.

    The message names the file or setting, the place in it, what was expected and what was found.
    The command line prints it, as it prints every `SemfmError`, and exits with code 2.
    """


def expected(where: object, place: str, wanted: object, found: object) -> SidecarError:
    """An error in the project's one sentence for things that are not as they must be."""
    message = f"{where}: {place}: expected {wanted}, found {found}"
    return SidecarError(message, "invalid", place)
