"""Stops of all robots without the order service, while it does not answer.

Each stop is retained at the broker before startPause is sent, with the robots that it pauses: so it outlasts
this program, the other aggregators pause the robots of their shares, and the order service continues it as a
stop of its own when it is back. Until then, each robot is asked again until it reports that it is paused.
"""

from __future__ import annotations

from typing import Final
from uuid import uuid4

from pydantic import ValidationError
from pydantic_core import from_json, to_json

from nena_shared.clock import Clock
from nena_shared.fleet_api.stops import DIRECT_ACTION, DirectStop, StopEndRequest, StopRequest, StopStatus
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.vda5050.action import Action, BlockingType, InstantActions
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_status_aggregator.fleet.model import FleetModel
from nena_status_aggregator.fleet.robot import Robot

log = get_logger(__name__)

START_PAUSE: Final = "startPause"
STOP_PAUSE: Final = "stopPause"

AGAIN_AFTER: Final = 3.0
"""Seconds after which a robot that does not report the effect is sent the action again."""

RELEASED_WITHIN: Final = 30.0
"""Seconds after the end of a stop within which its robots are asked to continue."""

REMEMBERED: Final = 50
"""Maximum number of stops that wait for the order service; more are not read."""


class DirectStops:
    """Pauses the robots of this share for stops that the order service has not taken over yet."""

    def __init__(self, mqtt: MqttLink, model: FleetModel, topics: FleetTopics, clock: Clock) -> None:
        self._mqtt = mqtt
        self._model = model
        self._topics = topics
        self._clock = clock
        self._stops: dict[str, DirectStop] = {}
        self._sent: dict[RobotKey, tuple[str, float]] = {}
        """The last action that each robot was sent, and its time, monotonic seconds."""
        self._releasing: dict[RobotKey, float] = {}
        """Robots that should continue, with the monotonic time until which they are asked to."""
        self._header_id = 0
        mqtt.subscribe(topics.direct_stops, self._on_message, needed=False)

    @property
    def can_send(self) -> bool:
        """Whether the broker is connected."""
        return self._mqtt.state.connected

    def find(self, name: str) -> DirectStop | None:
        """Return an active stop; None if it has ended, or is one of the order service."""
        stop = self._stops.get(name)
        return stop if stop and not stop.ended else None

    def begin(self, request: StopRequest, user: str) -> StopStatus:
        """Pause all robots; while such a stop is active, return that one."""
        stop = next((each for each in self._stops.values() if not each.ended), None)
        if stop is None:
            stop = DirectStop(
                name=f"stop-{uuid4().hex[:8]}",
                by=request.by or user,
                reason=request.reason,
                since=self._clock.now(),
                user=user,
            )
            log.warning("robots stopped without the order service", stop=stop.name, by=stop.by, user=user)
            self._keep(stop)
            self.pause_and_release()
        return self._status_of(stop)

    def end(self, stop: DirectStop, request: StopEndRequest, user: str) -> StopStatus:
        """End an active stop: the robots that it has paused continue."""
        now, by = self._clock.now(), request.by or user
        end = {"ended": now, "ended_by": by, "end_reason": request.reason, "ended_by_user": user}
        log.warning("stop without the order service ended", stop=stop.name, by=by, user=user)
        self._keep(stop.model_copy(update=end))
        self.pause_and_release()
        return self._status_of(stop).model_copy(update={"ended": now})

    def pause_and_release(self) -> None:
        """Send each robot what it needs; called periodically."""
        active = [stop for stop in self._stops.values() if not stop.ended]
        self._model.direct_stops = tuple(map(self._status_of, active))
        if not active and not self._releasing:
            return
        now = self._clock.monotonic()
        reached = [robot for robot in self._model.robots if robot.codec and not robot.away_reason]
        if active:
            driving = {robot.key for robot in reached if not (robot.state and robot.state.paused)}
            for stop in active:
                if not driving <= stop.paused:
                    self._keep(stop.model_copy(update={"paused": stop.paused | driving}))
            self._releasing.clear()
        for robot in reached:
            paused = bool(robot.state and robot.state.paused)
            if active and not paused:
                self._send_action(robot, START_PAUSE, now)
            elif not active and robot.key in self._releasing:
                if paused and now < self._releasing[robot.key]:
                    self._send_action(robot, STOP_PAUSE, now)
                else:
                    del self._releasing[robot.key]

    def _status_of(self, stop: DirectStop) -> StopStatus:
        return self._model.count_paused(
            StopStatus(name=stop.name, by=stop.by, reason=stop.reason, since=stop.since)
        )

    def _send_action(self, robot: Robot, action_type: str, now: float) -> None:
        last_type, sent_at = self._sent.get(robot.key, ("", 0.0))
        if (last_type == action_type and now - sent_at < AGAIN_AFTER) or not robot.codec or not robot.scheme:
            return
        self._sent[robot.key] = action_type, now
        action_id = f"{DIRECT_ACTION}{uuid4().hex[:16]}"
        action = Action(action_type=action_type, action_id=action_id, blocking_type=BlockingType.NONE)
        message = InstantActions(
            header_id=self._header_id,
            timestamp=self._clock.now(),
            version=robot.codec.version,
            manufacturer=robot.key.manufacturer,
            serial_number=robot.key.serial_number,
            actions=(action,),
        )
        self._header_id += 1
        payload = robot.codec.encode(message)
        if key := self._model.instant_actions_key_of(robot):
            content = from_json(payload)
            payload = to_json({**content, key: content.pop("actions")})
        topic = robot.scheme.of(robot.key, Topic.INSTANT_ACTIONS)
        self._mqtt.publish(Outbound(topic, payload, keep=False))

    def _keep(self, stop: DirectStop) -> None:
        """Remember a stop, and retain it at the broker."""
        body = stop.model_dump_json(by_alias=True, exclude_none=True).encode()
        self._note(DirectStop.model_validate_json(body))  # equal to what the broker returns
        self._mqtt.publish(Outbound(self._topics.direct_stop(stop.name), body, retain=True))

    def _note(self, stop: DirectStop) -> None:
        known = self._stops.get(stop.name)
        self._stops[stop.name] = stop
        if stop.ended and known and not known.ended:
            until = self._clock.monotonic() + RELEASED_WITHIN
            self._releasing |= dict.fromkeys(stop.paused, until)

    def _on_message(self, inbound: Inbound) -> None:
        name = self._topics.name_below(inbound.topic)
        if not inbound.payload:  # the order service has taken it over
            self._stops.pop(name, None)
            return
        try:
            stop = DirectStop.model_validate_json(inbound.payload)
        except ValidationError:
            log.warning("stop at the broker is unreadable", topic=inbound.topic)
            return
        known = self._stops.get(name)
        if known is None and len(self._stops) >= REMEMBERED:
            log.error("too many stops at the broker; this one is not read", topic=inbound.topic)
        elif known is None:
            self._note(stop)
        elif (merged := known.merged_with(stop)) != stop:
            self._keep(merged)  # another aggregator did not know of our robots, or of the end
        else:
            self._note(stop)
