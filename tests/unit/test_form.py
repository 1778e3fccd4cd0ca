"""What no linter checks: who waits for the end of a task that it cancels uses ``tasks.end``."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from support.reference import PROJECT

MAY_CANCEL_AND_WAIT = PROJECT / "shared/src/nena_shared/tasks.py"
MODULES = tuple(chain.from_iterable(PROJECT.glob(each) for each in ("shared/src/**/*.py", "*/*/src/**/*.py")))


def waits_for_cancelled_tasks(module: Path) -> Iterator[str]:
    """Find functions that cancel a task and then wait for its end, by its name or with others."""
    for function in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(function, ast.AsyncFunctionDef):
            cancelled = {
                ast.unparse(node.func.value): node.lineno
                for node in ast.walk(function)
                if isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr == "cancel"
            }
            for node in ast.walk(function):
                awaited = ast.unparse(node.value) if isinstance(node, ast.Await) else ""
                together = awaited.startswith(("asyncio.gather(", "asyncio.wait("))
                since = min(cancelled.values(), default=None) if together else cancelled.get(awaited)
                if isinstance(node, ast.Await) and since is not None and node.lineno > since:
                    yield f"{module}:{node.lineno} {function.name}"


def test_a_cancelled_task_is_cancelled_again_until_it_has_ended() -> None:
    """Python 3.11 forgets some cancellations."""
    assert list(waits_for_cancelled_tasks(MAY_CANCEL_AND_WAIT)), "the search finds what it is to find"
    suspects = [module for module in MODULES if module != MAY_CANCEL_AND_WAIT]
    assert [each for module in suspects for each in waits_for_cancelled_tasks(module)] == []
