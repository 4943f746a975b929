"""Random calls of everything that `semfm/_semfm.pyi` promises, with ordinary and hostile arguments.

    python random_calls.py SEED COUNT JOURNAL FOLDER

Each call is written to JOURNAL before it is made, so that whoever finds the process dead knows it.
An answer, a `SemfmError` (but no `InternalError`), a `TypeError`, a `ValueError` or an
`OverflowError` is right; the first other exception ends the run with exit code 1, a call that takes
too long with a traceback.
"""

from __future__ import annotations

import ast
import faulthandler
import os
import random
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Optional

import numpy as np
import semfm
from semfm import _semfm
from small_arm import write_arm

STUBS = Path(semfm.__file__).with_name("_semfm.pyi")
#: Runs other programs' code, or changes the process.
LEFT_OUT = {"run_cli", "write_file", "set_num_threads"}
#: Seconds that one call may take on a busy machine.
PATIENCE = 60.0
#: Objects of one class that are kept to be called again.
KEPT = 6


@dataclass
class Signature:
    """One function, constructor, method or property of the stubs."""

    owner: Optional[str]
    name: str
    #: "function", "static", "method" or "property".
    kind: str
    #: Name, annotation, whether it may be left out, whether it is given by keyword.
    parameters: list[tuple[str, str, bool, bool]] = field(default_factory=list)
    doc: str = ""

    def __str__(self) -> str:
        return f"{self.owner}.{self.name}" if self.owner else self.name


def signatures(text: str) -> list[Signature]:
    """Everything that can be called, in the order of the stubs."""
    found = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef) and node.name not in LEFT_OUT:
            found.append(_signature(None, node))
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            doc = ast.get_docstring(node) or ""
            for member in node.body:
                if isinstance(member, ast.FunctionDef):
                    signature = _signature(node.name, member)
                    signature.doc += doc if member.name == "__init__" else ""
                    found.append(signature)
    return found


def _signature(owner: Optional[str], node: ast.FunctionDef) -> Signature:
    decorators = {ast.unparse(decorator) for decorator in node.decorator_list}
    kind = "function" if owner is None else "method"
    kind = "static" if "staticmethod" in decorators else kind
    kind = "property" if "property" in decorators else kind
    arguments = node.args
    plain = arguments.args[1:] if kind in ("method", "property") else arguments.args
    n_required = len(plain) - len(arguments.defaults)
    parameters = [
        (each.arg, ast.unparse(each.annotation) if each.annotation else "Any", i >= n_required, False)
        for i, each in enumerate(plain)
    ]
    for each, default in zip(arguments.kwonlyargs, arguments.kw_defaults):
        annotation = ast.unparse(each.annotation) if each.annotation else "Any"
        parameters.append((each.arg, annotation, default is not None, True))
    return Signature(owner, node.name, kind, parameters, ast.get_docstring(node) or "")


class HasFaces:
    """Looks like a mesh of trimesh."""

    def __init__(self, vertices: Any, faces: Any) -> None:
        self.vertices, self.faces = vertices, faces


