"""A key that cannot be shown by accident."""

from __future__ import annotations

from typing import NoReturn

from ..errors import InvalidType


class ApiKey:
    """An endpoint's key. Printing, formatting or pickling it gives nothing away."""

    __slots__ = ("__secret",)

    def __init__(self, secret: str) -> None:
        self.__secret = secret

    def __repr__(self) -> str:
        return "[key]"

    def __reduce__(self) -> NoReturn:
        raise InvalidType("a key is not written anywhere", "type", "key")

    def reveal(self) -> str:
        """The key itself, for the one request header that needs it."""
        return self.__secret

    def strip_from(self, text: str) -> str:
        """Text from an endpoint without the key: error messages are known to quote it."""
        return text.replace(self.__secret, "[key]") if self.__secret else text
