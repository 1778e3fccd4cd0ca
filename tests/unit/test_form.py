"""The form of the code that no linter checks: class names, sleeps, cancelled tasks."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest

from support.reference import PROJECT

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


def class_names(module: Path) -> tuple[str, ...]:
    """Return the names of the classes of a module."""
    return tuple(node.name for node in nodes(module, "class ") if isinstance(node, ast.ClassDef))


def classes() -> dict[str, list[str]]:
    """Return the modules that define each class, by distribution and name."""
    found: dict[str, list[str]] = defaultdict(list)
    for folder in SOURCES:
        for module in modules(folder):
            for name in class_names(module):
                found[f"{folder.parent.name}: {name}"].append(module.name)
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
