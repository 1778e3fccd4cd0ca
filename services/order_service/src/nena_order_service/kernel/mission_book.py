"""Which robot works for which order, and which mission it has."""

from __future__ import annotations

from collections.abc import Iterator

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.vehicle_book import VehicleBook
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import MissionRecord
from nena_shared.vda5050.topics import RobotKey


class MissionBook:
    """A robot works for one order at most, and has one mission at most: the order's, or one to make room.

    What has to be stored is noted in the books of orders and vehicles.
    """

    def __init__(self, orders: OrderBook, vehicles: VehicleBook) -> None:
        self._orders = orders
        self._vehicles = vehicles
        self._records: dict[RobotKey, MissionRecord] = {}
        self._by_mission: dict[str, RobotKey] = {}
        self._order_of: dict[RobotKey, int] = {}
        self._robot_of: dict[int, RobotKey] = {}

    def __iter__(self) -> Iterator[MissionRecord]:
        """Yield all missions."""
        return iter(tuple(self._records.values()))

    def assign(self, order: TransportOrder, robot: RobotKey) -> None:
        """Let a robot work for an order, from now on until :meth:`release`."""
        self._order_of[robot] = order.number
        self._robot_of[order.number] = robot

    def release(self, order: TransportOrder) -> RobotKey | None:
        """Let nobody work for an order any more; gives who did."""
        robot = self._robot_of.pop(order.number, None)
        if robot is None:
            return None
        del self._order_of[robot]
        record = self._records.get(robot)
        if record and not record.evasion:
            self._forget(record)
            self._orders.put_mission(order.number, None)
        return robot

    def load(self, record: MissionRecord) -> None:
        """Take in a mission that is in the store as it is; its order is assigned already."""
        self._records[record.robot] = record
        self._by_mission[record.mission.mission_id] = record.robot

    def put(self, record: MissionRecord) -> None:
        """Take in a new mission, or what is new about one."""
        self.load(record)
        if record.evasion:
            self._vehicles.change(record.robot, evasion=record)
        else:
            self._orders.put_mission(self._order_of[record.robot], record.document)

    def end(self, record: MissionRecord) -> None:
        """Let a mission be at its end; the robot goes on working for its order, if it has one."""
        self._forget(record)
        if record.evasion:
            self._vehicles.change(record.robot, evasion=None)
        else:
            self._orders.put_mission(self._order_of[record.robot], None)

    def find(self, mission_id: str) -> MissionRecord | None:
        """Give a mission by its id."""
        robot = self._by_mission.get(mission_id)
        return None if robot is None else self._records[robot]

    def of_robot(self, robot: RobotKey) -> MissionRecord | None:
        """Give the mission that a robot has."""
        return self._records.get(robot)

    def of_order(self, order: TransportOrder) -> MissionRecord | None:
        """Give the mission that an order's robot has for it."""
        robot = self._robot_of.get(order.number)
        record = None if robot is None else self._records.get(robot)
        return None if record is None or record.evasion else record

    def order_number(self, robot: RobotKey) -> int | None:
        """Give the number of the order that a robot works for."""
        return self._order_of.get(robot)

    def _forget(self, record: MissionRecord) -> None:
        del self._records[record.robot]
        del self._by_mission[record.mission.mission_id]
