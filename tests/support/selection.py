"""Deselection of tests: those marked ``long``, and those in tests/quarantine.toml.

``--long`` runs them too, and a test named on the command line (``path::test``) always runs. The report has
the number of deselected tests, and names those in quarantine with their reasons.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

QUARANTINE = Path("tests/quarantine.toml")
"""Path below pytest's root folder."""
LEFT_OUT = pytest.StashKey[Mapping[str, list[str]]]()
"""Deselected tests by reason: "long" or "quarantine"."""


def quarantine(root: Path) -> dict[str, str]:
    """Return the reason of each test in quarantine, by its id without parameters."""
    listed = tomllib.loads((root / QUARANTINE).read_text(encoding="utf-8")).get("test", [])
    return {each["id"]: each["reason"] for each in listed}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--long``."""
    parser.addoption("--long", action="store_true", help="run long tests and those in quarantine too")


def pytest_configure(config: pytest.Config) -> None:
    """Report the deselected tests, and try more examples where long tests run."""
    if config.getoption("--long"):
        settings.load_profile("long")
    config.pluginmanager.register(Summary())


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect tests that are long or in quarantine, unless the command line selects them."""
    left_out: dict[str, list[str]] = {"long": [], "quarantine": []}
    config.stash[LEFT_OUT] = left_out
    if config.getoption("--long"):
        return
    listed, named = quarantine(config.rootpath), {each for each in config.args if "::" in each}
    kept = []
    for item in items:
        if any(item.nodeid.startswith(each.removeprefix("./")) for each in named):
            kept.append(item)
        elif item.nodeid.partition("[")[0] in listed:
            left_out["quarantine"].append(item.nodeid)
        elif item.get_closest_marker("long"):
            left_out["long"].append(item.nodeid)
        else:
            kept.append(item)
    config.hook.pytest_deselected(items=list(set(items) - set(kept)))
    items[:] = kept


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Pass on the deselected tests of a worker."""
    output: dict[str, Any] | None = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["left_out"] = session.config.stash.get(LEFT_OUT, {})


class Summary:
    """The report's section about deselected tests, of this process or of the workers."""

    def __init__(self) -> None:
        self._of_workers: Mapping[str, list[str]] = {}

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Read what a worker has deselected; each has collected the same tests."""
        self._of_workers = getattr(node, "workeroutput", {}).get("left_out", self._of_workers)

    def pytest_terminal_summary(self, terminalreporter: Any, config: pytest.Config) -> None:
        """Print the section."""
        left_out = self._of_workers or config.stash.get(LEFT_OUT, {})
        for line in lines(left_out, quarantine(config.rootpath)):
            terminalreporter.write_line(line)


def lines(left_out: Mapping[str, list[str]], reasons: Mapping[str, str]) -> list[str]:
    """Return the report's lines about deselected tests."""
    long, listed = left_out.get("long", ()), left_out.get("quarantine", ())
    said = [f"left out: {len(long)} long tests, which `make test-all` runs"] if long else []
    return said + [f"in quarantine: {each}: {reasons[each.partition('[')[0]]}" for each in listed]
