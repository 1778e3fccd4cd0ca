"""NeNa's own MQTT topics: the order service's API for hosts, and robot data that VDA 5050 does not cover."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Final
from urllib.parse import quote, unquote

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


ENCODED: Final = frozenset("%/+#.*> ")
"""Characters that are encoded in a level, besides invisible ones and a leading ``$``.

MQTT excludes ``/``, ``+`` and ``#`` (3.1.1 section 4.7). NATS ends the connection at ``.`` and a space,
RabbitMQ delivers ``.`` as ``/`` and ``*`` as ``+``, ``>`` is a wildcard of NATS, and Mosquitto ends the
connection at control characters.
"""


@lru_cache(maxsize=10_000)
def level_of(name: str) -> str:
    """Return a name as a topic level that every broker accepts; :func:`unquote` returns the name."""
    if name.startswith("$"):
        # MQTT 3.1.1, 4.7.2: topics with a leading $ belong to the broker
        return f"%24{level_of(name[1:])}"
    return "".join(
        f"%{ord(sign):02X}" if sign in ENCODED else sign if sign.isprintable() else quote(sign, safe="")
        for sign in name
    )


def suits_all_brokers(names: Iterable[str]) -> bool:
    """Return whether every broker accepts these names as topic levels as they are."""
    return all(level_of(name) == name for name in names)


@dataclass(frozen=True, slots=True)
class FleetTopics:
    """Topics below one prefix, e.g. ``nena/v1``; each fleet has its own prefix.

    Names are encoded by :func:`level_of`, except that of a host, which is answered below its own level.
    """

    prefix: str = "nena/v1"

    @property
    def creation_requests(self) -> str:
        """Topic filter of requests to create transport orders."""
        # apart from the other commands, so that a broker's access list can allow hosts only this one
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
        return f"{self.prefix}/transportOrders/{level_of(name)}/status"

    def vehicle_status(self, serial_number: str) -> str:
        """Return the topic of a vehicle's :class:`VehicleStatus`, retained."""
        return f"{self.prefix}/vehicles/{level_of(serial_number)}/status"

    def sequence_status(self, name: str) -> str:
        """Return the topic of an order sequence's :class:`OrderSequenceStatus`.

        Retained until the sequence is finished; then cleared by an empty message.
        """
        return f"{self.prefix}/orderSequences/{level_of(name)}/status"

    @property
    def all_sequence_statuses(self) -> str:
        """Topic filter of all order sequences' statuses."""
        return f"{self.prefix}/orderSequences/+/status"

    @property
    def all_order_statuses(self) -> str:
        """Topic filter of all orders' statuses."""
        return f"{self.prefix}/transportOrders/+/status"

    @property
    def all_vehicle_statuses(self) -> str:
        """Topic filter of all vehicles' statuses."""
        return f"{self.prefix}/vehicles/+/status"

    @property
    def service_status(self) -> str:
        """Topic of the order service's heartbeats and last will, as :class:`ServiceStatus`, retained."""
        return f"{self.prefix}/orderService/status"

    @property
    def direct_stops(self) -> str:
        """Topic filter of stops without the order service."""
        return self.direct_stop("+")

    def direct_stop(self, name: str) -> str:
        """Return the topic of a :class:`DirectStop`, retained until the order service has taken it over."""
        return f"{self.prefix}/directStops/{name}"

    def acknowledgements(self, share: str) -> str:
        """Return the topic of the acknowledgements by matter of the aggregator of a share, retained."""
        return f"{self.prefix}/acknowledgements/{level_of(share)}"

    @property
    def plant_model(self) -> str:
        """Topic of the plant model, as JSON, retained."""
        return f"{self.prefix}/plantModel"

    def peripheral(self, location: str, topic: PeripheralTopic) -> str:
        """Return a topic of a location's peripheral device."""
        return f"{self.prefix}/peripherals/{level_of(location)}/{topic}"

    def all_peripherals(self, topic: PeripheralTopic) -> str:
        """Return the topic filter of all devices."""
        return f"{self.prefix}/peripherals/+/{topic}"

    def name_in(self, topic: str) -> str:
        """Return the name of the order, sequence or location, or the serial number, in its ``topic``."""
        return unquote(topic.split("/")[-2])

    def name_below(self, topic: str) -> str:
        """Return the last level of a topic, such as the name of a direct stop."""
        return topic.rpartition("/")[2]

    def leader(self, interface_name: str) -> str:
        """Return the topic of the record of the order service that leads a fleet, retained."""
        levels = map(level_of, interface_name.split("/"))
        return "/".join((self.prefix, "leader", *levels))

    def robot_map(self, robot: RobotKey) -> str:
        """Return the topic of a robot's own map, as :class:`MapImage`, retained; not part of VDA 5050."""
        # 0026: not below the robot's VDA 5050 topics, where other fleet controls fail at unknown messages
        return self._of_robot(robot, "map")

    @property
    def all_robot_maps(self) -> str:
        """Topic filter of all robots' maps."""
        return f"{self.prefix}/robots/+/+/map"

    def recording_chunks(self, robot: RobotKey) -> str:
        """Return the topic of a robot's recordings, as :class:`Chunk`; not part of VDA 5050.

        Those of the order service have the key :data:`ORDER_SERVICE`.
        """
        return self._of_robot(robot, "recordings/chunk")

    def recording_answers(self, robot: RobotKey) -> str:
        """Return the topic on which a robot receives the :class:`Answer` to each chunk."""
        return self._of_robot(robot, "recordings/answer")

    @property
    def all_recording_answers(self) -> str:
        """Topic filter of the answers to all robots."""
        return f"{self.prefix}/robots/+/+/recordings/answer"

    @property
    def all_recording_chunks(self) -> str:
        """Topic filter of all robots' recordings."""
        return f"{self.prefix}/robots/+/+/recordings/chunk"

    def robot_of_chunk(self, topic: str) -> RobotKey | None:
        """Return the robot of a recording's ``topic``; None for any other topic."""
        return self._robot_in(topic, "recordings/chunk")

    def robot_of_map(self, topic: str) -> RobotKey | None:
        """Return the robot of a map's ``topic``; None for any other topic."""
        return self._robot_in(topic, "map")

    def _of_robot(self, robot: RobotKey, end: str) -> str:
        return f"{self.prefix}/robots/{'/'.join(map(level_of, robot))}/{end}"

    def _robot_in(self, topic: str, end: str) -> RobotKey | None:
        levels = topic.removeprefix(f"{self.prefix}/robots/").removesuffix(f"/{end}").split("/")
        if len(levels) != len(RobotKey._fields):
            return None
        # removeprefix and removesuffix leave a topic as it is that has neither
        if topic != f"{self.prefix}/robots/{'/'.join(levels)}/{end}":
            return None
        return RobotKey(*map(unquote, levels))
