"""Docstrings run, stubs are current, type checkers are content with the examples."""

from __future__ import annotations

import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import semfm
import semfm.zoo
from semfm import _semfm

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def documented():
    """Every public name of the compiled module with its docstring."""
    for name, value in sorted(vars(_semfm).items()):
        if name.startswith("_"):
            continue
        yield name, inspect.getdoc(value) or ""
        if inspect.isclass(value):
            for member in sorted(vars(value)):
                if not member.startswith("_"):
                    found = getattr(value, member)
                    yield f"{name}.{member}", inspect.getdoc(found) or ""


DOCS = dict(documented())


def test_everything_public_is_documented_and_exported():
    assert [name for name, doc in DOCS.items() if not doc.strip()] == []
    exported = {name for name in DOCS if "." not in name}
    files = {"run_cli", "write_file", "read_file", "check_output", "printable"}
    inner = files | {"icosphere", "torus"}
    assert exported - inner == {name for name in semfm.__all__ if name in exported}
    assert set(semfm.zoo.__all__) == inner - files
    assert all(hasattr(semfm, name) for name in semfm.__all__)


@pytest.mark.parametrize("name", [name for name, doc in DOCS.items() if ">>>" in doc])
def test_examples_of_docstrings_run(name):
    test = doctest.DocTestParser().get_doctest(DOCS[name], {}, name, None, None)
    output: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE, verbose=False)
    failed, attempted = runner.run(test, out=output.append)
    assert attempted > 0 and failed == 0, "".join(output)


def test_the_stubs_are_those_of_the_compiled_module():
    if not (ROOT / "tools/stubs.py").exists():
        pytest.skip("the package's sources are not here")
    check = [sys.executable, str(ROOT / "tools/stubs.py"), "--check"]
    run = subprocess.run(check, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def test_there_are_examples():
    assert EXAMPLES


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(path, tmp_path):
    run = subprocess.run(
        [sys.executable, str(path)], capture_output=True, text=True, cwd=tmp_path, timeout=300
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip()


@pytest.mark.parametrize("checker", ["mypy", "pyright"])
def test_type_checkers_are_content_with_the_examples(checker, tmp_path):
    pytest.importorskip(checker)
    options = {
        "mypy": ["--strict", "--config-file", "", "--cache-dir", str(tmp_path)],
        "pyright": ["--pythonpath", sys.executable],
    }
    command = [sys.executable, "-m", checker, *options[checker], *map(str, EXAMPLES)]
    # Away from the sources, so that the installed package is what is checked.
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
