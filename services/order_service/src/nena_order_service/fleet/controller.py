"""Fleet control over many robots: messages and time in, messages to send and news out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import chain
from typing import Final

from nena_order_service.fleet.mission import Mission, fresh_id
from nena_order_service.fleet.outputs import FleetOutput, Outputs
from nena_order_service.fleet.robot import RobotView, Silences, State
from nena_order_service.fleet.robot_control import RobotControl
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.zones import ReleaseDesk
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.topics import RobotKey

RETAINED_WITHIN: Final = 1.0
"""Seconds after our own connect in which the broker tells which robots there are."""


def _utc_now() -> datetime:
    return datetime.now(UTC)


class FleetController:
    """Sends missions to robots and follows them by what the robots' states say.

    Each mission that is started or adopted ends in exactly one of MissionFinished, MissionFailed and
    MissionCancelled. ``now`` is in monotonic seconds everywhere.
    """

    def __init__(
        self,
        settings: FleetSettings,
        *,
        new_id: Callable[[], str] = fresh_id,
        utc_now: Callable[[], datetime] = _utc_now,
    ) -> None:
        self._settings = settings
        self._new_id = new_id
        self._broker = False
        self._broker_since = 0.0
        self._robots: dict[RobotKey, RobotControl] = {}
        self._busy: dict[RobotKey, RobotControl] = {}
        """Those who may have something to do as time goes by; most do what they were sent."""
        self._silences = Silences()
        self._desk = ReleaseDesk(settings, utc_now)

    def on_connection(self, robot: RobotKey, message: Connection, now: float) -> Outputs:
        """Take in a connection message."""
        control = self._control(robot)
        return self._told(control, control.on_connection(message, now))

    def on_state(self, robot: RobotKey, message: State, now: float) -> Outputs:
        """Take in a state message; one that is repeated or out of order changes nothing."""
        control = self._control(robot)
        outputs = self._told(control, control.on_state(message, now))
        if message.zone_requests or message.edge_requests or self._desk.busy:
            self._desk.on_state(robot, control.robot.state or message)
            outputs += self._answers(now)
        return outputs

    def on_factsheet(self, robot: RobotKey, message: Factsheet, now: float) -> Outputs:
        """Take in a factsheet."""
        control = self._control(robot)
        return self._told(control, control.on_factsheet(message, now))

    def on_malformed(self, robot: RobotKey) -> int:
        """Count a message that could not be read, which changes nothing else; give the robot's count."""
        known = self._control(robot).robot
        known.malformed += 1
        return known.malformed

    def on_broker(self, *, connected: bool, now: float) -> Outputs:
        """Take notice that our own link to the broker stands or has gone; at first it counts as gone."""
        self._broker = connected
        self._broker_since = now
        told = (
            self._told(each, each.on_broker(connected=connected, now=now)) for each in self._robots.values()
        )
        return tuple(chain.from_iterable(told))

    def start_mission(self, robot: RobotKey, mission: Mission, now: float) -> Outputs:
        """Send a mission, now or as soon as the robot can be sent one; the view tells what it waits for.

        Raises:
            RobotBusyError: the robot has a mission.

        """
        control = self._control(robot)
        return self._told(control, control.start(control.new_run(mission), now))

    def adopt_mission(
        self, robot: RobotKey, mission: Mission, now: float, *, accepted: bool, update_id: int = 0
    ) -> Outputs:
        """Take up a mission from before a restart of this program: what the robot's next state says decides.

        A robot that has it goes on, and news may be told again. One that does not know it is sent it, unless
        it was ``accepted`` before: then the robot has lost it, and the mission fails. ``update_id`` is the
        last update that was sent; a robot that has an older one is sent the rest.

        Raises:
            RobotBusyError: the robot has a mission.

        """
        control = self._control(robot)
        run = control.new_run(mission, adopted=True, accepted=accepted, update_id=update_id)
        return self._told(control, control.start(run, now))

    def extend_mission(self, robot: RobotKey, mission: Mission, now: float) -> Outputs:
        """Give the robot's mission a newer plan: more of it released, or another way behind the base.

        It goes out as an order update as soon as the robot has echoed what it was sent before; of plans that
        come in the meantime only the newest is sent. A mission that has ended is passed over.

        Raises:
            BaseChangedError: the plan does not go on from the base that the robot was given.

        """
        control = self._control(robot)
        return self._told(control, control.extend(mission, now))

    def cancel_mission(self, robot: RobotKey, now: float) -> Outputs:
        """End the robot's mission early: cancelOrder, awaited to its end. Without one nothing happens."""
        control = self._control(robot)
        return self._told(control, control.cancel(now))

    def instant_action(self, robot: RobotKey, action: Action, now: float) -> Outputs:
        """Send an instant action and follow it to InstantActionEnded; it waits for no absent robot."""
        control = self._control(robot)
        return self._told(control, control.instruct(action, now))

    def tick(self, now: float) -> Outputs:
        """Do what is overdue: send again, give up, notice silence. Call it a few times each second."""
        ticks = chain.from_iterable(self._told(each, each.tick(now)) for each in self._due(now))
        return (*ticks, *(self._answers(now) if self._desk.busy else ()))

    def view(self, robot: RobotKey, now: float) -> RobotView:
        """Tell what is known of a robot; of one that was never heard of, that."""
        known = self._robots.get(robot)
        return (known or self._new_control(robot)).view(now)

    def connected_for(self, now: float) -> float:
        """Tell for how many seconds the link to the broker stands; 0 while it does not."""
        return now - self._broker_since if self._broker else 0.0

    def all_known(self, now: float) -> bool:
        """Tell whether each robot that the broker knows to be there has told its state."""
        if self.connected_for(now) < RETAINED_WITHIN:
            return False
        return all(each.robot.state or not each.robot.reachable for each in self._robots.values())

    def robots(self) -> tuple[RobotKey, ...]:
        """Name all robots that have been heard of or given something to do."""
        return tuple(self._robots)

    def has_room_for(self, robot: RobotKey) -> bool:
        """Tell whether messages of this robot can be taken in: it is known, or there are not too many yet."""
        return robot in self._robots or len(self._robots) < self._settings.robots_limit

    def _answers(self, now: float) -> Outputs:
        """Answer the robots' requests; nobody can be told anything while our own link is gone."""
        if not self._broker:
            return ()
        return tuple(self._desk.answers(now, all_known=self.all_known(now), reachable=self._reachable))

    def _reachable(self, robot: RobotKey) -> bool:
        return self._robots[robot].robot.reachable

    def _told(self, control: RobotControl, outputs: Iterator[FleetOutput]) -> Outputs:
        """Take all that comes of it, and note when the robot is to be looked at without news of it."""
        told, robot = tuple(outputs), control.robot
        if not control.quiet:
            self._busy[robot.key] = control
        else:
            self._busy.pop(robot.key, None)
        if robot.silent_from is not None:
            self._silences.expect(robot.key, robot.silent_from)
        return told

    def _due(self, now: float) -> Iterator[RobotControl]:
        """Give those for whom it makes a difference that time has gone by."""
        busy = dict(self._busy)
        yield from busy.values()
        yield from (self._robots[robot] for robot in self._silences.passed(now) if robot not in busy)

    def _control(self, robot: RobotKey) -> RobotControl:
        known = self._robots.get(robot)
        if known is None:
            known = self._robots[robot] = self._new_control(robot)
        return known

    def _new_control(self, robot: RobotKey) -> RobotControl:
        return RobotControl(robot, self._settings, self._new_id, broker=self._broker)
