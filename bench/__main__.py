"""Measures the programs from the outside, beside yardsticks and an older version; see docs/benchmarks.md.

``python -m bench --beside ../nena-before --rounds 3 --entries orders states``
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import Any

import psutil

from bench.agent import measure_agent
from bench.fleet import measure_fleet
from bench.orders import measure_orders, measure_states
from bench.programs import Figures, Version
from bench.traffic import measure_traffic

ENTRIES: dict[str, Callable[[Version], Figures]] = {
    "orders": measure_orders,
    "states": measure_states,
    "agent": measure_agent,
    "fleet": measure_fleet,
    "traffic": measure_traffic,
}
HERE = Path(__file__).parents[1]


def main() -> None:
    """Measure each entry in each version, alternately, and print the medians."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--entries", nargs="*", default=list(ENTRIES), choices=ENTRIES, metavar="ENTRY")
    parser.add_argument("--beside", type=Path, help="another checkout, set up by `make setup`")
    parser.add_argument("--rounds", type=int, default=1, help="how often each entry is measured")
    parser.add_argument("--output", type=Path, default=Path("bench.json"))
    arguments = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    versions = [Version("here", HERE)]
    if arguments.beside:
        versions.insert(0, Version("beside", arguments.beside.resolve()))
    report: dict[str, Any] = {
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": f"{platform.machine()}, {psutil.cpu_count()} cores, Python {platform.python_version()}",
        "load": [os.getloadavg()[0]],
        "entries": {},
    }
    for entry in arguments.entries:
        runs: dict[str, list[Figures]] = {version.name: [] for version in versions}
        for _ in range(arguments.rounds):
            for version in versions:
                runs[version.name].append(ENTRIES[entry](version))
                report["load"].append(os.getloadavg()[0])
        report["entries"][entry] = runs
        sys.stdout.write(table(entry, runs))
        sys.stdout.flush()
        arguments.output.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


def table(entry: str, runs: dict[str, list[Figures]]) -> str:
    """Return the medians of an entry; with two versions, the ratio of this one to the one beside it."""
    medians = {
        version: {name: median(run[name] for run in measured) for name in measured[0]}
        for version, measured in runs.items()
    }
    lines = [f"{entry:<42}" + "".join(f"{version:>12}" for version in medians)]
    for name, value in medians["here"].items():
        cells = "".join(f"{figures.get(name, float('nan')):>12.2f}" for figures in medians.values())
        if beside := medians.get("beside", {}).get(name):
            cells += f"{value / beside:>9.2f} x"
        lines.append(f"  {name:<40}{cells}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
