"""The endpoint: patience where it helps, none where it does not, and a key that never shows."""

from __future__ import annotations

import base64
import json
import logging
import pickle
import time
import traceback
from io import BytesIO

import numpy as np
import pytest
from fake_endpoint import answer, hang, raw, reset, status
from PIL import Image
from semfm.sidecar.errors import SidecarError
from semfm.vlm import CachedEndpoint, ChatEndpoint, from_environment
from semfm.vlm.client import EndpointError
from semfm.vlm.key import ApiKey
from semfm.vlm.question import Question
from semfm.vlm.waiting import retry_after_s
from vlm_fixtures import KEY

pytest.importorskip("openai")

PICTURE = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))


def question(text: str = "Where?", picture: Image.Image = PICTURE) -> Question:
    return Question("marks", "Look.", [text, picture], ["T1"], [], None)


def chat(**patience) -> ChatEndpoint:
    return ChatEndpoint(from_environment(timeout_s=5, **patience))


def test_a_request_holds_prompt_pictures_and_settings(endpoint):
    endpoint.acts = ["fine"]
    reply = chat(max_tokens=77, temperature=None).ask(question())
    assert (reply.text, reply.attempts, reply.cached) == ("fine", 1, False)
    assert (reply.prompt_tokens, reply.completion_tokens) == (100, 20)
    (body,) = endpoint.requests
    assert endpoint.keys == [f"Bearer {KEY}"]
    assert (body["model"], body["max_completion_tokens"]) == ("fake", 77)
    assert "temperature" not in body
    assert body["response_format"]["json_schema"]["schema"]["required"] == ["views"]
    system, user = body["messages"]
    assert system == {"role": "system", "content": "Look."}
    assert user["content"][0] == {"type": "text", "text": "Where?"}
    url = user["content"][1]["image_url"]["url"]
    sent = Image.open(BytesIO(base64.b64decode(url.removeprefix("data:image/png;base64,"))))
    np.testing.assert_array_equal(np.asarray(sent), np.asarray(PICTURE))


def test_response_formats(endpoint):
    endpoint.acts = ["fine"]
    for form, sent in (("object", {"type": "json_object"}), ("text", None)):
        chat(response_format=form).ask(question())
        assert endpoint.requests[-1].get("response_format") == sent


def test_a_rate_limit_is_waited_for_as_long_as_it_says(endpoint):
    endpoint.acts = [status(429, retry_after="1"), status(429, retry_after_ms="300"), "fine"]
    reply = chat().ask(question())
    assert (reply.text, reply.attempts) == ("fine", 3)
    first, second, third = endpoint.times
    assert 1 <= second - first < 3 and 0.3 <= third - second < 1.3
    assert reply.waited_ms >= 1300 and reply.model_ms < 1000


def test_server_errors_and_lost_connections_are_tried_again(endpoint):
    endpoint.acts = [status(500), reset, status(503, retry_after_ms="1"), "fine"]
    assert chat().ask(question()).attempts == 4


@pytest.mark.parametrize(
    "act, attempts, kind, text",
    [
        (status(500, "out of memory", retry_after_ms="1"), 3, "server", "out of memory"),
        (status(429, retry_after_ms="1"), 3, "rate_limit", "HTTP 429"),
        (status(429, "pay", "insufficient_quota"), 1, "access", "pay"),
        (status(429, retry_after="9999"), 1, "rate_limit", "HTTP 429"),
        (status(401, "Incorrect API key"), 1, "access", "Incorrect API key"),
        (status(404, "no such model"), 1, "access", "no such model"),
        (status(400, "image too large"), 1, "request", "image too large"),
        (raw("<html>hello</html>", "text/html"), 1, "reply", "hello"),
        (raw('{"choices": []}'), 1, "reply", "chat completion"),
        (raw('{"choices": [{"message": {"content": 3}}]}'), 1, "reply", "chat completion"),
        (answer(None), 1, "reply", "chat completion"),
        (raw('{"choices": '), 1, "reply", "127.0.0.1"),
    ],
)
def test_what_gives_no_reply_says_why(endpoint, act, attempts, kind, text):
    endpoint.acts = [act]
    with pytest.raises(EndpointError) as error:
        chat(max_attempts=3).ask(question())
    assert error.value.kind == kind and text in error.value.text
    assert endpoint.url in error.value.text
    assert len(endpoint.requests) == attempts


