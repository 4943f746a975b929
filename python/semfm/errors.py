"""What can go wrong.

Every error that SemFM raises is a `SemfmError` with a `code` for programs and a `place`; most are
also the built-in exception that fits, so that ``except ValueError`` works. What Python itself
refuses before SemFM is called (a missing argument, text for an `int`) is a plain `TypeError`.
"""

from __future__ import annotations

from typing import Optional


class SemfmError(Exception):
    """The base of all errors of SemFM.

    Attributes
    ----------
    code : str
        A stable name of the kind of failure, such as ``"no-faces"`` or ``"invalid"``.
    place : str or None
        Where: an argument, a vertex, a line or byte of a file; None where there is no place.
    """

    def __init__(self, message: str, code: str = "invalid", place: Optional[str] = None) -> None:
        super().__init__(message)
        self.code = code
        self.place = place

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (str(self), self.code, self.place))

    def __str__(self) -> str:
        return str(self.args[0])


class InvalidInput(SemfmError, ValueError):
    """An argument, mesh or setting that is not what it may be."""


class InvalidType(SemfmError, TypeError):
    """An argument of a type that is not accepted."""


class UnknownAttribute(SemfmError, AttributeError):
    """A name that is none of the settings."""


class IndexOutOfRange(SemfmError, IndexError):
    """A position past the end of a sequence."""


class MissingPackage(SemfmError, ImportError):
    """An optional package that is needed now; the message says how to install it."""


class FormatError(SemfmError, ValueError):
    """A file that is not what its format demands, or that belongs to another mesh."""


class FileError(SemfmError, OSError):
    """A file that cannot be read or written."""


class ComputationError(SemfmError, ArithmeticError):
    """A solver that did not converge, or a matrix that is not what it must be."""


class Cancelled(SemfmError):
    """Work that was told to stop."""


class InternalError(SemfmError):
    """A bug in SemFM: the Rust side panicked, and the process lives on."""
