from __future__ import annotations

from datetime import timedelta

from nena_shared.fleet_api.service_status import LOST_AFTER, ServiceStatus
from nena_status_aggregator.fleet.order_service import OrderServiceWatch
from nena_status_aggregator.fleet.robot import Timestamp
from support.clocks import ManualClock


class Bench:
    """A watch and its clock."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.watch = OrderServiceWatch()

    def receive(self, *, online: bool, ahead: float = 0.0, retained: bool = False) -> None:
        sent = self.clock.now() + timedelta(seconds=ahead)
        status = ServiceStatus(online=online, timestamp=sent, store_ready=online)
        self.watch.apply_status(status, Timestamp.of(self.clock), retained=retained)

    def up(self) -> bool | None:
        return self.watch.is_up(Timestamp.of(self.clock))


def test_unknown_without_a_status() -> None:
    bench = Bench()
    assert (bench.up(), bench.watch.store_ready, bench.watch.skew.seconds) == (None, None, None)


def test_it_is_up_while_it_sends_heartbeats() -> None:
    bench = Bench()
    bench.receive(online=True)
    bench.clock.advance(LOST_AFTER - 0.1)
    assert bench.up() is True
    bench.clock.advance(0.2)
    assert bench.up() is False
    bench.receive(online=True)
    assert bench.up() is True


def test_last_will_takes_effect_immediately() -> None:
    bench = Bench()
    bench.receive(online=True)
    bench.receive(online=False)
    assert bench.up() is False
    assert bench.watch.store_ready is False


def test_unknown_without_the_broker() -> None:
    bench = Bench()
    bench.receive(online=True, ahead=3.0)
    bench.watch.forget_status()
    assert (bench.up(), bench.watch.store_ready, bench.watch.skew.seconds) == (None, None, None)


def test_its_clock_is_measured_by_new_heartbeats() -> None:
    bench = Bench()
    bench.receive(online=True, ahead=-600.0, retained=True)
    bench.receive(online=False, ahead=-600.0)
    assert bench.watch.skew.seconds is None
    bench.receive(online=True, ahead=3.0)
    assert bench.watch.skew.seconds == 3.0
