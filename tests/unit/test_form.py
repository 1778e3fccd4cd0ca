"""The form of the code that no linter checks: functions, modules, constructors, class names, sleeps."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path

import pytest

from support.reference import PROJECT

LONGEST_FUNCTION = 50
"""Lines, from ``def`` to the end."""
LONGEST_MODULE = 700
"""Lines; of a module of tests, which may show many cases of one thing, nothing is said."""
MOST_PARAMETERS = 6
"""Of a constructor that is written by hand, without ``self``."""
MAY_SLEEP = PROJECT / "tests/support/pausing.py"
LAST = 1_000_000
"""A line behind all others."""
MAY_CANCEL_AND_WAIT = PROJECT / "shared/src/nena_shared/tasks.py"

SOURCES = tuple(
    chain.from_iterable(PROJECT.glob(each) for each in ("shared/src", "services/*/src", "tools/*/src"))
)
TESTS = PROJECT / "tests"


def modules(*folders: Path) -> Iterator[Path]:
    return chain.from_iterable(sorted(each.rglob("*.py")) for each in folders)


def nodes(module: Path, holding: str) -> Iterator[ast.AST]:
    """Return the nodes of a module; none, at less cost, unless its text contains ``holding``."""
    text = module.read_text(encoding="utf-8")
    return ast.walk(ast.parse(text, module)) if holding in text else iter(())


@dataclass(frozen=True, slots=True)
class Definition:
    """A class or function: its first line, its number of lines, and its parameters."""

    name: str
    line: int
    lines: int
    is_class: bool
    parameters: int = 0


@cache
def definitions(module: Path) -> tuple[Definition, ...]:
    """Return all definitions of a module; cached, because several tests look at every module."""
    return tuple(_defined_in(ast.parse(module.read_text(encoding="utf-8"), module)))


def _defined_in(tree: ast.Module) -> Iterator[Definition]:
    """Visit statements only, which are a small part of all nodes."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, field, ())
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            given = None if isinstance(node, ast.ClassDef) else node.args
            parameters = len([*given.posonlyargs, *given.args, *given.kwonlyargs]) if given else 0
            yield Definition(node.name, node.lineno, lines, given is None, parameters)


def too_long(module: Path) -> Iterator[str]:
    for each in definitions(module):
        if not each.is_class and each.lines > LONGEST_FUNCTION:
            yield f"{module}:{each.line} {each.name} has {each.lines} lines"


def wide_constructors(module: Path) -> Iterator[str]:
    for each in definitions(module):
        if each.name == "__init__" and each.parameters - 1 > MOST_PARAMETERS:
            yield f"{module}:{each.line} takes {each.parameters - 1}"


def classes() -> dict[str, list[str]]:
    """Return the modules that define each class, by distribution and name."""
    found: dict[str, list[str]] = defaultdict(list)
    for folder in SOURCES:
        for module in modules(folder):
            for each in definitions(module):
                if each.is_class:
                    found[f"{folder.parent.name}: {each.name}"].append(module.name)
    return found


def sleeps(module: Path) -> Iterator[str]:
    for node in nodes(module, ".sleep"):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "sleep":
            yield f"{module}:{node.lineno}"


def waits_for_whom_it_cancels(module: Path) -> Iterator[str]:
    """Find functions that cancel a task and then wait for its end, by its name or with others."""
    for function in nodes(module, ".cancel"):
        if isinstance(function, ast.AsyncFunctionDef):
            cancelled = dict(cancels(function))
            for node in ast.walk(function):
                awaited = ast.unparse(node.value) if isinstance(node, ast.Await) else ""
                if awaited.startswith(("asyncio.gather(", "asyncio.wait(")):
                    since = min(cancelled.values(), default=LAST)
                else:
                    since = cancelled.get(awaited, LAST)
                if isinstance(node, ast.Await) and node.lineno > since:
                    yield f"{module}:{node.lineno} {function.name}"


def cancels(function: ast.AsyncFunctionDef) -> Iterator[tuple[str, int]]:
    """Yield what a function cancels, and in which line."""
    for node in ast.walk(function):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "cancel":
            yield ast.unparse(node.func.value), node.lineno


def test_there_is_something_to_look_at() -> None:
    assert len(SOURCES) >= 8
    assert MAY_SLEEP.exists()
    assert list(sleeps(MAY_SLEEP))
    assert list(waits_for_whom_it_cancels(MAY_CANCEL_AND_WAIT))


def test_functions_are_short() -> None:
    assert [each for module in modules(*SOURCES, TESTS) for each in too_long(module)] == []


def test_modules_are_short() -> None:
    lines = {
        module: len(module.read_text(encoding="utf-8").splitlines())
        for module in modules(*SOURCES, TESTS)
        if not module.name.startswith("test_")
    }
    assert {module: count for module, count in lines.items() if count >= LONGEST_MODULE} == {}


def test_constructors_take_few_parameters() -> None:
    assert [each for module in modules(*SOURCES) for each in wide_constructors(module)] == []


def test_a_class_name_stands_once_in_a_distribution() -> None:
    assert {name: places for name, places in classes().items() if len(places) > 1} == {}


def test_tests_wait_for_conditions_and_sleep_nowhere() -> None:
    found = [each for module in modules(TESTS) if module != MAY_SLEEP for each in sleeps(module)]
    assert found == [], "use support.waiting, or where time itself is what is tried support.pausing"


def test_who_waits_for_the_end_of_what_he_cancels_cancels_it_again() -> None:
    """Python 3.11 forgets some cancellations."""
    found = [
        each
        for module in modules(*SOURCES)
        if module != MAY_CANCEL_AND_WAIT
        for each in waits_for_whom_it_cancels(module)
    ]
    assert found == [], "use nena_shared.tasks.end"


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (("work.cancel()", "await work"), 1),
        (("self._work.cancel()", "await asyncio.gather(self._work, return_exceptions=True)"), 1),
        (("await asyncio.wait({work, other})", "work.cancel()"), 0),
        (("work.cancel()", "await other"), 0),
        (("await end(work)",), 0),
    ],
)
def test_who_cancels_only_once_and_waits_is_found(tmp_path: Path, body: tuple[str, ...], found: int) -> None:
    module = tmp_path / "module.py"
    module.write_text("async def f(self):\n" + "".join(f"    {line}\n" for line in body))
    assert len(list(waits_for_whom_it_cancels(module))) == found


@pytest.mark.parametrize(("lines", "found"), [(LONGEST_FUNCTION, 0), (LONGEST_FUNCTION + 1, 1)])
def test_a_function_of_one_line_too_many_is_found(tmp_path: Path, lines: int, found: int) -> None:
    module = tmp_path / "module.py"
    module.write_text("class A:\n    async def f(self):\n" + "        pass\n" * (lines - 1))
    assert len(list(too_long(module))) == found
