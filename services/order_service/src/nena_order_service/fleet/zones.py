"""Answer robots that request a zone or a corridor (VDA 5050 3.0, sections 6.4.3, 6.6.10 and 6.9)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from nena_order_service.fleet.outputs import PublishResponses
from nena_order_service.fleet.settings import FleetSettings, ReleasePolicy
from nena_shared.vda5050.request import EdgeRequest, RequestStatus, ZoneRequest
from nena_shared.vda5050.responses import GrantType, Response
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey

Request = ZoneRequest | EdgeRequest
Place = tuple[str, ...]
"""A zone, by the IDs of its set and itself, or an edge, by its ID."""

INSIDE: Final = frozenset({RequestStatus.GRANTED, RequestStatus.REVOKED, RequestStatus.EXPIRED})
"""Request states in which the robot may be inside, with or without a release."""


@dataclass(slots=True)
class _Asked:
    """A robot's request, and the last answer to it; times are in monotonic seconds."""

    robot: RobotKey
    request_id: str
    shown: RequestStatus
    answer: GrantType | None = None
    answered_at: float = 0.0
    repeats: int = 0
    """Number of times that the answer was resent."""
    lease_until: float | None = None

    @property
    def holds(self) -> bool:
        """Whether the robot may be inside: it has a grant, or its release ended while it was inside."""
        return self.shown in INSIDE or self.answer is GrantType.GRANTED


@dataclass(slots=True)
class ReleaseManager:
    """Queues the robots' requests for each zone or edge; ``utc_now`` returns the time for leases.

    A zone or edge is held from the grant until the robot's state no longer has the request, even if the robot
    is silent or its grant was revoked while it was inside. A robot may send several requests for one zone,
    one for each path that it might take. Nothing is granted before every connected robot has reported its
    state, so that earlier grants are known after a restart; if two robots then hold the same zone, the grant
    of the second is revoked.
    """

    settings: FleetSettings
    utc_now: Callable[[], datetime]
    _asked: dict[Place, list[_Asked]] = field(default_factory=dict)

    def on_state(self, robot: RobotKey, state: State) -> None:
        """Update a robot's requests from its state (section 6.9)."""
        requests = {(_place_of(request), request.request_id): request for request in _open_requests(state)}
        for place, asked in list(self._asked.items()):
            asked[:] = [
                request
                for request in asked
                if request.robot != robot or (place, request.request_id) in requests
            ]
            if not asked:
                del self._asked[place]
        for (place, _), request in requests.items():
            self._note_request(robot, self._asked.setdefault(place, []), request)

    def answers(
        self, now: float, *, all_known: bool, reachable: Callable[[RobotKey], bool]
    ) -> Iterator[PublishResponses]:
        """Yield the answers due now (section 6.9).

        ``all_known``: every connected robot has reported its state.
        """
        by_robot: dict[RobotKey, list[Response]] = {}
        for asked in self._asked.values():
            for asked_request in asked:
                wanted = self._wanted_answer(asked_request, asked, all_known=all_known)
                if reachable(asked_request.robot) and self._is_due(asked_request, wanted, now):
                    by_robot.setdefault(asked_request.robot, []).append(
                        self._make_answer(asked_request, wanted, now)
                    )
        for robot, responses in by_robot.items():
            yield PublishResponses(robot, tuple(responses))

    @property
    def busy(self) -> bool:
        """Whether any robot has requests."""
        return bool(self._asked)

    def _note_request(self, robot: RobotKey, asked: list[_Asked], request: Request) -> None:
        for request_run in asked:
            if (request_run.robot, request_run.request_id) == (robot, request.request_id):
                request_run.shown = request.request_status
                return
        asked.append(_Asked(robot, request.request_id, request.request_status))

    def _wanted_answer(self, each: _Asked, asked: list[_Asked], *, all_known: bool) -> GrantType:
        """Return the answer to a request by the release policy."""
        policy = self.settings.release_policy
        if policy is ReleasePolicy.ALL:
            return GrantType.GRANTED
        if policy is ReleasePolicy.NONE:
            return GrantType.REVOKED if each.holds else GrantType.REJECTED
        holder = next((request.robot for request in asked if request.holds), asked[0].robot)
        if each.robot != holder:
            return GrantType.REVOKED if each.holds else GrantType.QUEUED
        return GrantType.GRANTED if all_known or each.holds else GrantType.QUEUED

    def _is_due(self, each: _Asked, wanted: GrantType, now: float) -> bool:
        """Return whether to send the answer: it is new, the robot does not show it, or its lease runs out."""
        if _shows_answer(each, wanted):
            return wanted is GrantType.GRANTED and self._must_renew(each, now)
        if each.answer is not wanted:
            return True
        pause = min(self.settings.resend_after * 2.0**each.repeats, self.settings.resend_at_most_after)
        return now - each.answered_at >= pause

    def _must_renew(self, each: _Asked, now: float) -> bool:
        """Return whether half of a grant's lease has passed, or the lease is unknown after a restart."""
        lease = self.settings.release_lease
        return lease > 0 and (each.lease_until is None or now >= each.lease_until - lease / 2)

    def _make_answer(self, each: _Asked, wanted: GrantType, now: float) -> Response:
        again = each.answer is wanted and not _shows_answer(each, wanted)
        each.repeats = each.repeats + 1 if again else 0
        each.answer, each.answered_at = wanted, now
        lease = self.settings.release_lease if wanted is GrantType.GRANTED else 0.0
        each.lease_until = now + lease if lease else None
        expiry = self.utc_now() + timedelta(seconds=lease) if lease else None
        return Response(request_id=each.request_id, grant_type=wanted, lease_expiry=expiry)


def _open_requests(state: State) -> Iterator[Request]:
    """Yield the requests to answer; corridors of the horizon must wait until their edges are released."""
    horizon = {edge.sequence_id for edge in state.edge_states if not edge.released}
    yield from state.zone_requests or ()
    yield from (request for request in state.edge_requests or () if request.sequence_id not in horizon)


def _place_of(request: Request) -> Place:
    if isinstance(request, EdgeRequest):
        return (request.edge_id,)
    return request.zone_set_id, request.zone_id


def _shows_answer(each: _Asked, wanted: GrantType) -> bool:
    """Return whether the robot's state shows the answer; some answers, such as QUEUED, need not be shown."""
    match wanted:
        case GrantType.GRANTED:
            return each.shown is RequestStatus.GRANTED
        case GrantType.REVOKED:
            return each.shown in (RequestStatus.REVOKED, RequestStatus.EXPIRED)
        case GrantType.QUEUED | GrantType.REJECTED:
            return each.answer is wanted
