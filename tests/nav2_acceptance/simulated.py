"""The robot simulator as the Nav2 under test, with the replanning, slowing and recoveries of a real one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
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


@contextmanager
def simulated_site(*, time_factor: float = 1.0, **robot: Any) -> Iterator[SimulatedSite]:
    """Run the simulator and yield what the suite needs of it; ``robot`` has fields of its settings."""
    with tempfile.TemporaryDirectory() as folder, own_domain_id() as domain_id, RosPeer(domain_id) as peer:
        broker = Broker()
        bench = Bench(broker, "nav2", ros=peer, domain_id=domain_id, folder=Path(folder))
        try:
            with bench.mqtt, bench.simulator(*LIKE_NAV2, time_factor=time_factor, drive=REGULATED, **robot):
                bench.fault("stuck", active=False)
                yield SimulatedSite(bench, COURSE, speed=SPEED)
        finally:
            broker.close()
