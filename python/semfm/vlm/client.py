"""The client of an OpenAI-compatible interface: settings, patience, and errors without secrets.

What is asked and what comes back is the business of those who use it: :mod:`.endpoint` (chat
completions) and :mod:`semfm.dataset.image_endpoint` (pictures).
"""

from __future__ import annotations

import os
import random
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Callable
from urllib.parse import urlsplit, urlunsplit

from ..errors import SemfmError
from ..sidecar.errors import SidecarError, expected
from .key import ApiKey
from .waiting import retry_after_s

_OPENAI_URL = "https://api.openai.com/v1"
_INSTALL = "needs the openai client: pip install openai"


class EndpointError(SemfmError):
    """No reply: the endpoint failed, or refused the request.

    Attributes
    ----------
    kind
        ``timeout``, ``connection``, ``rate_limit``, ``server``, ``request``, ``reply`` or
        ``access``; the last will not get better by asking about another pair.
    text
        What happened, in the endpoint's words where it gave any.
    """

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(f"{kind}: {text}", f"endpoint-{kind}")
        self.kind, self.text = kind, text

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.kind, self.text))


@dataclass(frozen=True)
class ClientSettings:
    """Which model, where, and with how much patience.

    Attributes
    ----------
    model
        Its name at the endpoint.
    base_url
        Of the interface, as ``https://host/v1``.
    key
        None for a server that asks for none.
    timeout_s
        Without a byte for this long, a request is given up.
    max_attempts
        Requests per question, at most.
    max_wait_s
        The longest pause between two; an endpoint that asks for more is given up.
    """

    model: str
    base_url: str = field(default=_OPENAI_URL, repr=False)  # may hold a password
    key: ApiKey | None = None
    timeout_s: float = 120.0
    max_attempts: int = 5
    max_wait_s: float = 120.0

    def __post_init__(self) -> None:
        if not _is_base_url(self.base_url):  # not quoted: it may show a password
            wanted = "http:// or https:// with a host, as https://host/v1"
            raise expected("settings", "base URL", wanted, "something else")
        if self.timeout_s <= 0 or self.max_wait_s < 0:
            raise expected("settings", "time-out", "a positive time", self.timeout_s)
        if self.max_attempts < 1:
            raise expected("settings", "attempts", "at least 1", self.max_attempts)

    @property
    def public_url(self) -> str:
        """The base URL without user, password and query, which may be secrets."""
        parts = urlsplit(self.base_url)
        host = parts.netloc.rpartition("@")[2]
        return urlunsplit((parts.scheme, host, parts.path.rstrip("/"), "", ""))


def _is_base_url(url: str) -> bool:
    try:
        parts = urlsplit(url)
        _ = parts.port  # raises for what is no port
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(parts.hostname)


@dataclass(frozen=True)
class Address:
    """Model, URL and key out of the environment."""

    model: str
    base_url: str
    key: ApiKey | None


def address_from_environment(
    variables: str,
    model: str | None = None,
    base_url: str | None = None,
    environment: Mapping[str, str] = os.environ,
) -> Address:
    """Model, URL and key from ``X_MODEL``, ``X_BASE_URL`` and ``X_API_KEY``, X being ``variables``.

    ``OPENAI_MODEL``, ``OPENAI_BASE_URL`` and ``OPENAI_API_KEY`` stand in for what is missing, but
    ``OPENAI_API_KEY`` is sent only to OpenAI's own URL or the one in ``OPENAI_BASE_URL``: a key
    goes to no server that it was not made for.

    Raises
    ------
    SidecarError
        If there is no model, no key for OpenAI's own endpoint, or a key that no header can hold.
    """
    model = model or environment.get(f"{variables}_MODEL") or environment.get("OPENAI_MODEL")
    if not model:
        raise expected("settings", "model", f"--model or ${variables}_MODEL", "neither")
    own_url = base_url or environment.get(f"{variables}_BASE_URL")
    openai_url = environment.get("OPENAI_BASE_URL") or _OPENAI_URL
    url = own_url or openai_url
    setting = f"{variables}_API_KEY"
    secret = environment.get(setting, "").strip()
    if not secret and url.rstrip("/") in (openai_url.rstrip("/"), _OPENAI_URL):
        setting = "OPENAI_API_KEY"
        secret = environment.get(setting, "").strip()
    if not secret and url.rstrip("/") == _OPENAI_URL:
        wanted = f"${variables}_API_KEY or $OPENAI_API_KEY, or another --base-url"
        raise expected("settings", "key", wanted, "none")
    if not (secret.isascii() and secret.isprintable()):  # its sender would quote it, escaped
        raise expected("settings", f"${setting}", "printable ASCII", "other characters in it")
    return Address(model, url, ApiKey(secret) if secret else None)


