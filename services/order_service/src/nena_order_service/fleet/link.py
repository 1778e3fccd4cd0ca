"""Fleet control's shell over MQTT."""

from __future__ import annotations

from collections.abc import Callable

from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.outputs import FleetOutput
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.view import RobotView
from nena_shared.clock import Clock
from nena_shared.mqtt import MqttLink
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.topics import RobotKey, TopicScheme


class FleetLink:
    """Subscribes to what robots say, sends what the core decides, and hands its news on.

    The program that owns the MQTT link calls :meth:`connected` and :meth:`lost` from the link's own hooks.
    ``on_news`` gets each output but the messages to send, in order, within the call that caused it.
    """

    def __init__(
        self,
        mqtt: MqttLink,
        *,
        scheme: TopicScheme,
        settings: FleetSettings,
        clock: Clock,
        on_news: Callable[[FleetOutput], None],
    ) -> None:
        raise NotImplementedError

    def connected(self) -> None:
        """Take notice that the link to the broker stands (from MqttLink's ``on_connected``)."""
        raise NotImplementedError

    def lost(self) -> None:
        """Take notice that the link to the broker has gone (from MqttLink's ``on_lost``)."""
        raise NotImplementedError

    async def run(self) -> None:
        """Look after what is overdue, until cancelled."""
        raise NotImplementedError

    def start_mission(self, robot: RobotKey, mission: Mission) -> None:
        """See :meth:`FleetController.start_mission`; also for the following ones."""
        raise NotImplementedError

    def adopt_mission(self, robot: RobotKey, mission: Mission, *, accepted: bool) -> None:
        """See :meth:`FleetController.adopt_mission`."""
        raise NotImplementedError

    def cancel_mission(self, robot: RobotKey) -> None:
        """See :meth:`FleetController.cancel_mission`."""
        raise NotImplementedError

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        """See :meth:`FleetController.instant_action`."""
        raise NotImplementedError

    def view(self, robot: RobotKey) -> RobotView:
        """See :meth:`FleetController.view`."""
        raise NotImplementedError
