"""Asks a vision-language model over the OpenAI-compatible chat-completions interface."""

from __future__ import annotations

import base64
import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from PIL import Image

from .._pictures import png_bytes
from ..sidecar.errors import expected
from .client import Answered, Client, ClientSettings, EndpointError, address_from_environment
from .question import Question

#: Models whose names begin so are none: they were told the answer, or make it up.
SIMULATED = "simulated/"
#: How an answer's form is asked for: a JSON schema, any JSON object, or by the prompt alone.
RESPONSE_FORMATS = ("schema", "object", "text")


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


class Endpoint(Protocol):
    """Whatever answers questions."""

    def ask(self, question: Question) -> Reply:
        """The reply; raises EndpointError."""
        ...

    def describe(self) -> dict[str, Any]:
        """What decides its replies beside the question, for caches and reports; no secrets."""
        ...


@dataclass(frozen=True)
class EndpointSettings(ClientSettings):
    """A client's settings, and how it is to answer.

    Attributes
    ----------
    temperature
        None leaves it to the endpoint.
    max_tokens
        Of a reply; None leaves it to the endpoint.
    response_format
        One of :data:`RESPONSE_FORMATS`.
    """

    temperature: float | None = 0.0
    max_tokens: int | None = None
    response_format: str = "schema"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.response_format not in RESPONSE_FORMATS:
            wanted = ", ".join(RESPONSE_FORMATS)
            raise expected("settings", "response format", wanted, repr(self.response_format))


def from_environment(
    model: str | None = None,
    base_url: str | None = None,
    environment: Mapping[str, str] = os.environ,
    **patience: Any,
) -> EndpointSettings:
    """Settings from ``SEMFM_VLM_MODEL``, ``SEMFM_VLM_BASE_URL`` and ``SEMFM_VLM_API_KEY``, as
    :func:`.client.address_from_environment` finds them; raises SidecarError.
    """
    found = address_from_environment("SEMFM_VLM", model, base_url, environment)
    return EndpointSettings(found.model, found.base_url, found.key, **patience)


class ChatEndpoint:
    """An OpenAI-compatible endpoint: an :class:`Endpoint`. May be asked from several threads."""

    def __init__(self, settings: EndpointSettings, stop: threading.Event | None = None) -> None:
        """``stop``, once set, ends pauses and further attempts."""
        self.settings, self._client = settings, Client(settings, "a chat endpoint", stop)

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
        answered = self._client.send(
            lambda client: client.chat.completions.create(**request), str(question.content())
        )
        return self._reply(answered)

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

    def _reply(self, answered: Answered) -> Reply:
        """Take only what has the type it should: servers vary in what they send."""
        completion, clean = answered.value, self._client.clean
        choices = getattr(completion, "choices", None)
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = getattr(choice, "message", None)
        text, refusal = (_text(getattr(message, key, None)) for key in ("content", "refusal"))
        if text is None and refusal is None:
            found = clean(str(completion))[:500]
            wanted = f"{self.settings.public_url}: expected a chat completion"
            raise EndpointError("reply", f"{wanted}, found {found}")
        usage = getattr(completion, "usage", None)
        tokens = [getattr(usage, f"{kind}_tokens", None) for kind in ("prompt", "completion")]
        return Reply(
            clean(text or ""),
            clean(refusal) if refusal else None,
            _text(getattr(choice, "finish_reason", None)),
            clean(_text(getattr(completion, "model", None)) or self.settings.model),
            tokens[0] if type(tokens[0]) is int else None,
            tokens[1] if type(tokens[1]) is int else None,
            answered.model_ms,
            answered.waited_ms,
            answered.attempts,
        )


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _part(part: str | Image.Image) -> dict[str, Any]:
    if isinstance(part, str):
        return {"type": "text", "text": part}
    url = "data:image/png;base64," + base64.b64encode(png_bytes(part)).decode()
    return {"type": "image_url", "image_url": {"url": url, "detail": "high"}}
