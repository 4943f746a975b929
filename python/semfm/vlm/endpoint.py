"""Asks a vision-language model over the OpenAI-compatible chat-completions interface."""

from __future__ import annotations

import base64
import os
import random
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, Protocol
from urllib.parse import urlsplit, urlunsplit

from PIL import Image

from ..errors import SemfmError
from ..sidecar.errors import SidecarError, expected
from .key import ApiKey
from .question import Question
from .waiting import retry_after_s

#: Models whose names begin so are none: they were told the answer, or make it up.
SIMULATED = "simulated/"
#: How an answer's form is asked for: a JSON schema, any JSON object, or by the prompt alone.
RESPONSE_FORMATS = ("schema", "object", "text")
_OPENAI_URL = "https://api.openai.com/v1"
_INSTALL = "needs the openai client: pip install openai"


@dataclass(frozen=True)
class Reply:
    """What a model answered, and what it took.

    Attributes
    ----------
    text
        The answer as it came.
    refusal
        The endpoint's own field for a refusal, if any.
    finish_reason
        Why the reply ended: ``stop``, ``length``, ``content_filter`` …
    model
        The model by the endpoint's account.
    prompt_tokens, completion_tokens
        By the endpoint's account; None where it gives none.
    model_ms
        Time of the request that was answered.
    waited_ms
        Time before it: failed attempts and the pauses between them.
    attempts
        Requests, the answered one included.
    cached
        Whether it was asked before; times and tokens are then those of that time.
    """

    text: str
    refusal: str | None
    finish_reason: str | None
    model: str
    prompt_tokens: int | None
    completion_tokens: int | None
    model_ms: float
    waited_ms: float
    attempts: int
    cached: bool = False


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


class Endpoint(Protocol):
    """Whatever answers questions."""

    def ask(self, question: Question) -> Reply:
        """The reply; raises EndpointError."""
        ...

    def describe(self) -> dict[str, Any]:
        """What decides its replies beside the question, for caches and reports; no secrets."""
        ...


