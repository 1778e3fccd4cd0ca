"""What the black box of the order service costs: microseconds of CPU for the life of an order.

``PYTHONPATH=tests python -m bench.decision_cost`` passes on the changes of an order with one destination
and of its vehicle. The order is deferred twice, and its vehicle waits twice for another one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from time import process_time

from nena_order_service.api.decisions import DecisionRecorder
from nena_order_service.fleet import outputs
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.settings import DISTRIBUTION
from nena_shared.black_box.box import BlackBox, Outgoing, Source
from nena_shared.black_box.folder import OutgoingFolder
from nena_shared.black_box.settings import RingSettings
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.topics import ORDER_SERVICE
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.vda5050.order import Node
from nena_shared.vda5050.topics import RobotKey, Topic
from support.fleet_examples import vehicle_status
from support.order_service import NOW, raw_order
from support.reference import PROJECT

ORDERS = 2000
ROUNDS = 5
ROBOT = RobotKey("NeNa", "V-1")
ROUTE = tuple(f"Point {number}" for number in range(20))
UPDATES = 6
"""Order updates with more of the route."""


def versions(number: int) -> Iterator[TransportOrder]:
    """Yield the versions of an order, as the engine commits them."""
    yield (order := raw_order("Storage:Unload cargo", number=number))
    yield (order := order.activated().dispatchable())
    yield (order := order.deferred("all vehicles are busy", NOW))
    yield (order := order.deferred("V-1 is charging", NOW))
    yield (order := order.assigned("V-1", [ROUTE], "it is the nearest one", NOW))
    yield (order := order.with_wait_reason("V-2 stands at Point 7"))
    yield (order := order.with_wait_reason(""))
    yield (order := order.operating(0, NOW))
    yield (order := order.drive_order_finished(0, NOW))
    yield order.finished(NOW)


def vehicles() -> list[VehicleStatus]:
    """Return the statuses of the vehicle, one for each point."""
    waits = TrafficWait(vehicles=("V-2",), at="Point 7", cause=WaitCause.STANDS, reason="V-2 stands there")
    waiting = {7: waits, 8: waits, 14: waits}
    return [
        vehicle_status(current_position=point, transport_order="T-1", wait=waiting.get(number))
        for number, point in enumerate(ROUTE)
    ]


def messages() -> list[outputs.PublishOrder]:
    """Return the VDA order and its updates."""
    made = []
    for update in range(UPDATES):
        base = 3 * (update + 1)
        nodes = tuple(
            Node(node_id=name, sequence_id=2 * number, released=number < base, actions=())
            for number, name in enumerate(ROUTE)
        )
        made.append(outputs.PublishOrder(ROBOT, VdaOrder(order_id="T-1-0", nodes=nodes, edges=()), update))
    return made


def measure() -> float:
    """Return the CPU time of the recorder for an order, s; the least of several rounds."""
    lives = [[each.status for each in versions(number)] for number in range(1, ORDERS + 1)]
    statuses, sent = vehicles(), messages()
    accepted, finished = outputs.VdaOrderAccepted(ROBOT, "T-1-0"), outputs.VdaOrderFinished(ROBOT, "T-1-0")
    found = []
    for _ in range(ROUNDS):
        outgoing = Outgoing(OutgoingFolder(PROJECT / "build" / "unused", keep=1, keep_bytes=1), None)
        clock = SystemClock()
        box = BlackBox(Source(ORDER_SERVICE, DISTRIBUTION), RingSettings(), outgoing, clock)
        recorder = DecisionRecorder(box, clock, lambda _: NotImplemented)
        began = process_time()
        for life in lives:
            for status in life:
                recorder.order_changed(status)
            for vehicle in statuses:
                recorder.vehicle_changed(vehicle)
            for message in sent:
                recorder.published(Topic.ORDER, message, 0.0)
            for event in (accepted, finished):
                recorder.happened(event, 0.0)
        found.append((process_time() - began) / ORDERS)
    return min(found)


if __name__ == "__main__":
    sys.stdout.write(f"{measure() * 1e6:.0f} us of CPU for each order\n")
