"""What the kernel needs of its neighbours."""

from __future__ import annotations

from typing import Protocol

from nena_order_service.fleet import Mission, RobotView
from nena_shared.fleet_api.transport_order import OrderSequenceStatus, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.topics import RobotKey


class FleetControl(Protocol):
    """Sends to robots what it is told, and tells how they are; its news go to the kernel's ``on_news``."""

    def start_mission(self, robot: RobotKey, mission: Mission) -> None:
        """Send a mission; raises RobotBusyError."""
        ...

    def adopt_mission(self, robot: RobotKey, mission: Mission, *, accepted: bool, update_id: int = 0) -> None:
        """Take up a mission from before a restart; raises RobotBusyError."""
        ...

    def extend_mission(self, robot: RobotKey, mission: Mission) -> None:
        """Give the robot's mission a newer plan; raises BaseChangedError."""
        ...

    def cancel_mission(self, robot: RobotKey) -> None:
        """End the robot's mission early."""
        ...

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        """Send an instant action."""
        ...

    def all_known(self) -> bool:
        """Tell whether each robot that the broker knows to be there has told its state."""
        ...

    def connected_for(self) -> float:
        """Tell for how many seconds the link to the broker stands; 0 while it does not."""
        ...

    def view(self, robot: RobotKey) -> RobotView:
        """Tell what is known of a robot."""
        ...


class Listener(Protocol):
    """Is told each change, once it is committed."""

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Take notice of an order's new version."""
        ...

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Take notice of an order sequence's new version."""
        ...

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Take notice that a vehicle stands otherwise than before."""
        ...
