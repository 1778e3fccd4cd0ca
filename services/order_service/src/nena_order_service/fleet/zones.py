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
class _Claim:
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
    def is_inside(self) -> bool:
        """Whether the robot may be inside: it has a grant, or its release ended while it was inside."""
        return self.shown in INSIDE or self.answer is GrantType.GRANTED

    def shows(self, answer: GrantType) -> bool:
        """Return whether the robot's state shows the answer."""
        match answer:
            case GrantType.GRANTED:
                return self.shown is RequestStatus.GRANTED
            case GrantType.REVOKED:
                return self.shown in (RequestStatus.REVOKED, RequestStatus.EXPIRED)
            case GrantType.QUEUED | GrantType.REJECTED:
                return self.answer is answer  # robots need not show these: having sent them suffices


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
    _claims: dict[Place, list[_Claim]] = field(default_factory=dict)

    def on_state(self, robot: RobotKey, state: State) -> None:
        """Update a robot's requests from its state (section 6.9)."""
        # 6.6.10: a corridor is never released outside the base, so its request waits for its edge.
        horizon = {edge.sequence_id for edge in state.edge_states if not edge.released}
        corridors = (edge for edge in state.edge_requests or () if edge.sequence_id not in horizon)
        answerable: list[Request] = [*(state.zone_requests or ()), *corridors]
        requests = {(_place_of(request), request.request_id): request for request in answerable}
        for place, claims in list(self._claims.items()):
            claims[:] = [
                claim for claim in claims if claim.robot != robot or (place, claim.request_id) in requests
            ]
            if not claims:
                del self._claims[place]
        for (place, request_id), request in requests.items():
            claims = self._claims.setdefault(place, [])
            for claim in claims:
                if (claim.robot, claim.request_id) == (robot, request_id):
                    claim.shown = request.request_status
                    break
            else:
                claims.append(_Claim(robot, request_id, request.request_status))

    def take_due_answers(
        self, now: float, *, all_known: bool, reachable: Callable[[RobotKey], bool]
    ) -> Iterator[PublishResponses]:
        """Yield the answers due now (section 6.9), which count as sent.

        ``all_known``: every connected robot has reported its state.
        """
        by_robot: dict[RobotKey, list[Response]] = {}
        for claims in self._claims.values():
            for claim in claims:
                wanted = self._choose_answer(claim, claims, all_known=all_known)
                if reachable(claim.robot) and self._is_due(claim, wanted, now):
                    by_robot.setdefault(claim.robot, []).append(self._make_answer(claim, wanted, now))
        for robot, responses in by_robot.items():
            yield PublishResponses(robot, tuple(responses))

    @property
    def has_requests(self) -> bool:
        """Whether any robot has requests."""
        return bool(self._claims)

    def _choose_answer(self, claim: _Claim, claims: list[_Claim], *, all_known: bool) -> GrantType:
        """Return the answer to a request by the release policy; ``claims`` are all those for its place."""
        policy = self.settings.release_policy
        if policy is ReleasePolicy.ALL:
            return GrantType.GRANTED
        if policy is ReleasePolicy.NONE:
            return GrantType.REVOKED if claim.is_inside else GrantType.REJECTED
        holder = next((rival.robot for rival in claims if rival.is_inside), claims[0].robot)
        if claim.robot != holder:
            return GrantType.REVOKED if claim.is_inside else GrantType.QUEUED
        # After a restart a robot that has not reported yet may be inside by a grant of the last run.
        return GrantType.GRANTED if all_known or claim.is_inside else GrantType.QUEUED

    def _is_due(self, claim: _Claim, wanted: GrantType, now: float) -> bool:
        """Return whether to send the answer: it is new, the robot does not show it, or its lease runs out."""
        if claim.shows(wanted):
            # 6.9: a robot whose lease expires inside stops or leaves, by its releaseLossBehavior. Renewed at
            # half, a lease survives a lost answer. After a restart it is unknown, and may soon run out.
            lease, until = self.settings.release_lease, claim.lease_until
            renews = lease > 0 and (until is None or now >= until - lease / 2)
            return wanted is GrantType.GRANTED and renews
        if claim.answer is not wanted:
            return True
        pause = min(self.settings.resend_after * 2.0**claim.repeats, self.settings.resend_at_most_after)
        return now - claim.answered_at >= pause

    def _make_answer(self, claim: _Claim, wanted: GrantType, now: float) -> Response:
        is_repeat = claim.answer is wanted and not claim.shows(wanted)
        claim.repeats = claim.repeats + 1 if is_repeat else 0
        claim.answer, claim.answered_at = wanted, now
        lease = self.settings.release_lease if wanted is GrantType.GRANTED else 0.0
        claim.lease_until = now + lease if lease else None
        expiry = self.utc_now() + timedelta(seconds=lease) if lease else None
        return Response(request_id=claim.request_id, grant_type=wanted, lease_expiry=expiry)


def _place_of(request: Request) -> Place:
    if isinstance(request, EdgeRequest):
        return (request.edge_id,)
    return request.zone_set_id, request.zone_id
