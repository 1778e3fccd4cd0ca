"""Which robot has which mission for which order; at most one each way."""

from __future__ import annotations

from nena_order_service.kernel.mission_record import MissionRecord
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.vda5050.topics import RobotKey


class MissionBook:
    """Finds the missions under way by robot, mission and order; notes in the order book what to store."""

    def __init__(self, orders: OrderBook) -> None:
        self._orders = orders
        self._records: dict[int, MissionRecord] = {}
        self._by_mission: dict[str, int] = {}
        self._by_robot: dict[RobotKey, int] = {}

    def load(self, order: TransportOrder, record: MissionRecord) -> None:
        """Take in a mission that is in the store as it is."""
        self._records[order.number] = record
        self._by_mission[record.mission.mission_id] = order.number
        self._by_robot[record.robot] = order.number

    def put(self, order: TransportOrder, record: MissionRecord) -> None:
        """Take in a new mission, or what is new about one."""
        self.load(order, record)
        self._orders.put_mission(order, record.document())

    def forget(self, order: TransportOrder) -> None:
        """Let the mission of an order be at its end; without one nothing happens."""
        record = self._records.pop(order.number, None)
        if record:
            del self._by_mission[record.mission.mission_id]
            del self._by_robot[record.robot]
            self._orders.put_mission(order, None)

    def of_order(self, order: TransportOrder) -> MissionRecord | None:
        """Give the mission of an order."""
        return self._records.get(order.number)

    def find(self, mission_id: str) -> tuple[TransportOrder, MissionRecord] | None:
        """Give the order that a mission is for, and what is known of the mission."""
        number = self._by_mission.get(mission_id)
        return None if number is None else (self._orders.get(number), self._records[number])

    def order_number(self, robot: RobotKey) -> int | None:
        """Give the number of the order that a robot works on."""
        return self._by_robot.get(robot)
