"""The files that an encoder of one's own (``package.module:Class``) consists of, found without running it.

Its code is the module and whatever that imports outside the folders of installed packages; of a class in
an installed package it is the whole package. Of other packages the version counts. What the class reads
beside its code cannot be seen from here, so the class says it: its attribute ``files`` lists them, as
seen from the folder of its module.
"""

from __future__ import annotations

import ast
import contextlib
import importlib.machinery
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Optional


@contextlib.contextmanager
def working_folder_on_path() -> Iterator[None]:
    """Modules of the working folder can be imported, after all others."""
    folder = os.getcwd()
    sys.path.append(folder)
    try:
        yield
    finally:
        sys.path.remove(folder)


def class_files(model: str) -> tuple[dict[str, Path], Optional[str]]:
    """The files of ``package.module:Class`` by name, and what more may matter, in words."""
    module, _, name = model.partition(":")
    with working_folder_on_path():
        modules, unread = _modules(module)
    if not modules:
        return {}, f"the module {module} has no source file"
    files = {found.name: found.path for found in modules}
    if unread is not None:
        return files, f"the code of {unread} cannot be read"
    for found in modules:
        data = _declared_files(found.tree, name)
        if data is not None:
            folder = found.path.parent
            files.update({f"{found.name}: {file}": folder / file for file in data})
            return files, None
    return files, f"the class {name} does not list its `files`"


@dataclass(frozen=True)
class _Module:
    name: str
    path: Path
    #: None for a compiled module.
    tree: Optional[ast.Module]


def _modules(start: str) -> tuple[list[_Module], Optional[str]]:
    """A module and the user's own modules that it imports, and one whose code cannot be read."""
    found: dict[Path, _Module] = {}
    own = start.partition(".")[0]
    waiting = list(_find(start))[::-1]
    if any(_is_installed(path, name) for name, path in waiting):
        return _package_modules(waiting), None
    while waiting:
        name, path = waiting.pop()
        top = name.partition(".")[0]
        if path in found or top == "semfm" or (top != own and _is_installed(path, name)):
            continue
        tree = _parsed(path)
        if tree is None and path.suffix == ".py":
            return list(found.values()), str(path)
        found[path] = _Module(name, path, tree)
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        for imported in _imported(tree, package):
            waiting.extend(_find(imported))
    return list(found.values()), None


def _package_modules(chain: list[tuple[str, Path]]) -> list[_Module]:
    """All modules of an installed package; only the class's own, which `chain` begins with, is parsed."""
    name, path = chain[0]
    top = chain[-1][1]
    files = top.parent.rglob("*.py") if top.name == "__init__.py" else [top]
    others = [_Module(str(file.relative_to(top.parent)), file, None) for file in files]
    return [_Module(name, path, _parsed(path)), *others]


def _parsed(path: Path) -> Optional[ast.Module]:
    """The syntax tree of a module; None for a compiled one, and for one that is no Python."""
    try:
        return ast.parse(path.read_bytes()) if path.suffix == ".py" else None
    except (OSError, SyntaxError, ValueError):
        return None


def _is_installed(path: Path, name: str) -> bool:
    """Whether a module came with Python or with a package, whose version counts."""
    library = {Path(sysconfig.get_path(key)).resolve() for key in ("stdlib", "platstdlib")}
    above = path.resolve().parents
    if not library.isdisjoint(above):
        return True
    root = above[name.count(".") + (path.name == "__init__.py")]
    return root.name in ("site-packages", "dist-packages") or any(root.glob("*.dist-info"))


def _find(name: str) -> Iterator[tuple[str, Path]]:
    """Names and files of a module and of the packages that it is in; nothing is imported."""
    parts = name.split(".")
    try:
        spec = importlib.util.find_spec(parts[0])
    except (ImportError, ValueError):
        return
    if spec is None:
        return
    if spec.has_location and spec.origin:
        yield parts[0], Path(spec.origin)
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    for i, part in enumerate(parts[1:], 2):
        within = [folder / part for folder in folders]
        suffixes = (".py", *importlib.machinery.EXTENSION_SUFFIXES)
        files = [path.with_name(path.name + suffix) for path in within for suffix in suffixes]
        for path in (*(folder / "__init__.py" for folder in within), *files):
            if path.is_file():
                yield ".".join(parts[:i]), path
                break
        folders = [folder for folder in within if folder.is_dir()]


def _imported(tree: Optional[ast.Module], package: str) -> Iterator[str]:
    """The full names of what a module imports; a name may be that of a function."""
    for node in ast.walk(tree) if tree else ():
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = package.split(".")
                above = parts[: len(parts) - node.level + 1]
                base = ".".join([*above, base] if base else above)
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _declared_files(tree: Optional[ast.Module], name: str) -> Optional[list[str]]:
    """The attribute ``files`` of a class, where it is a plain list or tuple of texts."""
    for node in ast.walk(tree) if tree else ():
        if not (isinstance(node, ast.ClassDef) and node.name == name):
            continue
        for statement in node.body:
            targets: list[ast.expr] = []
            if isinstance(statement, ast.Assign):
                targets = statement.targets
            elif isinstance(statement, ast.AnnAssign):
                targets = [statement.target]
            if any(isinstance(target, ast.Name) and target.id == "files" for target in targets):
                return _texts(getattr(statement, "value", None))
    return None


def _texts(value: Optional[ast.expr]) -> Optional[list[str]]:
    try:
        found = ast.literal_eval(value) if value is not None else None
    except ValueError:
        return None
    is_list = isinstance(found, (list, tuple)) and all(isinstance(text, str) for text in found)
    return list(found) if is_list else None