@dataclass(frozen=True)
class Answered:
    """What came back, and what it took.

    Attributes
    ----------
    value
        The client's own object.
    model_ms
        Time of the request that was answered.
    waited_ms
        Time before it: failed attempts and the pauses between them.
    attempts
        Requests, the answered one included.
    """

    value: Any
    model_ms: float
    waited_ms: float
    attempts: int


class Client:
    """Sends requests, again where that helps. May be used from several threads."""

    def __init__(
        self, settings: ClientSettings, what: str, stop: threading.Event | None = None
    ) -> None:
        """``what`` it talks to, for messages; ``stop``, once set, ends pauses and attempts."""
        try:
            import openai
        except ImportError as error:
            raise SidecarError(f"{settings.model}: {what} {_INSTALL} ({error})") from error
        self.settings, self._openai = settings, openai
        self._stop = stop or threading.Event()
        key = settings.key.reveal() if settings.key else "none"
        self._client = openai.OpenAI(
            base_url=settings.base_url, api_key=key, timeout=settings.timeout_s, max_retries=0
        )

    def send(self, request: Callable[[Any], Any], name: str) -> Answered:
        """Send until there is an answer, with growing pauses or those the endpoint asks for.

        Parameters
        ----------
        request
            Called with the ``openai.OpenAI`` for each attempt.
        name
            Of the question, so that the pauses of many questions do not come in step.

        Raises
        ------
        EndpointError
            If there is none.
        """
        start = time.perf_counter()
        jitter = random.Random(name)
        for attempt in range(1, self.settings.max_attempts + 1):
            asked = time.perf_counter()
            try:
                value = request(self._client)
            except (self._openai.OpenAIError, ValueError) as error:
                # A ValueError is a body that says it is JSON and is not. Errors hold the request
                # with its headers: nothing of theirs but their words goes on.
                failure = self._failure(error)
                pause = self._pause(error, failure, attempt, jitter)
            else:
                done = time.perf_counter()
                return Answered(value, 1000 * (done - asked), 1000 * (asked - start), attempt)
            if pause is None or self._stop.wait(pause):
                break
        raise failure from None

    def clean(self, text: str) -> str:
        """Text from the endpoint without the key, and without what the URL may hide."""
        if self.settings.base_url != self.settings.public_url:
            text = text.replace(self.settings.base_url, self.settings.public_url)
        return self.settings.key.strip_from(text) if self.settings.key else text

    def _failure(self, error: Exception) -> EndpointError:
        openai, url = self._openai, self.settings.public_url
        if isinstance(error, openai.APITimeoutError):
            return EndpointError("timeout", f"{url}: no reply within {self.settings.timeout_s:g} s")
        if isinstance(error, openai.APIStatusError):
            status, text = error.status_code, f"{url}: HTTP {error.status_code}: {error.message}"
            kind = "server" if status >= 500 else "request"
            if status == 429:
                kind = "access" if error.code == "insufficient_quota" else "rate_limit"
            elif status in (401, 403, 404):
                kind = "access"
            return EndpointError(kind, self.clean(text)[:2000])
        if isinstance(error, openai.APIConnectionError):
            reason = error.__cause__ or error
            return EndpointError("connection", self.clean(f"{url}: {reason}"))
        return EndpointError("reply", self.clean(f"{url}: {error}")[:2000])

    def _pause(
        self, error: Exception, failure: EndpointError, attempt: int, jitter: random.Random
    ) -> float | None:
        """Seconds until the next attempt; None to give up."""
        status = getattr(error, "status_code", None)
        worth = failure.kind in ("timeout", "connection", "rate_limit", "server")
        if not (worth or status in (408, 409)) or attempt == self.settings.max_attempts:
            return None
        if isinstance(error, self._openai.APIStatusError):
            asked_for = retry_after_s(error.response.headers, time.time())
            if asked_for is not None:
                return asked_for if asked_for <= self.settings.max_wait_s else None
        return min(2.0 ** (attempt - 1) * jitter.uniform(0.5, 1.0), self.settings.max_wait_s)
