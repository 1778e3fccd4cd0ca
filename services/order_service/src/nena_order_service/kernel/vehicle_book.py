"""What is stored of vehicles: how much they count, where they were at last, what they do without an order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.orders.vda_orders import MissionRecord
from nena_order_service.traffic.resources import ResourceSet
from nena_shared.fleet_api.vehicle import AcceptableOrderType, IntegrationLevel
from nena_shared.log import get_logger
from nena_shared.vda5050.malformed import problems_of
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)


class VehicleRecord(BaseModel):
    """One vehicle, so that a restart knows it before it says anything."""

    model_config = ConfigDict(frozen=True)

    manufacturer: str
    serial_number: str
    name: str = ""
    """What the vehicle was called at last; empty: nobody has noted it."""
    integration_level: IntegrationLevel = IntegrationLevel.TO_BE_UTILIZED
    acceptable_order_types: tuple[AcceptableOrderType, ...] | None = None
    """What hosts have said; None: what the plant model says holds."""
    held: tuple[ResourceSet, ...] = ()
    """What it held when it began what it does now, oldest first."""
    beside: tuple[ResourceSet, ...] | None = None
    """What it may be on besides, since it broke off its way or was moved; None: it did not."""
    evasion: MissionRecord | None = None
    """What it was sent to make room for others."""

    @property
    def robot(self) -> RobotKey:
        """Which robot it is."""
        return RobotKey(self.manufacturer, self.serial_number)


class VehicleBook:
    """Holds the records; notes in the order book what to store.

    ``name_of`` gives what the vehicle is called that a robot is.
    """

    def __init__(self, orders: OrderBook, name_of: Callable[[RobotKey], str]) -> None:
        self._orders = orders
        self._name_of = name_of
        self._records: dict[RobotKey, VehicleRecord] = {}
        self._names_before: dict[RobotKey, str] = {}
        """What vehicles were called before the restart, where that was noted."""

    def load(self, documents: Mapping[str, str]) -> None:
        """Take in what is in the store; a robot whose document cannot be read has to be heard first."""
        for robot, document in documents.items():
            try:
                record = VehicleRecord.model_validate_json(document)
            except ValidationError as error:
                log.warning(
                    "what is stored of a robot cannot be read", robot=robot, problems=problems_of(error)
                )
            else:
                self._records[record.robot] = record
                if record.name:
                    self._names_before[record.robot] = record.name

    def name_before(self, robot: RobotKey) -> str | None:
        """Give what a robot's vehicle was called before the restart; None: nobody has noted it."""
        return self._names_before.get(robot)

    def robot_before(self, name: str) -> RobotKey | None:
        """Give the robot that had this name before the restart; None: nobody has noted one."""
        return next((robot for robot, had in self._names_before.items() if had == name), None)

    def __iter__(self) -> Iterator[VehicleRecord]:
        """Yield all records."""
        return iter(tuple(self._records.values()))

    def of(self, robot: RobotKey) -> VehicleRecord:
        """Give the record of a robot; of one that is new, an empty one."""
        known = self._records.get(robot)
        return known or VehicleRecord(manufacturer=robot.manufacturer, serial_number=robot.serial_number)

    def change(self, robot: RobotKey, **changes: object) -> None:
        """Change fields of a robot's record."""
        before = self.of(robot)
        record = before.model_copy(update={"name": self._name_of(robot), **changes})
        if record != before:
            self._records[robot] = record
            self._orders.put_vehicle(str(robot), record.model_dump_json)
