"""(l): cost and leftovers of 200 starts and stops of the ROS session, beside as many bare rclpy nodes.

Run in a separate process, ``bench.sessions DOMAIN_ID CYCLES``, it is the yardstick.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from nena_edge_agent.nav2.session_control import prepare_environment

CYCLES = 200
WARM_UP = 10
MOST_MEMORY = 5.0
"""MB that so many may cost."""


async def measure(_folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """Measure both, beside a simulated robot in the same domain."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    from support.ros import own_domain_id  # noqa: PLC0415 - sets up ROS for the whole process
    from support.session_cycles import measured  # noqa: PLC0415
    from support.simulator import simulated_robot  # noqa: PLC0415

    with own_domain_id() as domain_id, simulated_robot(domain_id):
        ours = await asyncio.to_thread(measured, domain_id, CYCLES)
        bare = await asyncio.to_thread(measured, domain_id, CYCLES, "bench.sessions")
    return {
        "l_sessions": {
            **ours,
            "memory": {"target": MOST_MEMORY, "met": ours["memory_more_mb"] <= MOST_MEMORY},
            "bare": bare,
        }
    }


def main() -> None:
    """Start and stop bare nodes, and print what is left."""
    prepare_environment()
    import rclpy  # noqa: PLC0415 - reads the environment as it is loaded
    from rclpy.context import Context  # noqa: PLC0415

    from support.session_cycles import Left  # noqa: PLC0415

    def cycle(domain_id: int, cycles: int) -> None:
        for _ in range(cycles):
            context = Context()
            rclpy.init(context=context, domain_id=domain_id)
            rclpy.create_node("bench_bare", context=context).destroy_node()
            context.try_shutdown()

    domain_id, cycles = map(int, sys.argv[1:])
    cycle(domain_id, WARM_UP)
    before, began = Left.now(), time.perf_counter()
    cycle(domain_id, cycles)
    seconds = time.perf_counter() - began
    sys.stdout.write(json.dumps(Left.now().more_than(before, cycles, seconds)))


if __name__ == "__main__":
    main()
