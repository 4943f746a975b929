"""Asks a model to edit a picture, over the OpenAI-compatible interface ``images/edits``."""

from __future__ import annotations

import base64
import binascii
import os
import threading
from dataclasses import asdict, dataclass, field, replace
from io import BytesIO
from typing import Any, Protocol

from PIL import Image

from .._identity import picture_identity
from .._pictures import png_bytes
from ..vlm.cache import ReplyFolder
from ..vlm.client import Answered, Client, ClientSettings, EndpointError, address_from_environment
from .masks import on_white

#: Names of the environment's variables begin so.
VARIABLES = "SEMFM_IMAGE"
_FORMAT = "semfm.image-reply/1"


@dataclass(frozen=True)
class ImageReply:
    """A picture, and what it took.

    Attributes
    ----------
    picture
        The bytes of its file, as they came.
    model
        That it was asked of: the interface does not name the one that answered.
    seed
        That was sent; None where none was.
    revised_prompt
        The words that the endpoint made of ours, where it says so.
    tokens
        By the endpoint's account; None where it gives none.
    model_ms, waited_ms, attempts
        As :class:`semfm.vlm.client.Answered`.
    cached
        Whether it was asked before; times and tokens are then those of that time.
    """

    picture: bytes
    model: str
    seed: int | None
    revised_prompt: str | None
    tokens: int | None
    model_ms: float
    waited_ms: float
    attempts: int
    cached: bool = False

    def image(self) -> Image.Image:
        """The picture, as RGB; what is transparent is white, as in the reference."""
        return on_white(Image.open(BytesIO(self.picture)))


class ImageEndpoint(Protocol):
    """Whatever edits pictures."""

    def edit(self, picture: Image.Image, prompt: str, attempt: int = 1) -> ImageReply:
        """The edited picture; raises EndpointError.

        ``attempt`` counts the pictures that were asked for in the same words, since the first may
        not be what was asked for: with a seed, attempt n has the nth one.
        """
        ...

    def describe(self) -> dict[str, Any]:
        """What decides its replies beside picture and prompt; no secrets."""
        ...


@dataclass(frozen=True)
class ImageSettings(ClientSettings):
    """A client's settings, and what is asked for with each picture.

    Attributes
    ----------
    more
        Further fields of the request by name, as ``size``, ``quality``, ``input_fidelity``,
        ``seed`` or ``response_format``: endpoints differ in what they know.
    """

    timeout_s: float = 300.0
    more: dict[str, Any] = field(default_factory=dict)


def image_settings(model: str | None, base_url: str | None, **others: Any) -> ImageSettings:
    """Settings from ``SEMFM_IMAGE_MODEL``, ``SEMFM_IMAGE_BASE_URL`` and ``SEMFM_IMAGE_API_KEY``, as
    :func:`semfm.vlm.client.address_from_environment` finds them; raises SidecarError.
    """
    found = address_from_environment(VARIABLES, model, base_url)
    return ImageSettings(found.model, found.base_url, found.key, **others)


class EditEndpoint:
    """An OpenAI-compatible endpoint: an :class:`ImageEndpoint`."""

    def __init__(self, settings: ImageSettings, stop: threading.Event | None = None) -> None:
        """``stop``, once set, ends pauses and further attempts."""
        self.settings, self._client = settings, Client(settings, "an image endpoint", stop)

    def describe(self) -> dict[str, Any]:
        """Model, URL and the further fields."""
        s = self.settings
        return {"base_url": s.public_url, "model": s.model, "more": s.more}

    def edit(self, picture: Image.Image, prompt: str, attempt: int = 1) -> ImageReply:
        """Ask until there is a picture, with growing pauses or those the endpoint asks for."""
        file = ("reference.png", png_bytes(picture), "image/png")
        more = dict(self.settings.more)
        if isinstance(more.get("seed"), int):
            more["seed"] += attempt - 1
        answered = self._client.send(
            lambda client: client.images.edit(
                image=file, prompt=prompt, model=self.settings.model, extra_body=more
            ),
            prompt,
        )
        return self._reply(answered, more.get("seed"))

    def _reply(self, answered: Answered, seed: int | None) -> ImageReply:
        """Take only what has the type it should: servers vary in what they send."""
        response, clean = answered.value, self._client.clean
        data = getattr(response, "data", None)
        first = data[0] if isinstance(data, list) and data else None
        text = getattr(first, "b64_json", None)
        if not isinstance(text, str):
            has_url = isinstance(getattr(first, "url", None), str)
            found = "a URL (--set response_format=b64_json asks for the picture)"
            found = found if has_url else clean(str(response))[:500]
            wanted = f"{self.settings.public_url}: expected a picture in `b64_json`"
            raise EndpointError("reply", f"{wanted}, found {found}")
        try:
            picture = base64.b64decode(text, validate=True)
            with Image.open(BytesIO(picture)) as opened:
                opened.load()
        except (binascii.Error, OSError, ValueError, Image.DecompressionBombError) as error:
            wanted = f"{self.settings.public_url}: expected a picture in `b64_json`"
            raise EndpointError("reply", f"{wanted}, found what is none: {error}") from None
        revised = getattr(first, "revised_prompt", None)
        usage = getattr(response, "usage", None)
        if isinstance(usage, dict):  # older clients do not know the field
            tokens = usage.get("total_tokens")
        else:
            tokens = getattr(usage, "total_tokens", None)
        return ImageReply(
            picture,
            self.settings.model,
            seed,
            clean(revised) if isinstance(revised, str) else None,
            tokens if type(tokens) is int else None,
            answered.model_ms,
            answered.waited_ms,
            answered.attempts,
        )


class CachedImages:
    """An endpoint that looks into a folder first: an :class:`ImageEndpoint`.

    A picture's file is named by the SHA-256 of all that decides it: the prompt, the pixels of the
    reference, the model, its URL, the further fields and the attempt. Failures are not kept.
    """

    def __init__(self, endpoint: ImageEndpoint, folder: str | os.PathLike[str]) -> None:
        self._endpoint, self._kept = endpoint, ReplyFolder(folder, _FORMAT, ImageReply)

    def describe(self) -> dict[str, Any]:
        """As the endpoint behind the cache."""
        return self._endpoint.describe()

    def edit(self, picture: Image.Image, prompt: str, attempt: int = 1) -> ImageReply:
        """The kept picture, or a new one, which is then kept."""
        pixels = picture_identity(picture)
        asked = {"picture": pixels, "prompt": prompt, "attempt": attempt}
        decides = {**asked, "endpoint": self.describe()}
        if (kept := _reply(self._kept.read(decides))) is not None:
            return kept
        reply = self._endpoint.edit(picture, prompt, attempt)
        encoded = base64.b64encode(reply.picture).decode()
        self._kept.write(decides, {**asdict(reply), "picture": encoded})
        return reply


def _reply(kept: dict[str, Any] | None) -> ImageReply | None:
    """A kept picture; None where there is none or it is broken, which asks anew."""
    if kept is None:
        return None
    try:
        picture = base64.b64decode(kept["picture"], validate=True)
        reply = replace(ImageReply(**{**kept, "picture": picture}), cached=True)
        reply.image()
        return reply
    except (OSError, ValueError, AttributeError, KeyError, TypeError):
        return None
