"""Answers to robots that ask for a zone or a corridor (VDA 5050 3.0 sections 6.4.3, 6.6.10 and 6.9)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from nena_order_service.fleet.outputs import PublishResponses
from nena_order_service.fleet.settings import FleetSettings, ReleasePolicy
from nena_shared.vda5050.request import EdgeRequest, RequestStatus, ZoneRequest
from nena_shared.vda5050.responses import GrantType, Response
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey

Request = ZoneRequest | EdgeRequest
Place = tuple[str, ...]
"""A zone by its set and id, or an edge by its id."""


@dataclass(slots=True)
class _Asked:
    """A request that a robot states, and what it was answered last."""

    robot: RobotKey
    request_id: str
    answer: GrantType | None = None
    answered_at: float = 0.0
    shown: RequestStatus = RequestStatus.REQUESTED
    lease_until: float | None = None


@dataclass(slots=True)
class ReleaseDesk:
    """Keeps who asked for which place, first come first; ``utc_now`` gives the time of day for leases.

    A place is held from the grant until the robot's state names the request no more: also by a robot that
    has fallen silent, or whose grant has been taken back while it was inside. Nothing is granted before
    every robot that is there has told its state, so that what was granted before a restart is known.
    """

    settings: FleetSettings
    utc_now: Callable[[], datetime]
    _asked: dict[Place, list[_Asked]] = field(default_factory=dict)

    def on_state(self, robot: RobotKey, state: State, now: float) -> None:
        """Take in what a robot asks for."""
        requests = {_place(each): each for each in _requests(state)}
        for place, asked in list(self._asked.items()):
            if place not in requests:
                asked[:] = [each for each in asked if each.robot != robot]
            if not asked:
                del self._asked[place]
        for place, request in requests.items():
            self._note(robot, place, request, now)

    def answers(self, now: float, *, all_known: bool) -> Iterator[PublishResponses]:
        """Give what is to be answered now; ``all_known``: every robot that is there has told its state."""
        by_robot: dict[RobotKey, list[Response]] = {}
        for asked in self._asked.values():
            for each in asked:
                wanted = self._wanted(each, asked, all_known=all_known)
                if self._due(each, wanted, now):
                    by_robot.setdefault(each.robot, []).append(self._answer(each, wanted, now))
        for robot, responses in by_robot.items():
            yield PublishResponses(robot, tuple(responses))

    @property
    def busy(self) -> bool:
        """Whether any robot asks for anything."""
        return bool(self._asked)

    def _note(self, robot: RobotKey, place: Place, request: Request, now: float) -> None:
        asked = self._asked.setdefault(place, [])
        known = next((each for each in asked if each.robot == robot), None)
        if known is None or known.request_id != request.request_id:
            asked[:] = [each for each in asked if each.robot != robot]
            known = _Asked(robot, request.request_id)
            asked.append(known)
        if request.request_status is RequestStatus.GRANTED and known.answer is None:
            known.answer, known.answered_at = GrantType.GRANTED, now  # by us, before a restart
        known.shown = request.request_status

    def _wanted(self, each: _Asked, asked: list[_Asked], *, all_known: bool) -> GrantType:
        match self.settings.release_policy:
            case ReleasePolicy.ALL:
                return GrantType.GRANTED
            case ReleasePolicy.NONE:
                return GrantType.REJECTED
            case ReleasePolicy.EXCLUSIVE:
                holder = next((other for other in asked if _holds(other)), asked[0])
                free = all_known or _holds(each)
                return GrantType.GRANTED if holder is each and free else GrantType.QUEUED

    def _due(self, each: _Asked, wanted: GrantType, now: float) -> bool:
        """Tell whether to answer: something new, a grant that the robot does not show, a lease that ends."""
        if each.answer is not wanted:
            return True
        if wanted is not GrantType.GRANTED:
            return False
        waited = now - each.answered_at >= self.settings.resend_after
        ending = each.lease_until is not None and now >= each.lease_until - self.settings.release_lease / 2
        return waited and (each.shown is not RequestStatus.GRANTED or ending)

    def _answer(self, each: _Asked, wanted: GrantType, now: float) -> Response:
        each.answer, each.answered_at = wanted, now
        lease = self.settings.release_lease if wanted is GrantType.GRANTED else 0.0
        each.lease_until = now + lease if lease else None
        expiry = self.utc_now() + timedelta(seconds=lease) if lease else None
        return Response(request_id=each.request_id, grant_type=wanted, lease_expiry=expiry)


def _requests(state: State) -> Iterator[Request]:
    yield from state.zone_requests or ()
    yield from state.edge_requests or ()


def _place(request: Request) -> Place:
    if isinstance(request, EdgeRequest):
        return (request.edge_id,)
    return request.zone_set_id, request.zone_id


def _holds(each: _Asked) -> bool:
    """Tell whether the robot may be at the place: it was granted, or is in it without a release now."""
    inside = each.shown in (RequestStatus.GRANTED, RequestStatus.REVOKED, RequestStatus.EXPIRED)
    return inside or each.answer is GrantType.GRANTED
