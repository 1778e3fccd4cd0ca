"""Fleet control over many robots: messages and time in, messages to send and news out."""

from __future__ import annotations

from collections.abc import Callable

from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.operations import fresh_id
from nena_order_service.fleet.outputs import Outputs
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.view import RobotView
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey


class FleetController:
    """Sends missions to robots and follows them by what the robots' states say.

    Each mission that is started or adopted ends in exactly one of MissionFinished, MissionFailed and
    MissionCancelled. ``now`` is in monotonic seconds everywhere.
    """

    def __init__(self, settings: FleetSettings, *, new_id: Callable[[], str] = fresh_id) -> None:
        raise NotImplementedError

    def on_connection(self, robot: RobotKey, message: Connection, now: float) -> Outputs:
        """Take in a connection message."""
        raise NotImplementedError

    def on_state(self, robot: RobotKey, message: State, now: float) -> Outputs:
        """Take in a state message; one that is repeated or out of order changes nothing."""
        raise NotImplementedError

    def on_factsheet(self, robot: RobotKey, message: Factsheet, now: float) -> Outputs:
        """Take in a factsheet."""
        raise NotImplementedError

    def on_malformed(self, robot: RobotKey, problems: tuple[str, ...], now: float) -> Outputs:
        """Take notice of a message that could not be read; it changes nothing but the view."""
        raise NotImplementedError

    def on_broker(self, *, connected: bool, now: float) -> Outputs:
        """Take notice that our own link to the broker stands or has gone; at first it counts as gone."""
        raise NotImplementedError

    def start_mission(self, robot: RobotKey, mission: Mission, now: float) -> Outputs:
        """Send a mission, now or as soon as the robot can be sent one; the view tells what it waits for.

        Raises:
            RobotBusyError: the robot has a mission.

        """
        raise NotImplementedError

    def adopt_mission(self, robot: RobotKey, mission: Mission, now: float, *, accepted: bool) -> Outputs:
        """Take up a mission from before a restart of this program: what the robot's next state says decides.

        A robot that has it goes on, and news may be told again. One that does not know it is sent it, unless
        it was ``accepted`` before: then the robot has lost it, and the mission fails.

        Raises:
            RobotBusyError: the robot has a mission.

        """
        raise NotImplementedError

    def cancel_mission(self, robot: RobotKey, now: float) -> Outputs:
        """End the robot's mission early: cancelOrder, awaited to its end. Without one nothing happens."""
        raise NotImplementedError

    def instant_action(self, robot: RobotKey, action: Action, now: float) -> Outputs:
        """Send an instant action and follow it to InstantActionEnded; it does not wait for an absent robot."""
        raise NotImplementedError

    def tick(self, now: float) -> Outputs:
        """Do what is overdue: send again, give up, notice silence. Call it a few times each second."""
        raise NotImplementedError

    def view(self, robot: RobotKey, now: float) -> RobotView:
        """Tell what is known of a robot; of one that was never heard of, that."""
        raise NotImplementedError

    def robots(self) -> tuple[RobotKey, ...]:
        """Name all robots that have been heard of."""
        raise NotImplementedError
