"""Writes ``semfm/_semfm.pyi`` from the compiled module: its signatures and its docstrings.

PyO3 gives names, order and defaults of parameters; their types stand in the numpydoc sections. A
parameter without a documented type, and a documented one that does not exist, are errors: the
documentation is complete or the stubs are not written.

    python python/tools/stubs.py            # writes the file beside the package's sources
    python python/tools/stubs.py --check    # fails where the file is not current
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
import textwrap
from pathlib import Path

from semfm import _semfm

OUTPUT = Path(__file__).resolve().parents[1] / "semfm" / "_semfm.pyi"

HEADER = '''\
# Written by python/tools/stubs.py from the compiled module. Do not edit.
# ruff: noqa: E501, UP007, UP045
"""The compiled half of `semfm`."""

import os
from collections.abc import Iterable, Mapping
from typing import Any, Callable, Optional, Protocol, Union

import numpy
from numpy.typing import ArrayLike, NDArray

class _WithFaces(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...

class _WithTriangles(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def triangles(self) -> Any: ...

_Path = Union[str, os.PathLike[str]]
_MeshLike = Union["Mesh", _Path, _WithFaces, _WithTriangles]
_PoseLike = Union[ArrayLike, "Alignment", _Path]
_Progress = Union[bool, Callable[[str, int, int], object]]
_Cache = Union[bool, _Path]

__version__: str
'''

PLAIN = {
    "int": "int",
    "float": "float",
    "bool": "bool",
    "str": "str",
    "bytes": "bytes",
    "object": "Any",
    "path": "_Path",
    "mesh_like": "_MeshLike",
    "pose_like": "_PoseLike",
    "progress": "_Progress",
    "cache": "_Cache",
    "scipy.sparse.csc_matrix": "Any",
}
#: What an iterator and a sequence hold.
ITEMS = {"Observations": "Observation", "Grasps": "Grasp"}
#: Methods whose documentation is Python's own, for a class and its items.
SPECIAL = {
    "__len__": "def __len__(self) -> int: ...",
    "__eq__": "def __eq__(self, other: object) -> bool: ...",
    "__hash__": "def __hash__(self) -> int: ...",
    "__getattr__": "def __getattr__(self, name: str) -> Any: ...",
    "__iter__": "def __iter__(self) -> {name}: ...",
    "__next__": "def __next__(self) -> {item}: ...",
    "__getitem__": "def __getitem__(self, index: int) -> {item}: ...",
}
CLASSES = {name for name, value in vars(_semfm).items() if inspect.isclass(value)}


class Incomplete(Exception):
    """Documentation that does not say what the stubs must."""


def annotation(text: str, *, argument: bool) -> str:
    """The type that a numpydoc type means."""
    text = re.sub(r", default .*$", "", text.strip())
    if text.endswith(", optional"):
        return f"Optional[{annotation(text[: -len(', optional')], argument=argument)}]"
    if text.startswith("list of "):
        inner = annotation(text[len("list of ") :], argument=argument)
        return f"Iterable[{inner}]" if argument else f"list[{inner}]"
    if text.startswith("tuple of "):
        inner = [annotation(part, argument=argument) for part in text[9:].split(", ")]
        return f"tuple[{', '.join(inner)}]"
    if text == "dict":
        return "Mapping[str, Any]" if argument else "dict[str, Any]"
    if text in PLAIN or text in CLASSES:
        return PLAIN.get(text, text)
    if " or " in text:
        parts = [part for part in text.split(" or ") if not re.fullmatch(r"\([^()]*\)", part)]
        inner = list(dict.fromkeys(annotation(part, argument=argument) for part in parts))
        return inner[0] if len(inner) == 1 else f"Union[{', '.join(inner)}]"
    array = re.fullmatch(r"\([^()]*\) (?:(\w+) )?(array|array_like)", text)
    if array and array[2] == "array_like":
        return "ArrayLike"
    if array:
        return f"NDArray[{'numpy.' + array[1].replace('bool', 'bool_') if array[1] else 'Any'}]"
    raise Incomplete(f"unknown type {text!r}")


def sections(doc: str) -> dict[str, list[str]]:
    """The numpydoc sections: title and lines."""
    found: dict[str, list[str]] = {"": []}
    lines, current = doc.splitlines(), ""
    for i, line in enumerate(lines):
        if i + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[i + 1].strip()):
            current = line.strip()
            found[current] = []
        elif not re.fullmatch(r"-{3,}", line.strip()):
            found[current].append(line)
    return found


def entries(lines: list[str]) -> list[str]:
    """The lines of a section that stand at the margin."""
    return [line.strip() for line in lines if line and not line.startswith(" ")]


def parameters(value: object, name: str, doc: str) -> str:
    """The parameters of a function with their types, without the brackets."""
    documented: dict[str, str] = {}
    for line in entries(sections(doc).get("Parameters", [])):
        parameter, found, kind = line.partition(" : ")
        if not found:
            raise Incomplete(f"{name}: no type in {line!r}")
        documented[parameter.lstrip("*")] = kind
    out, starred = [], False
    for parameter in inspect.signature(value).parameters.values():
        if parameter.name in ("self", "cls"):
            continue
        if parameter.name not in documented:
            raise Incomplete(f"{name}: `{parameter.name}` is not documented")
        kind = annotation(documented.pop(parameter.name), argument=True)
        if parameter.kind is parameter.VAR_KEYWORD:
            out.append(f"**{parameter.name}: {kind}")
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            out.append("*")
            starred = True
        default = parameter.default
        text = "" if default is parameter.empty else f" = {default!r}"
        if default is None and not kind.startswith("Optional["):
            raise Incomplete(f"{name}: `{parameter.name}` may be None, but is not optional")
        out.append(f"{parameter.name}: {kind}{text}")
    if documented:
        raise Incomplete(f"{name}: documented, but not there: {', '.join(documented)}")
    return ", ".join(out)


def returned(doc: str, name: str) -> str:
    """What the Returns section says."""
    lines = entries(sections(doc).get("Returns", []))
    kinds = [annotation(line.rpartition(" : ")[2], argument=False) for line in lines]
    if not kinds:
        return "None"
    return kinds[0] if len(kinds) == 1 else f"tuple[{', '.join(kinds)}]"


def function(value: object, name: str, owner: str = "", static: bool = False) -> list[str]:
    """A function or method as lines of a stub."""
    doc, full = inspect.getdoc(value) or "", f"{owner}.{name}" if owner else name
    if not doc:
        raise Incomplete(f"{full}: no documentation")
    inside = parameters(value, full, doc)
    if owner and not static:
        inside = f"self, {inside}" if inside else "self"
    head = ["@staticmethod"] if static else []
    return [*head, f"def {name}({inside}) -> {returned(doc, full)}:", *quoted(doc), "    ..."]


def quoted(doc: str) -> list[str]:
    """A docstring, indented by one step."""
    text = doc.replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    return textwrap.indent(f'"""{text}\n"""' if "\n" in text else f'"""{text}"""', "    ").split(
        "\n"
    )


def klass(value: type) -> list[str]:
    """A class as lines of a stub."""
    name, doc = value.__name__, inspect.getdoc(value) or ""
    if not doc:
        raise Incomplete(f"{name}: no documentation")
    lines = [f"class {name}:", *quoted(doc)]
    if value.__text_signature__:
        inside = parameters(value, name, doc)
        lines.append(f"    def __init__(self{', ' + inside if inside else ''}) -> None: ...")
    for member, found in sorted(vars(value).items()):
        if member in SPECIAL and not (member == "__hash__" and found is None):
            item = ITEMS.get(name, "")
            lines.append(f"    {SPECIAL[member].format(name=name, item=item)}")
        if member.startswith("_"):
            continue
        if inspect.isgetsetdescriptor(found):
            text = inspect.getdoc(found) or ""
            kind, colon, _ = text.partition(": ")
            if not colon:
                raise Incomplete(f"{name}.{member}: expected `type: text`, found {text!r}")
            body = [
                "@property",
                f"def {member}(self) -> {annotation(kind, argument=False)}:",
                *quoted(text),
                "    ...",
            ]
        else:
            static = isinstance(found, staticmethod)
            body = function(getattr(value, member), member, name, static)
        lines.extend(f"    {line}".rstrip() for line in body)
    return lines


def stubs() -> str:
    """The whole file."""
    out = [HEADER]
    for name, value in sorted(vars(_semfm).items()):
        if name.startswith("_"):
            continue
        lines = klass(value) if inspect.isclass(value) else function(value, name)
        out.append("\n".join(line.rstrip() for line in lines) + "\n")
    return "\n".join(out)


def main() -> int:
    """Writes or checks the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="fail where the file is not current")
    check = parser.parse_args().check
    text = stubs()
    if not check:
        OUTPUT.write_text(text, encoding="utf-8")
        print(OUTPUT)
        return 0
    if OUTPUT.read_text(encoding="utf-8") == text:
        return 0
    print(f"{OUTPUT} is not current: run python python/tools/stubs.py", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