def test_silence_ends_at_the_time_out(endpoint):
    endpoint.acts = [hang]
    start = time.monotonic()
    with pytest.raises(EndpointError) as error:
        ChatEndpoint(from_environment(timeout_s=0.3, max_attempts=2)).ask(question())
    assert error.value.kind == "timeout" and "0.3 s" in error.value.text
    assert 0.6 <= time.monotonic() - start < 6
    assert len(endpoint.requests) == 2


def test_nobody_there():
    settings = from_environment("m", "http://127.0.0.1:9/v1", {}, max_attempts=1)
    with pytest.raises(EndpointError) as error:
        ChatEndpoint(settings).ask(question())
    assert error.value.kind == "connection"


def test_a_refusal_is_a_reply(endpoint):
    endpoint.acts = [answer(None, refusal="I can't help with that.")]
    reply = chat().ask(question())
    assert (reply.text, reply.refusal) == ("", "I can't help with that.")


def test_replies_are_kept_by_content(endpoint, tmp_path):
    endpoint.acts = ["first", "second", "third", "fourth"]
    cached = CachedEndpoint(chat(), tmp_path / "replies")
    assert cached.ask(question()).cached is False
    again = CachedEndpoint(chat(), tmp_path / "replies").ask(question())
    assert (again.text, again.cached, again.prompt_tokens) == ("first", True, 100)
    assert len(endpoint.requests) == 1
    darker = Image.fromarray(np.asarray(PICTURE) // 2)
    assert cached.ask(question(picture=darker)).text == "second"
    assert cached.ask(question("Where then?")).text == "third"
    other = CachedEndpoint(chat(temperature=0.7), tmp_path / "replies")
    assert other.ask(question()).text == "fourth"
    assert len(list((tmp_path / "replies").iterdir())) == 4


def test_a_broken_entry_is_asked_again_and_a_failure_is_not_kept(endpoint, tmp_path):
    endpoint.acts = [status(400), "fine", "fresh"]
    cached = CachedEndpoint(chat(), tmp_path)
    with pytest.raises(EndpointError):
        cached.ask(question())
    assert list(tmp_path.iterdir()) == []
    cached.ask(question())
    (entry,) = tmp_path.iterdir()
    for broken in ("", "{", "[]", json.dumps({"format": "semfm.vlm-reply/1", "text": "x"})):
        entry.write_text(broken)
        assert cached.ask(question()).text == "fresh"
        assert cached.ask(question()).cached


def test_the_key_shows_nowhere(endpoint, tmp_path, caplog):
    """Not even where the endpoint quotes it: in an error, a reply, or the model's name."""
    caplog.set_level(logging.DEBUG)
    seen = []
    leaks = [
        status(401, f"Incorrect API key provided: {KEY}"),
        status(500, KEY),
        raw(f"<html>{KEY}</html>", "text/html"),
        raw(json.dumps({"choices": [], "hint": KEY})),
        hang,
    ]
    for act in leaks:
        endpoint.acts = [act]
        try:
            ChatEndpoint(from_environment(timeout_s=0.3, max_attempts=1)).ask(question())
        except EndpointError as error:
            seen += [
                repr(error),
                "".join(traceback.format_exception(type(error), error, error.__traceback__)),
            ]
    assert len(seen) == 2 * len(leaks) and "[key]" in "".join(seen)
    endpoint.acts = [f"your key is {KEY}"]
    cached = CachedEndpoint(chat(), tmp_path)
    reply = cached.ask(question())
    settings = from_environment()
    seen += [repr(reply), repr(settings), str(settings), f"{settings.key}", repr(cached.describe())]
    seen += [path.name + path.read_text() for path in tmp_path.iterdir()]
    seen += [record.getMessage() for record in caplog.records]
    assert endpoint.keys[-1] == f"Bearer {KEY}", "it was sent"
    assert len(seen) > 12 and not [text for text in seen if KEY in text]
    with pytest.raises(TypeError):
        pickle.dumps(settings)


def test_a_password_in_the_url_shows_nowhere(endpoint):
    url = endpoint.url.replace("://", "://user:hunter2@") + "?token=abc"
    settings = from_environment(base_url=url)
    assert settings.public_url == endpoint.url
    assert "hunter2" not in repr(ChatEndpoint(settings).describe())
    assert "hunter2" not in repr(settings) and "abc" not in repr(settings)


@pytest.mark.parametrize("name", ["SEMFM_VLM_API_KEY", "OPENAI_API_KEY"])
def test_a_key_that_no_header_can_hold_is_refused_unseen(name):
    about = {"OPENAI_MODEL": "m"}
    assert from_environment(environment={**about, name: " sk-abc\r\n"}).key.reveal() == "sk-abc"
    for bad in ("sk-a\rbc", "sk-a\nbc", "sk-a\x00bc", "sk-äbc"):
        with pytest.raises(SidecarError) as error:
            from_environment(environment={**about, name: bad})
        assert f"${name}" in str(error.value) and "sk-" not in str(error.value)


@pytest.mark.parametrize(
    "url",
    [
        "me:s3cret@host/v1",
        "https:me:s3cret@host/v1",
        "ftp://me:s3cret@host/v1",
        "http://host:s3cret/v1",
        "http://[s3cret/v1",
        "https:///s3cret",
    ],
)
def test_a_url_that_is_none_is_refused_unseen(url):
    with pytest.raises(SidecarError, match="https://host/v1") as error:
        from_environment("m", url, {})
    assert "s3cret" not in str(error.value)


def test_a_key_goes_only_where_it_belongs():
    openai = {"OPENAI_API_KEY": "sk-openai", "OPENAI_MODEL": "gpt-4o"}
    settings = from_environment(environment=openai)
    assert settings.key.reveal() == "sk-openai" and settings.model == "gpt-4o"
    assert settings.public_url == "https://api.openai.com/v1"
    proxy = {**openai, "OPENAI_BASE_URL": "https://proxy/v1"}
    assert from_environment(environment=proxy).key.reveal() == "sk-openai"
    assert from_environment(base_url="http://localhost:8000/v1", environment=proxy).key is None
    assert from_environment(environment={**openai, "SEMFM_VLM_BASE_URL": "http://l/v1"}).key is None
    own = {**openai, "SEMFM_VLM_API_KEY": "own"}
    assert from_environment(base_url="http://l/v1", environment=own).key.reveal() == "own"
    with pytest.raises(SidecarError, match="SEMFM_VLM_API_KEY"):
        from_environment("gpt-4o", environment={})
    with pytest.raises(SidecarError, match="--model or"):
        from_environment(environment={})
    with pytest.raises(SidecarError, match="https"):
        from_environment("m", "localhost:8000", {})
    assert repr(ApiKey("abc")) == "[key]"


def test_retry_after():
    assert retry_after_s({"retry-after": "7"}, 0) == 7
    assert retry_after_s({"retry-after": "7", "retry-after-ms": "1500"}, 0) == 1.5
    assert retry_after_s({"retry-after": "Thu, 01 Jan 1970 00:01:00 GMT"}, 50) == 10
    assert retry_after_s({"retry-after": "Thu, 01 Jan 1970 00:01:00 GMT"}, 99) == 0
    for nothing in ({}, {"retry-after": "soon"}, {"retry-after": "-3"}, {"retry-after": "nan"}):
        assert retry_after_s(nothing, 0) is None
