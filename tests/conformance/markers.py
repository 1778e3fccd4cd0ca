"""Which tests verify which clause, by their markers; read from their sources, so that none has to run."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

TESTS: Final = Path(__file__).parents[1]
_MARKER: Final = "pytest.mark.clause"
_TestNode = ast.FunctionDef | ast.AsyncFunctionDef


class Shown(NamedTuple):
    """A test, and a clause that it shows."""

    clause: str
    file: str
    """Relative to the folder of the tests."""
    test: str


class MarkerError(Exception):
    """A marker cannot be read; the message says which and why."""


def shown_by_tests(folder: Path = TESTS) -> tuple[Shown, ...]:
    """Return the content of each marker, sorted by file and test.

    Raises:
        MarkerError: a marker's clauses are not string literals.
    """
    return tuple(
        Shown(clause, path.relative_to(folder).as_posix(), test)
        for path in sorted(folder.rglob("test_*.py"))
        if "mark.clause" in (source := path.read_text())
        for test, clauses in _tests_in(ast.parse(source, str(path)), path)
        for clause in clauses
    )


def _tests_in(scope: ast.Module | ast.ClassDef, path: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield each test of a module or class with its clauses, those of its scope first."""
    around = [clause for node in scope.body if _is_own_mark(node) for clause in _clauses(node, path)]
    for node in scope.body:
        if isinstance(node, ast.ClassDef):
            outer = around + [clause for each in node.decorator_list for clause in _clauses(each, path)]
            yield from ((test, outer + clauses) for test, clauses in _tests_in(node, path))
        elif isinstance(node, _TestNode) and node.name.startswith("test_"):
            own = [clause for each in node.decorator_list for clause in _clauses(each, path)]
            yield node.name, list(dict.fromkeys(around + own))
        elif (name := _case(node)) is not None:
            yield name, around


def _is_own_mark(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and any(ast.unparse(each) == "pytestmark" for each in node.targets)


def _case(node: ast.stmt) -> str | None:
    """Return the name of a state machine used as a test, as in ``TestX = X.TestCase``."""
    if (
        isinstance(node, ast.Assign)
        and isinstance(node.value, ast.Attribute)
        and node.value.attr == "TestCase"
    ):
        return ast.unparse(node.targets[0])
    return None


def _clauses(node: ast.AST, path: Path) -> Iterator[str]:
    """Yield the clauses of every marker within ``node``, including those of single parameters of a test."""
    for call in ast.walk(node):
        if isinstance(call, ast.Call) and ast.unparse(call.func) == _MARKER:
            for argument in call.args:
                if not isinstance(argument, ast.Constant) or not isinstance(argument.value, str):
                    message = f"{path}:{call.lineno}: name the clauses of a marker by text, one by one"
                    raise MarkerError(message)
                yield argument.value
