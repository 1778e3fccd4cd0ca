"""MQTT topics of NeNa's own: of the order service for hosts, and of what robots send beside VDA 5050."""

from __future__ import annotations

from dataclasses import dataclass

from nena_shared.vda5050.topics import RobotKey


@dataclass(frozen=True, slots=True)
class FleetTopics:
    """Topics below one prefix, e.g. ``nena/v1``; each fleet has its own prefix."""

    prefix: str = "nena/v1"

    @property
    def creation_requests(self) -> str:
        """Return the filter of the topics for requests to create transport orders."""
        return f"{self.prefix}/hosts/+/transportOrders/create"

    def creation_request(self, host: str) -> str:
        """Where ``host`` publishes a :class:`TransportOrderRequest`."""
        return f"{self.prefix}/hosts/{host}/transportOrders/create"

    def creation_answer(self, host: str) -> str:
        """Where ``host`` gets its :class:`CreationAnswer`."""
        return f"{self.prefix}/hosts/{host}/transportOrders/answer"

    @property
    def commands(self) -> str:
        """Return the filter of the topics for all other commands."""
        return self.command("+", "+")

    def command(self, host: str, name: str) -> str:
        """Where ``host`` publishes the command of this name."""
        return f"{self.prefix}/hosts/{host}/commands/{name}"

    def command_answer(self, host: str, name: str) -> str:
        """Where ``host`` gets the answer."""
        return f"{self.command(host, name)}/answer"

    def host_of(self, topic: str) -> str:
        """Return the host that published on ``topic``."""
        return topic.removeprefix(f"{self.prefix}/hosts/").split("/", 1)[0]

    def order_status(self, name: str) -> str:
        """Topic of the changes of an order, as :class:`TransportOrderStatus`.

        Retained while the order lives; an empty message clears it ``end_kept`` after the final one.
        """
        return f"{self.prefix}/transportOrders/{name}/status"

    def vehicle_status(self, serial_number: str) -> str:
        """Topic of the changes of a vehicle, as :class:`VehicleStatus`, retained."""
        return f"{self.prefix}/vehicles/{serial_number}/status"

    def sequence_status(self, name: str) -> str:
        """Topic of the changes of an order sequence, as :class:`OrderSequenceStatus`.

        Retained until it is finished; an empty message follows the last one and clears it.
        """
        return f"{self.prefix}/orderSequences/{name}/status"

    @property
    def all_sequence_statuses(self) -> str:
        """Filter of all order sequences' changes."""
        return self.sequence_status("+")

    @property
    def all_order_statuses(self) -> str:
        """Filter of all orders' changes."""
        return self.order_status("+")

    @property
    def all_vehicle_statuses(self) -> str:
        """Filter of all vehicles' changes."""
        return self.vehicle_status("+")

    @property
    def service_status(self) -> str:
        """Topic of the order service's heartbeats and last will, as :class:`ServiceStatus`, retained."""
        return f"{self.prefix}/orderService/status"

    @property
    def plant_model(self) -> str:
        """Where the plant model is, as JSON, retained."""
        return f"{self.prefix}/plantModel"

    def robot_map(self, robot: RobotKey) -> str:
        """Topic of a robot's own map, as :class:`MapImage`, retained; outside of the tree of VDA 5050."""
        return f"{self.prefix}/robots/{robot}/map"

    @property
    def all_robot_maps(self) -> str:
        """Filter of all robots' maps."""
        return self.robot_map(RobotKey("+", "+"))

    def robot_of_map(self, topic: str) -> RobotKey | None:
        """Return whose map ``topic`` is; None for a topic of another form."""
        robot = RobotKey(*levels) if len(levels := topic.split("/")[-3:-1]) == len(RobotKey._fields) else None
        return robot if robot is not None and topic == self.robot_map(robot) else None