@dataclass(frozen=True)
class EndpointSettings:
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
    temperature
        None leaves it to the endpoint.
    max_tokens
        Of a reply; None leaves it to the endpoint.
    response_format
        One of :data:`RESPONSE_FORMATS`.
    """

    model: str
    base_url: str = field(default=_OPENAI_URL, repr=False)  # may hold a password
    key: ApiKey | None = None
    timeout_s: float = 120.0
    max_attempts: int = 5
    max_wait_s: float = 120.0
    temperature: float | None = 0.0
    max_tokens: int | None = None
    response_format: str = "schema"

    def __post_init__(self) -> None:
        if urlsplit(self.base_url).scheme not in ("http", "https"):
            raise expected("settings", "base URL", "http:// or https://", repr(self.public_url))
        if self.timeout_s <= 0 or self.max_wait_s < 0:
            raise expected("settings", "time-out", "a positive time", self.timeout_s)
        if self.max_attempts < 1:
            raise expected("settings", "attempts", "at least 1", self.max_attempts)
        if self.response_format not in RESPONSE_FORMATS:
            wanted = ", ".join(RESPONSE_FORMATS)
            raise expected("settings", "response format", wanted, repr(self.response_format))

    @property
    def public_url(self) -> str:
        """The base URL without user, password and query, which may be secrets."""
        parts = urlsplit(self.base_url)
        host = parts.netloc.rpartition("@")[2]
        return urlunsplit((parts.scheme, host, parts.path.rstrip("/"), "", ""))


def from_environment(
    model: str | None = None,
    base_url: str | None = None,
    environment: Mapping[str, str] = os.environ,
    **patience: Any,
) -> EndpointSettings:
    """Settings from ``SEMFM_VLM_MODEL``, ``SEMFM_VLM_BASE_URL`` and ``SEMFM_VLM_API_KEY``.

    ``OPENAI_MODEL``, ``OPENAI_BASE_URL`` and ``OPENAI_API_KEY`` stand in for what is missing, but
    ``OPENAI_API_KEY`` is sent only to OpenAI's own URL or the one in ``OPENAI_BASE_URL``: a key
    goes to no server that it was not made for.

    Raises
    ------
    SidecarError
        If there is no model, or no key for OpenAI's own endpoint.
    """
    model = model or environment.get("SEMFM_VLM_MODEL") or environment.get("OPENAI_MODEL")
    if not model:
        raise expected("settings", "model", "--model or $SEMFM_VLM_MODEL", "neither")
    own_url = base_url or environment.get("SEMFM_VLM_BASE_URL")
    openai_url = environment.get("OPENAI_BASE_URL") or _OPENAI_URL
    url = own_url or openai_url
    secret = environment.get("SEMFM_VLM_API_KEY")
    if not secret and url.rstrip("/") in (openai_url.rstrip("/"), _OPENAI_URL):
        secret = environment.get("OPENAI_API_KEY")
    if not secret and url.rstrip("/") == _OPENAI_URL:
        wanted = "$SEMFM_VLM_API_KEY or $OPENAI_API_KEY, or another --base-url"
        raise expected("settings", "key", wanted, "none")
    return EndpointSettings(model, url, ApiKey(secret) if secret else None, **patience)


class ChatEndpoint:
    """An OpenAI-compatible endpoint: an :class:`Endpoint`. May be asked from several threads."""

    def __init__(self, settings: EndpointSettings, stop: threading.Event | None = None) -> None:
        """``stop``, once set, ends pauses and further attempts."""
        try:
            import openai
        except ImportError as error:
            raise SidecarError(f"{settings.model}: a chat endpoint {_INSTALL} ({error})") from error
        self.settings, self._openai = settings, openai
        self._stop = stop or threading.Event()
        key = settings.key.reveal() if settings.key else "none"
        self._client = openai.OpenAI(
            base_url=settings.base_url, api_key=key, timeout=settings.timeout_s, max_retries=0
        )

    def describe(self) -> dict[str, Any]:
        """Model, URL and the settings that change a reply."""
        s = self.settings
        return {
            "base_url": s.public_url,
            "model": s.model,
            "temperature": s.temperature,
            "max_tokens": s.max_tokens,
            "response_format": s.response_format,
        }

    def ask(self, question: Question) -> Reply:
        """Ask until there is a reply, with growing pauses or those the endpoint asks for."""
        request = self._request(question)
        start = time.perf_counter()
        # Pauses differ from question to question, so that many of them do not come in step.
        jitter = random.Random(str(question.content()))
        for attempt in range(1, self.settings.max_attempts + 1):
            asked = time.perf_counter()
            try:
                completion = self._client.chat.completions.create(**request)
            except (self._openai.OpenAIError, ValueError) as error:
                # A ValueError is a body that says it is JSON and is not. Errors hold the request
                # with its headers: nothing of theirs but their words goes on.
                failure = self._failure(error)
                pause = self._pause(error, failure, attempt, jitter)
            else:
                done = time.perf_counter()
                waited = 1000 * (asked - start)
                return self._reply(completion, 1000 * (done - asked), waited, attempt)
            if pause is None or self._stop.wait(pause):
                break
        raise failure from None

    def _request(self, question: Question) -> dict[str, Any]:
        s = self.settings
        content = [_part(part) for part in question.parts]
        messages = [
            {"role": "system", "content": question.system},
            {"role": "user", "content": content},
        ]
        request: dict[str, Any] = {"model": s.model, "messages": messages}
        if s.temperature is not None:
            request["temperature"] = s.temperature
        if s.max_tokens is not None:
            request["max_completion_tokens"] = s.max_tokens
        if s.response_format == "object":
            request["response_format"] = {"type": "json_object"}
        elif s.response_format == "schema":
            schema = {"name": "region", "strict": True, "schema": question.schema()}
            request["response_format"] = {"type": "json_schema", "json_schema": schema}
        return request

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
            return EndpointError(kind, self._clean(text)[:2000])
        if isinstance(error, openai.APIConnectionError):
            reason = error.__cause__ or error
            return EndpointError("connection", self._clean(f"{url}: {reason}"))
        return EndpointError("reply", self._clean(f"{url}: {error}")[:2000])

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

    def _reply(self, completion: Any, model_ms: float, waited_ms: float, attempts: int) -> Reply:
        """Take only what has the type it should: servers vary in what they send."""
        choices = getattr(completion, "choices", None)
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = getattr(choice, "message", None)
        text, refusal = (_text(getattr(message, key, None)) for key in ("content", "refusal"))
        if text is None and refusal is None:
            found = self._clean(str(completion))[:500]
            wanted = f"{self.settings.public_url}: expected a chat completion"
            raise EndpointError("reply", f"{wanted}, found {found}")
        usage = getattr(completion, "usage", None)
        tokens = [getattr(usage, f"{kind}_tokens", None) for kind in ("prompt", "completion")]
        return Reply(
            self._clean(text or ""),
            self._clean(refusal) if refusal else None,
            _text(getattr(choice, "finish_reason", None)),
            self._clean(_text(getattr(completion, "model", None)) or self.settings.model),
            tokens[0] if type(tokens[0]) is int else None,
            tokens[1] if type(tokens[1]) is int else None,
            model_ms,
            waited_ms,
            attempts,
        )

    def _clean(self, text: str) -> str:
        if self.settings.base_url != self.settings.public_url:
            text = text.replace(self.settings.base_url, self.settings.public_url)
        return self.settings.key.strip_from(text) if self.settings.key else text


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _part(part: str | Image.Image) -> dict[str, Any]:
    if isinstance(part, str):
        return {"type": "text", "text": part}
    buffer = BytesIO()
    part.save(buffer, "PNG")
    url = "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
    return {"type": "image_url", "image_url": {"url": url, "detail": "high"}}
