"""NeNa's own MQTT topics: the order service's API for hosts, and robot data that VDA 5050 does not cover."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final
from urllib.parse import unquote

from nena_shared.vda5050.topics import RobotKey

ORDER_SERVICE: Final = RobotKey("nena", "order-service")
"""Under this key, the order service sends its recordings as robots do."""


class PeripheralTopic(StrEnum):
    """Topics of a peripheral device."""

    JOB = "job"
    """:class:`DeviceRequest`, from the order service."""
    CANCEL = "cancel"
    """:class:`DeviceCancellation`, from the order service."""
    JOB_STATE = "jobState"
    """:class:`DeviceAnswer`, from the device."""
    STATE = "state"
    """:class:`DeviceReport`, from the device, retained."""
    STATUS = "status"
    """:class:`PeripheralStatus`, from the order service for hosts, retained."""


def _level(name: str) -> str:
    for sign in "%/+#":
        name = name.replace(sign, f"%{ord(sign):02X}")
    return name


@dataclass(frozen=True, slots=True)
class FleetTopics:
    """Topics below one prefix, e.g. ``nena/v1``; each fleet has its own prefix."""

    prefix: str = "nena/v1"

    @property
    def creation_requests(self) -> str:
        """Topic filter of requests to create transport orders."""
        return f"{self.prefix}/hosts/+/transportOrders/create"

    def creation_request(self, host: str) -> str:
        """Return the topic on which ``host`` publishes a :class:`TransportOrderRequest`."""
        return f"{self.prefix}/hosts/{host}/transportOrders/create"

    def creation_answer(self, host: str) -> str:
        """Return the topic on which ``host`` receives its :class:`CreationAnswer`."""
        return f"{self.prefix}/hosts/{host}/transportOrders/answer"

    @property
    def commands(self) -> str:
        """Topic filter of all other commands."""
        return self.command("+", "+")

    def command(self, host: str, name: str) -> str:
        """Return the topic on which ``host`` publishes the command ``name``."""
        return f"{self.prefix}/hosts/{host}/commands/{name}"

    def command_answer(self, host: str, name: str) -> str:
        """Return the topic on which ``host`` receives the answer to the command ``name``."""
        return f"{self.command(host, name)}/answer"

    def host_of(self, topic: str) -> str:
        """Return the host of a request's ``topic``."""
        return topic.removeprefix(f"{self.prefix}/hosts/").split("/", 1)[0]

    def order_status(self, name: str) -> str:
        """Return the topic of an order's :class:`TransportOrderStatus`.

        Retained until ``end_kept`` after the final status; then cleared by an empty message.
        """
        return f"{self.prefix}/transportOrders/{name}/status"

    def vehicle_status(self, serial_number: str) -> str:
        """Return the topic of a vehicle's :class:`VehicleStatus`, retained."""
        return f"{self.prefix}/vehicles/{serial_number}/status"

    def sequence_status(self, name: str) -> str:
        """Return the topic of an order sequence's :class:`OrderSequenceStatus`.

        Retained until the sequence is finished; then cleared by an empty message.
        """
        return f"{self.prefix}/orderSequences/{name}/status"

    @property
    def all_sequence_statuses(self) -> str:
        """Topic filter of all order sequences' statuses."""
        return self.sequence_status("+")

    @property
    def all_order_statuses(self) -> str:
        """Topic filter of all orders' statuses."""
        return self.order_status("+")

    @property
    def all_vehicle_statuses(self) -> str:
        """Topic filter of all vehicles' statuses."""
        return self.vehicle_status("+")

    @property
    def service_status(self) -> str:
        """Topic of the order service's heartbeats and last will, as :class:`ServiceStatus`, retained."""
        return f"{self.prefix}/orderService/status"

    @property
    def plant_model(self) -> str:
        """Topic of the plant model, as JSON, retained."""
        return f"{self.prefix}/plantModel"

    def peripheral(self, location: str, topic: PeripheralTopic) -> str:
        """Return a topic of a location's peripheral device.

        In the location's name, ``%``, ``/``, ``+`` and ``#`` are percent-encoded.
        """
        return f"{self.prefix}/peripherals/{_level(location)}/{topic}"

    def all_peripherals(self, topic: PeripheralTopic) -> str:
        """Return the topic filter of all devices."""
        return f"{self.prefix}/peripherals/+/{topic}"

    def location_of(self, topic: str) -> str:
        """Return the location of a device's ``topic``."""
        return unquote(topic.split("/")[-2])

    def robot_map(self, robot: RobotKey) -> str:
        """Return the topic of a robot's own map, as :class:`MapImage`, retained; not part of VDA 5050."""
        return f"{self.prefix}/robots/{robot}/map"

    @property
    def all_robot_maps(self) -> str:
        """Topic filter of all robots' maps."""
        return self.robot_map(RobotKey("+", "+"))

    def recording_chunks(self, robot: RobotKey) -> str:
        """Return the topic of a robot's recordings, as :class:`Chunk`; not part of VDA 5050.

        Those of the order service have the key :data:`ORDER_SERVICE`.
        """
        return f"{self.prefix}/robots/{robot}/recordings/chunk"

    def recording_answers(self, robot: RobotKey) -> str:
        """Return the topic on which a robot receives the :class:`Answer` to each chunk."""
        return f"{self.prefix}/robots/{robot}/recordings/answer"

    @property
    def all_recording_chunks(self) -> str:
        """Topic filter of all robots' recordings."""
        return self.recording_chunks(RobotKey("+", "+"))

    def robot_of_chunk(self, topic: str) -> RobotKey | None:
        """Return the robot of a recording's ``topic``; None for any other topic."""
        robot = RobotKey(*levels) if len(levels := topic.split("/")[-4:-2]) == len(RobotKey._fields) else None
        return robot if robot is not None and topic == self.recording_chunks(robot) else None

    def robot_of_map(self, topic: str) -> RobotKey | None:
        """Return the robot of a map's ``topic``; None for any other topic."""
        robot = RobotKey(*levels) if len(levels := topic.split("/")[-3:-1]) == len(RobotKey._fields) else None
        return robot if robot is not None and topic == self.robot_map(robot) else None
