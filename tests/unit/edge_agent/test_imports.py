"""What the edge agent imports: the core is pure, there are no circles, and memory is spared."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import defaultdict
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import nena_edge_agent

PACKAGE = Path(nena_edge_agent.__file__).parent
FOLDERS = sorted(each.name for each in PACKAGE.iterdir() if (each / "__init__.py").exists())
ROS = ("rclpy", "_msgs", "_interfaces")
"""What the name of a package of ROS holds."""
PURE = {"driver": {"driver"}, "protocol": {"driver", "protocol"}}
"""The folders that know no ROS, and what of the agent they may import."""


SPARED = (
    "msgspec",  # not among the agent's dependencies
    "lxml",
    "opentelemetry",
    "prometheus_client",
    "tarfile",
    "nena_plant_formats.lif",
    "nena_shared.vda5050.v2_0",
    "nena_shared.vda5050.v3_0",
)
"""What a robot with Nav2 and VDA 5050 2.1 does not need: all of it took 6 MB of its memory."""


def test_the_program_imports_nothing_that_most_robots_do_not_need() -> None:
    program = (
        "import sys, nena_edge_agent.program, nena_edge_agent.nav2.driver\n"
        f"sys.stdout.write(' '.join(sys.modules.keys() & set({SPARED})))"
    )
    command = [sys.executable, "-c", program]
    assert subprocess.run(command, capture_output=True, text=True, check=True, timeout=90).stdout == ""


def test_models_of_messages_are_built_at_their_first_use() -> None:
    program = (
        "import contextlib, nena_edge_agent.__main__ as program\n"
        "with contextlib.suppress(SystemExit):\n"
        "    program.main(['--version'])\n"
        "from nena_shared.vda5050.v2_1.order import OrderV21 as order\n"
        "print(order.__pydantic_complete__, order.model_rebuild())"
    )
    command = [sys.executable, "-c", program]
    shown = subprocess.run(command, capture_output=True, text=True, check=True, timeout=90).stdout
    assert shown.endswith("\nFalse True\n")


def imported(module: Path) -> set[str]:
    """Return all modules that a module imports, also within functions and for type checkers."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
        elif isinstance(node, ast.Import):
            found |= {each.name for each in node.names}
    return found


def folders_of(folder: str) -> set[str]:
    """Return the folders, and the modules beside them, that a folder imports."""
    parts = [each.split(".") for module in (PACKAGE / folder).rglob("*.py") for each in imported(module)]
    return {part[1] for part in parts if part[0] == PACKAGE.name and len(part) > 1}


@pytest.mark.parametrize("folder", PURE)
def test_the_core_imports_neither_ros_nor_io(folder: str) -> None:
    assert folders_of(folder) <= PURE[folder]
    for module in (PACKAGE / folder).rglob("*.py"):
        tops = {each.split(".")[0] for each in imported(module)}
        assert [top for top in tops if any(word in top for word in ROS)] == [], module


def test_no_folders_import_each_other_in_a_circle() -> None:
    graph = defaultdict(set)
    for folder in FOLDERS:
        graph[folder] = (folders_of(folder) & set(FOLDERS)) - {folder}
    order = list(TopologicalSorter(graph).static_order())
    assert order.index("driver") < order.index("nav2") < order.index("actions")


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Beside imports within functions and for type checkers, which wait until they are needed."""
    graph: dict[str, set[str]] = {}
    names = {
        ".".join(("nena_edge_agent", *each.relative_to(PACKAGE).with_suffix("").parts)): each
        for each in PACKAGE.rglob("*.py")
        if each.name != "__init__.py"
    }
    for name, module in names.items():
        body = ast.parse(module.read_text(encoding="utf-8")).body
        found = {each for node in body if isinstance(node, ast.ImportFrom) for each in _names_in(node)}
        graph[name] = (found & names.keys()) - {name}
    TopologicalSorter(graph).prepare()


def _names_in(node: ast.ImportFrom) -> list[str]:
    module = node.module or ""
    return [module, *(f"{module}.{each.name}" for each in node.names)]