class Caller:
    """Makes arguments and calls."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.random = random.Random(seed)
        self.numbers = np.random.default_rng(seed)
        self.folder = folder
        self.pool: dict[str, list[Any]] = {}
        for value in ordinary_objects(folder):
            self.keep(value)

    def keep(self, value: Any) -> None:
        """Keeps an object of ours for later calls."""
        if isinstance(value, (list, tuple)):
            for each in value[:2]:
                self.keep(each)
        elif type(value).__module__ in ("semfm", "semfm._semfm"):
            kept = self.pool.setdefault(type(value).__name__, [])
            if len(kept) < KEPT:
                kept.append(value)
            else:
                kept[self.random.randrange(1, KEPT)] = value  # the first stays an ordinary one

    def chosen(self, *values: Any) -> Any:
        return self.random.choice(values)

    def argument(self, annotation: str, name: str, doc: str) -> Any:
        """A value for a parameter: of its type, mostly."""
        if self.random.random() < 0.08:
            return self.anything()
        annotation = annotation.strip().strip("'\"")
        inner = re.fullmatch(r"(\w+)\[(.*)\]", annotation, re.S)
        if inner is None:
            return self.plain(annotation, name, doc)
        outer, rest = inner.groups()
        parts = split(rest)
        if outer == "Optional":
            return None if self.random.random() < 0.3 else self.argument(rest, name, doc)
        if outer == "Union":
            return self.argument(self.random.choice(parts), name, doc)
        if outer in ("Iterable", "list"):
            return [self.argument(rest, name, doc) for _ in range(self.random.randrange(4))]
        if outer == "tuple":
            return tuple(self.argument(part, name, doc) for part in parts)
        if outer in ("Mapping", "dict"):
            keys = ("k_final", "step", "weight", "", "a\0b", 5)
            return {self.chosen(*keys): self.anything() for _ in range(self.random.randrange(3))}
        return self.plain(outer, name, doc)

    def plain(self, annotation: str, name: str, doc: str) -> Any:
        if annotation == "int":
            hostile = (-1, 2**31, 2**32, 2**63, 2**64, 2**70, -(2**63), True, 1.5, "3", np.int8(3))
            return self.chosen(0, 1, 2, 3, 5, 8, 12, 20, 50, self.chosen(*hostile))
        if annotation == "float":
            hostile = (float("nan"), float("inf"), -float("inf"), -1.0, 1e308, 1e-308, -0.0, "x", 2**70)
            return self.chosen(0.0, 0.1, 0.5, 1.0, 2, 1e-3, self.chosen(*hostile), self.chosen(*hostile))
        if annotation == "bool":
            return self.chosen(True, False, False, 2, "yes")
        if annotation == "str":
            known = re.findall(r"``[\"']([\w-]+)[\"']``|``(\w+)``", doc) or [("fused", "")]
            words = [first or second for first, second in known]
            return self.chosen(*words, *words, "", "magic", "a\0b", "é" * 50)
        if annotation == "bytes":
            return self.chosen(b"", b"\0", b"{}")
        if annotation == "ArrayLike":
            return self.array()
        if annotation == "_Path":
            return self.path()
        if annotation == "_MeshLike":
            return self.mesh()
        if annotation == "_Progress":
            return self.chosen(False, lambda *step: None)
        if annotation == "_Cache":
            return self.chosen(False, str(self.folder / "cache"))
        if annotation in self.pool:
            return self.random.choice(self.pool[annotation])
        return self.anything()

    def anything(self) -> Any:
        simple = (None, -1, 0, 3, 2**70, 0.5, float("nan"), "", "text", b"x", [], [1, 2], {}, object())
        makers: list[Callable[[], Any]] = [
            lambda: self.chosen(*simple),
            self.array,
            self.mesh,
            self.path,
            lambda: self.random.choice(self.random.choice(list(self.pool.values()))),
        ]
        return self.random.choice(makers)()

    def path(self) -> Any:
        names = ("new.json", "new.ply", "new.npz", "garbage.obj", "garbage.json", "empty.ply", "out")
        names += ("small.urdf",)
        name = self.chosen(*names, "no/such/folder/x.ply", "a\0b", "")
        return self.chosen(str(self.folder / name), self.folder / name, str(self.folder))

    def mesh(self) -> Any:
        if self.random.random() < 0.75:
            return self.random.choice(self.pool["Mesh"])
        looks = HasFaces(self.array(), self.array())
        return self.chosen(looks, HasFaces([[0, 0, 0]], []), self.path(), 5, None)

    def array(self) -> Any:
        """Arrays of lengths that fit the kept objects, and of every other kind."""
        meshes = self.pool["Mesh"]
        n = self.random.choice(meshes).n_vertices
        n = self.chosen(n, n, 0, 1, 3, 4, self.random.randrange(40))
        shape = self.chosen((n,), (n, 3), (n, 2), (n, n % 7), (3,), (4, 4), (3, 3), (), (2, 2, 2))
        numbers = self.numbers
        values: np.ndarray = numbers.normal(size=shape)
        how = self.random.randrange(16)
        if how == 0:
            values = values * 1e300
        elif how == 1:
            values = np.full(shape, self.chosen(np.nan, np.inf, -np.inf))
        elif how == 2:
            values = np.zeros(shape)
        elif how in (3, 4, 5):
            values = numbers.integers(0, max(n, 1), size=shape)
        elif how == 6:
            values = numbers.integers(-5, 2**62, size=shape)
        elif how == 7:
            values = values > 0
        elif how == 8:
            values = values.astype(self.chosen(np.float16, np.float32, np.complex128, object, "U3"))
        elif how == 9:
            values = np.abs(values) / 4
        elif how == 10:
            values = np.asfortranarray(values)
        elif how == 11:
            return values.tolist()
        elif how == 12:
            return self.chosen([[1, 2], [3]], [], [[]], "array", None, [None], [[0, 1, 2]])
        elif how == 13:
            return np.eye(4) * self.chosen(1.0, 1.0, 2.0, -1.0, np.nan)
        elif how == 14:
            return values[::-1] if values.ndim else values
        return values

    def call(self, signature: Signature) -> tuple[str, Callable[[], Any]]:
        """A call in words, and itself."""
        owner = getattr(_semfm, signature.owner) if signature.owner else _semfm
        positional, named = [], {}
        for name, annotation, is_optional, by_keyword in signature.parameters:
            if is_optional and self.random.random() < 0.5:
                if not by_keyword:
                    break
                continue
            value = self.argument(annotation, name, signature.doc)
            if by_keyword:
                named[name] = value
            else:
                positional.append(value)
        if signature.kind in ("function", "static"):
            words, target = str(signature), getattr(owner, signature.name)
        elif signature.name == "__init__":
            words, target = str(signature.owner), owner
        else:
            value = self.random.choice(self.pool[str(signature.owner)])
            words = f"{value!r}.{signature.name}"
            if signature.kind == "property":
                return words, lambda: getattr(value, signature.name)
            target = getattr(value, signature.name)
        given = [*map(short, positional), *(f"{name}={short(value)}" for name, value in named.items())]
        return f"{words}({', '.join(given)})", lambda: target(*positional, **named)


def split(text: str) -> list[str]:
    """The parts between the commas that stand in no bracket."""
    parts, depth, current = [], 0, ""
    for letter in text:
        depth += (letter == "[") - (letter == "]")
        if letter == "," and depth == 0:
            parts.append(current)
            current = ""
        else:
            current += letter
    return [*parts, current]


def short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}{value.ravel()[:4].tolist()}"
    return repr(value)[:120]


def ordinary_objects(folder: Path) -> list[Any]:
    """One small object of every class, and meshes that are hard."""
    mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=150) for i in (0, 1))
    features = [each.shared_features() for each in (mug, kettle)]
    source, target = (
        semfm.prepare(each.mesh, features=f, k=8, n_samples=60) for each, f in zip((mug, kettle), features)
    )
    matching = semfm.Matching(source, target, method="semfm")
    result = matching.transfer(mug.region)
    ball = semfm._semfm.icosphere(2)
    whole = semfm.Region(np.ones(ball.n_vertices))
    camera = semfm.rig(ball, count=1, size=24)[0]
    view = semfm.render(ball, [camera])[0]
    patches = semfm.PatchEmbeddings(np.ones((2, 2, 3)), [0, 0, 24, 24])
    embeddings = semfm.Embeddings(ball, [camera], [patches], encoder="mine")
    gripper = semfm.Gripper("franka")
    grasps = semfm.find_grasps(ball, whole, gripper, scale=0.03, n_samples=30, top=3)
    points = semfm.sample_uniform(mug.mesh, 200)[0] * 0.1 + np.array([0, 0, 1.0])
    alignment = semfm.align(mug.mesh, points, viewpoint=None, n_starts=4)
    robot = semfm.Robot.from_urdf(write_arm(folder))
    depth = np.full((24, 32), 1.0)
    depth[8:16, 8:24] = 0.5
    seen = semfm.Observation(
        [[30, 0, 15.5], [0, 30, 11.5], [0, 0, 1]], depth=depth, masks={"box": depth < 0.8}
    )
    tracker = semfm.Tracker(ball, scale=0.05, hypotheses=4)
    small = semfm.Mesh(0.05 * ball.vertices, ball.faces)
    hand = semfm.Hand(0.04 * ball.vertices + [0.08, 0, 0], ball.faces)
    shape, basis = source.shape, source.shape.basis
    triangle = semfm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    flat = semfm.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    twice = semfm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]] * 5)
    two = np.vstack([ball.vertices, ball.vertices + 5])
    apart = semfm.Mesh(two, np.vstack([ball.faces, ball.faces + ball.n_vertices]))
    huge = semfm.Mesh(ball.vertices * 1e29, ball.faces)
    tiny = semfm.Mesh(ball.vertices * 1e-150, ball.faces)
    alone = semfm.Mesh(np.vstack([triangle.vertices, [[9, 9, 9]]]), triangle.faces)
    return [
        ball, mug.mesh, triangle, flat, twice, apart,
        mug, source, matching, result, shape, basis, shape.laplacian, source.cloud, matching.anchors,
        semfm.Clusters([0, 1, 0]), matching.functional_map, result.point_map, mug.region, whole,
        result.hypotheses, semfm.TransferSettings("nearest"), camera, view, patches, embeddings,
        semfm.ViewsFile(ball, [view]), gripper, grasps, list(grasps), alignment, robot,
        semfm.SurfaceIndex(ball), semfm.HeatGeodesics(ball),
        seen, seen.surface(), tracker, tracker.update(seen), hand, semfm.find_contact(small, hand),
        huge, tiny, alone,
    ]  # fmt: skip


def main() -> int:
    seed, count, journal, folder = sys.argv[1:]
    folder = Path(folder)
    (folder / "garbage.obj").write_text("v 1 2\nf 1 2 3\nhello")
    (folder / "garbage.json").write_text('{"vertices": [1, -2, "x"]}')
    (folder / "empty.ply").write_text("")
    os.environ["SEMFM_CACHE"] = str(folder / "cache")
    caller = Caller(int(seed), folder)
    known = signatures(STUBS.read_text("utf-8"))
    needs_no_object = ("function", "static")
    known = [
        each
        for each in known
        if each.kind in needs_no_object or each.name == "__init__" or each.owner in caller.pool
    ]
    # Half of the stubs are properties, and most of them have nothing to go wrong.
    weights = [0.15 if each.kind == "property" else 1.0 for each in known]
    answered = 0
    with open(journal, "w", encoding="utf-8") as log:
        for i in range(int(count)):
            words, call = caller.call(caller.random.choices(known, weights)[0])
            log.write(f"{i} {words}\n")
            log.flush()
            faulthandler.dump_traceback_later(PATIENCE, exit=True)
            try:
                caller.keep(call())
                answered += 1
            except semfm.InternalError as error:
                log.write(f"FAILED: {type(error).__name__}: {error}\n")
                return 1
            except (semfm.SemfmError, TypeError, ValueError, OverflowError):
                pass
            except BaseException as error:  # a PanicException is no Exception
                log.write(f"FAILED: {type(error).__name__}: {error}\n")
                return 1
            finally:
                faulthandler.cancel_dump_traceback_later()
        log.write(f"{answered} answered\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
