"""The robot simulator as the Nav2 under test, with the replanning, slowing and recoveries of a real one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from nav2_acceptance.site import Course, SimulatedSite
from support.broker import Broker
from support.nav2_agent import Bench
from support.ros import RosPeer, own_domain_id
from support.smooth_drive import LIKE_NAV2, REGULATED, SPEED

COURSE = Course(
    start=(0.0, 0.0), end=(6.0, 0.0), beside=(3.0, 1.5), outside=(-60.0, 0.0), obstacle=(3.0, 4.0)
)

PATIENT_TREE = ("--server_timeout", "0.2")
"""Time for which bt_navigator waits for its servers, as docs/nav2.md recommends for a busy computer."""
RESPAWN = 8.0
"""Time within which the simulator's lifecycle managers bring up what has returned in time, seconds."""


@contextmanager
def simulated_site(
    *, time_factor: float = 1.0, mqtt_port: int | None = None, domain_id: int | None = None, **robot: Any
) -> Iterator[SimulatedSite]:
    """Run the simulator and yield what the suite needs of it; ``robot`` has fields of its settings.

    Without a port or a domain, a free one is used.
    """
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        if domain_id is None:
            domain_id = stack.enter_context(own_domain_id())
        peer = stack.enter_context(RosPeer(domain_id))
        broker = Broker(port=mqtt_port)
        bench = Bench(broker, "nav2", ros=peer, domain_id=domain_id, folder=Path(folder))
        try:
            with (
                bench.mqtt,
                bench.simulator(*LIKE_NAV2, *PATIENT_TREE, time_factor=time_factor, drive=REGULATED, **robot),
            ):
                bench.fault("stuck", active=False)
                yield SimulatedSite(bench, COURSE, speed=SPEED, respawn=RESPAWN)
        finally:
            broker.close()
