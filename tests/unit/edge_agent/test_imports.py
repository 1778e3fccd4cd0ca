"""What the edge agent imports: memory is spared."""

from __future__ import annotations

import subprocess
import sys

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
