"""A server of chat completions and of picture edits for tests that misbehaves on command."""

from __future__ import annotations

import base64
import email
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Callable, Union

#: What to do with a request: text to answer with, or a function that writes the response.
Act = Union[str, Callable[["Handler"], None]]


class FakeEndpoint:
    """Takes acts one per request; the last one serves all further requests."""

    def __init__(self, server: ThreadingHTTPServer) -> None:
        self.acts: list[Act] = ['{"views": []}']
        self.requests: list[dict] = []
        self.keys: list[str | None] = []
        self.times: list[float] = []
        self.url = f"http://127.0.0.1:{server.server_address[1]}/v1"
        self.lock = threading.Lock()
        self.stopped = threading.Event()


class Handler(BaseHTTPRequestHandler):
    fake: FakeEndpoint

    def do_POST(self) -> None:
        kind, data = (
            self.headers["content-type"],
            self.rfile.read(int(self.headers["content-length"])),
        )
        is_form = kind.startswith("multipart/form-data")
        body = form(kind, data) if is_form else json.loads(data)
        with self.fake.lock:
            self.fake.requests.append(body)
            self.fake.keys.append(self.headers.get("authorization"))
            self.fake.times.append(time.monotonic())
            act = self.fake.acts.pop(0) if len(self.fake.acts) > 1 else self.fake.acts[0]
        if self.path != ("/v1/images/edits" if is_form else "/v1/chat/completions"):
            return status(404)(self)
        answer(act)(self) if isinstance(act, str) else act(self)

    def send(self, code: int, body: str, headers: dict[str, str], kind: str) -> None:
        self.send_response(code)
        data = body.encode()
        for name, value in {"content-type": kind, "content-length": len(data), **headers}.items():
            self.send_header(name, str(value))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *args: object) -> None:
        pass


def answer(text: str | None, finish_reason: str = "stop", **message: object):
    """A sound chat completion."""
    body = {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 1,
        "model": "simulated/fake",
        "choices": [
            {
                "index": 0,
                "finish_reason": finish_reason,
                "message": {"role": "assistant", "content": text, **message},
            }
        ],
        "usage": {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120},
    }
    return raw(json.dumps(body))


def form(kind: str, data: bytes) -> dict[str, Union[str, bytes]]:
    """The fields of a form: bytes where a field is a file, else text."""
    message = email.message_from_bytes(b"content-type: " + kind.encode() + b"\r\n\r\n" + data)
    fields: dict[str, Union[str, bytes]] = {}
    for part in message.get_payload():
        value = part.get_payload(decode=True)
        name = part.get_param("name", header="content-disposition")
        fields[name] = value if part.get_filename() else value.decode()
    return fields


def edited(picture: bytes, **more: object):
    """A sound answer to an edit: the bytes of a picture's file."""
    entry = {"b64_json": base64.b64encode(picture).decode(), **more}
    body = {"created": 1, "data": [entry], "usage": {"total_tokens": 1200}}
    return raw(json.dumps(body))


def raw(body: str, kind: str = "application/json"):
    """Any body with status 200."""
    return lambda handler: handler.send(200, body, {}, kind)


def status(code: int, message: str = "no", error_code: str | None = None, **headers: str):
    """An error as OpenAI words it."""
    body = json.dumps({"error": {"message": message, "code": error_code}})
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return lambda handler: handler.send(code, body, named, "application/json")


def hang(handler: Handler) -> None:
    """No answer while anyone waits."""
    handler.fake.stopped.wait(30)


def reset(handler: Handler) -> None:
    """The connection closes without a word."""
    handler.close_connection = True


@contextmanager
def fake_endpoint() -> Iterator[FakeEndpoint]:
    """A server on a free port of this machine."""
    handler = type("OneHandler", (Handler,), {})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    handler.fake = FakeEndpoint(server)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield handler.fake
    finally:
        handler.fake.stopped.set()
        server.shutdown()
        server.server_close()
