"""Long tests and those in quarantine are left out, named, and run on demand."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tomllib
from datetime import date
from pathlib import Path

import pytest

from support.reference import PROJECT
from support.selection import QUARANTINE, lines
from support.waiting import PATIENCE

TESTS = """
import pytest

def test_short():
    pass

@pytest.mark.long
@pytest.mark.parametrize("n", [1, 2])
def test_long(n):
    pass

@pytest.mark.parametrize("n", [1, 2])
def test_shaky(n):
    assert False
"""
LISTED = """
[[test]]
id = "test_it.py::test_shaky"
reason = "fails at full moon"
since = 2026-11-23
"""


def run(folder: Path, *options: str) -> str:
    """Return what pytest prints over TESTS, with one of them in quarantine."""
    (folder / "test_it.py").write_text(TESTS)
    (folder / "conftest.py").write_text('pytest_plugins = ["support.selection"]')
    (folder / "tests").mkdir(exist_ok=True)
    (folder / QUARANTINE).write_text(LISTED)
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n    long: long\n")
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "xdist", *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(PROJECT / "tests"), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    ).stdout


def quarantined() -> list[dict[str, object]]:
    """Return the entries of tests/quarantine.toml."""
    return list(tomllib.loads((PROJECT / QUARANTINE).read_text(encoding="utf-8")).get("test", []))


@pytest.mark.parametrize("options", [(), ("-n", "2")], ids=["alone", "side by side"])
def test_long_ones_and_those_in_quarantine_are_left_out_and_named(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    printed = run(tmp_path, *options)

    assert "1 passed" in printed
    assert "failed" not in printed
    assert "left out: 2 long tests" in printed
    assert "in quarantine: test_it.py::test_shaky[1]: fails at full moon" in printed


@pytest.mark.parametrize("options", [("--long",), ("--long", "-n", "2")], ids=["alone", "side by side"])
def test_on_demand_all_run(tmp_path: Path, options: tuple[str, ...]) -> None:
    printed = run(tmp_path, *options)

    assert "2 failed, 3 passed" in printed
    assert "left out" not in printed


def test_what_the_command_line_names_runs(tmp_path: Path) -> None:
    assert "1 passed" in run(tmp_path, "test_it.py::test_long[1]")
    assert "2 failed" in run(tmp_path, "test_it.py::test_shaky")


def test_nothing_is_said_of_a_run_that_leaves_nothing_out() -> None:
    assert lines({}, {}) == []


def test_each_entry_of_the_quarantine_names_a_test_and_says_why_and_since_when() -> None:
    for each in quarantined():
        path, _, name = str(each["id"]).partition("::")
        module = ast.parse((PROJECT / path).read_text(encoding="utf-8"))
        found = {
            node.name for node in ast.walk(module) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        }
        assert name.rpartition("::")[2] in found, f"{each['id']} is no test"
        assert str(each["reason"]).strip()
        assert isinstance(each["since"], date)
