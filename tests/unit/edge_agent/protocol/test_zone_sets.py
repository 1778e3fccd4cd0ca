"""Zone sets in the robot: taken, enabled, deleted, refused."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from nena_edge_agent.protocol.geometry import bounding_box
from nena_edge_agent.protocol.zone_sets import (
    LOST,
    MAXIMUM_ZONE_SETS,
    MAXIMUM_ZONES,
    REQUEST_RETRY_DELAY,
    AccessRequest,
    EnabledZone,
    ZoneKey,
    ZoneRequests,
    ZoneSetLimitError,
    ZoneSetRefusedError,
    ZoneSets,
)
from nena_shared.vda5050.request import RequestStatus
from nena_shared.vda5050.responses import GrantType, Response
from nena_shared.vda5050.zone_set import Vertex, Zone, ZoneSet, ZoneType
from support.robot_core import MAP
from support.zones import zone, zone_set

SUPPORTED = frozenset({ZoneType.BLOCKED, ZoneType.RELEASE})
WALL = zone("wall", "BLOCKED", 4, 6)


def held(sets: ZoneSets) -> dict[str, str]:
    return {each.zone_set_id: each.zone_set_status.value for each in sets.states}


def with_sets(*zone_sets: ZoneSet) -> ZoneSets:
    sets = ZoneSets(SUPPORTED)
    for each in zone_sets:
        sets.add(each)
    return sets


@pytest.mark.clause("6.4.1")
def test_a_new_set_is_disabled_and_does_not_count() -> None:
    sets = with_sets(zone_set(WALL))

    assert held(sets) == {"s1": "DISABLED"}
    assert sets.enabled == ()


@pytest.mark.clause("6.4.2")
def test_an_enabled_set_replaces_the_other_set_of_its_map() -> None:
    sets = with_sets(
        zone_set(WALL),
        zone_set(zone("w2", "BLOCKED", 1, 2), zone_set_id="s2"),
        zone_set(WALL, zone_set_id="s3", map_id="attic"),
    )
    for each in ("s1", "s3", "s2"):
        sets.enable(each)

    assert held(sets) == {"s1": "DISABLED", "s2": "ENABLED", "s3": "ENABLED"}
    assert {each.key for each in sets.enabled} == {("s2", "w2"), ("s3", "wall")}


@pytest.mark.clause("6.2.3/enableZoneSet", "6.2.3/deleteZoneSet")
@pytest.mark.parametrize("name", ["enable", "delete"])
def test_an_unknown_zone_set_is_not_changed(name: str) -> None:
    with pytest.raises(ZoneSetRefusedError, match="no zone set 'x'"):
        getattr(with_sets(), name)("x")


def _bow_tie() -> Zone:
    corners = ((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0))
    return Zone(zone_id="b", zone_type=ZoneType.BLOCKED, vertices=tuple(Vertex(x=x, y=y) for x, y in corners))


@pytest.mark.clause("6.4.1", "6.4/others")
@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        (zone("slow", "SPEED_LIMIT", 0, 1, maximum_speed=1.0), "does not support"),
        (_bow_tie(), "crosses itself"),
    ],
)
def test_an_unsupported_zone_is_refused(bad: Zone, problem: str) -> None:
    sets = ZoneSets(SUPPORTED)

    with pytest.raises(ZoneSetRefusedError, match=problem):
        sets.add(zone_set(WALL, bad))
    assert sets.held == ()


@pytest.mark.clause("6.4.1")
def test_the_number_of_sets_zones_and_vertices_is_limited() -> None:
    sets = with_sets(*(zone_set(WALL, zone_set_id=f"s{number}") for number in range(MAXIMUM_ZONE_SETS)))

    with pytest.raises(ZoneSetLimitError):
        sets.add(zone_set(WALL, zone_set_id="one more"))
    with pytest.raises(ZoneSetLimitError):
        with_sets(zone_set(*(zone(f"z{number}", "BLOCKED", 0, 1) for number in range(MAXIMUM_ZONES + 1))))


@pytest.mark.clause("6.4.2")
def test_stored_zone_sets_can_be_restored() -> None:
    sets = with_sets(zone_set(WALL), zone_set(WALL, zone_set_id="s2"))
    sets.enable("s2")
    again = ZoneSets(SUPPORTED)

    again.restore(sets.held)

    assert again.states == sets.states
    assert again.enabled == sets.enabled


NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
NOWHERE: frozenset[ZoneKey] = frozenset()


def gate(name: str) -> EnabledZone:
    made = zone(name, "RELEASE", 13, 17)
    contour = tuple((each.x, each.y) for each in made.vertices)
    return EnabledZone(MAP, "s", made, contour, bounding_box(contour))


A, B = gate("a"), gate("b")
IN_A = frozenset({A.key})


def response(request_id: str, grant: GrantType, *, lasting: float | None = None) -> Response:
    until = None if lasting is None else NOON + timedelta(seconds=lasting)
    return Response(request_id=request_id, grant_type=grant, lease_expiry=until)


def asked(*, status: RequestStatus = RequestStatus.REQUESTED, lasting: float | None = None) -> ZoneRequests:
    """Return one that requested A, and has been answered if the status says so."""
    expiry = None if lasting is None else NOON + timedelta(seconds=lasting)
    return ZoneRequests([AccessRequest(*A.key, "zone-1", status, expiry)], last_number=1)


def test_zones_with_the_same_id_in_two_sets_are_different() -> None:
    other = EnabledZone(MAP, "t", A.zone, A.contour, A.bounding_box)
    access = ZoneRequests()
    access.request([A, other], now=0.0)
    assert [each.zone_set_id for each in access.states] == ["s", "t"]
    access.apply(response("zone-2", GrantType.GRANTED), NOWHERE, 0.0)
    assert (access.status(A.key), access.status(other.key)) == (
        RequestStatus.REQUESTED,
        RequestStatus.GRANTED,
    )


def test_a_request_never_granted_is_removed_when_rejected_even_inside_the_zone() -> None:
    access = asked()
    access.apply(response("zone-1", GrantType.REJECTED), IN_A, 0.0)
    assert access.requests == ()
    access.request([A], now=1.0)
    assert access.requests == ()


@pytest.mark.parametrize(
    ("after", "inside", "status"),
    [
        (59.9, IN_A, RequestStatus.GRANTED),
        (60.0, IN_A, RequestStatus.EXPIRED),
        (60.0, NOWHERE, None),
    ],
)
def test_a_lease_ends_at_its_expiry(
    after: float, inside: frozenset[ZoneKey], status: RequestStatus | None
) -> None:
    access = asked(status=RequestStatus.GRANTED, lasting=60)
    assert access.waits
    access.expire(NOON + timedelta(seconds=after), inside)
    assert access.status(A.key) is status
    assert access.waits is (status is RequestStatus.GRANTED)


SECONDS = st.sampled_from([0.0, 1.0, REQUEST_RETRY_DELAY, 60.0])
INSIDE = st.sampled_from([NOWHERE, IN_A, frozenset({A.key, B.key})])


class AccessMachine(RuleBasedStateMachine):
    """Whatever fleet control answers, and whenever."""

    def __init__(self) -> None:
        super().__init__()
        self.access = ZoneRequests()
        self.now = 0.0
        self.inside: frozenset[ZoneKey] = NOWHERE
        self.given: dict[str, ZoneKey] = {}
        self.before: tuple[int, tuple[AccessRequest, ...]] = (0, ())

    @rule(zones=st.lists(st.sampled_from([A, B]), max_size=2), seconds=SECONDS)
    def want(self, zones: list[EnabledZone], seconds: float) -> None:
        self.now += seconds
        known = set(self.given)
        self.access.request(zones, self.now)
        new = {each.request_id: each.key for each in self.access.requests if each.request_id not in known}
        assert all(int(each.split("-")[1]) > len(known) for each in new), "no id is used twice"
        self.given |= new

    @rule(
        number=st.integers(1, 6),
        grant=st.sampled_from(GrantType),
        lasting=st.none() | SECONDS,
        inside=INSIDE,
    )
    def answer(
        self, number: int, grant: GrantType, lasting: float | None, inside: frozenset[ZoneKey]
    ) -> None:
        self.inside = inside
        lasting = None if lasting is None else self.now + lasting
        self.access.apply(response(f"zone-{number}", grant, lasting=lasting), inside, self.now)
        self.access.keep_only(frozenset({A.key, B.key}), inside)

    @rule(seconds=SECONDS, inside=INSIDE)
    def expire(self, seconds: float, inside: frozenset[ZoneKey]) -> None:
        self.now += seconds
        self.inside = inside
        utc = NOON + timedelta(seconds=self.now)
        self.access.expire(utc, inside)
        self.access.keep_only(frozenset({A.key, B.key}), inside)
        leases = (each.lease_expiry for each in self.access.requests)
        assert all(each > utc for each in leases if each), "nobody drives on a lease that is over"

    @invariant()
    def each_zone_has_one_request_and_its_own(self) -> None:
        requests = self.access.requests
        assert len({each.key for each in requests}) == len(requests)
        assert all(self.given[each.request_id] == each.key for each in requests)

    @invariant()
    def what_is_lost_is_only_shown_inside(self) -> None:
        assert all(each.key in self.inside for each in self.access.requests if each.status in LOST)

    @invariant()
    def each_change_is_told_by_the_revision(self) -> None:
        revision, requests = self.before
        self.before = self.access.revision, self.access.requests
        assert self.access.revision != revision or self.access.requests == requests


TestAnyAnswers = AccessMachine.TestCase
TestAnyAnswers.settings = settings(max_examples=60, stateful_step_count=20, deadline=None)
