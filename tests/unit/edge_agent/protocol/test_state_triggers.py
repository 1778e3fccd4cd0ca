"""What a state is sent for (section 6.6.1), each alone, in every version that has it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

import pytest

from nena_edge_agent.driver.port import Arrived, BatteryReport, Halted
from nena_edge_agent.protocol.events import (
    ActionReport,
    ErrorSwitched,
    Event,
    MapsReport,
    OperatingModeSwitched,
    PauseButton,
    ReportState,
    ResponsesReceived,
    SafetyReport,
    ZoneSetReceived,
)
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import EmergencyStop, Load, Map, MapStatus, OperatingMode, State
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action, at, order
from support.zones import responses, transfer, zone

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
GATE = zone("gate", "RELEASE", 13, 17)
ATTIC = Map(map_id="attic", map_version="1", map_status=MapStatus.DISABLED)


def stand(_: Bench) -> None:
    """Leave the robot as it is at its start."""


def drive(bench: Bench) -> None:
    bench.send(order("n0", "n1", "n2", released=2))


def work(bench: Bench) -> None:
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))


def work_beside(bench: Bench) -> None:
    bench.instant(action("a"))


def brake(bench: Bench) -> None:
    drive(bench)
    bench.do(PauseButton(pressed=True))


def ask(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(GATE)))
    bench.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))
    bench.send(order("n0", "n1", "n2"))


def runs() -> Event:
    return ActionReport("a", ActionStatus.RUNNING)


def sends_one_state(bench: Bench, event: Event, read: Callable[[State], object]) -> bool:
    """Return whether ``event`` changes what ``read`` returns, and exactly one state is sent for it."""
    before = read(bench.state)
    effects = bench.do(event)
    return read(bench.state) != before and effects.count(ReportState()) == 1


@pytest.mark.parametrize("version", RULES)
@pytest.mark.parametrize(
    ("prepare", "event", "read"),
    [
        pytest.param(
            work,
            ActionReport("a", ActionStatus.RUNNING, loads=(Load(load_id="b"),)),
            lambda state: state.loads,
            id="loads",
            marks=pytest.mark.clause("6.6.1/loads"),
        ),
        pytest.param(
            stand,
            ErrorSwitched(ErrorEntry(error_type="x", error_level=ErrorLevel.WARNING), active=True),
            lambda state: state.errors,
            id="errors",
            marks=pytest.mark.clause("6.6.1/errors"),
        ),
        pytest.param(
            drive,
            Arrived(1),
            lambda state: (state.last_node_id, state.node_states, state.edge_states),
            id="node",
            marks=pytest.mark.clause("6.6.1/node"),
        ),
        pytest.param(
            stand,
            OperatingModeSwitched(OperatingMode.SEMIAUTOMATIC),
            lambda state: state.operating_mode,
            id="operatingMode",
            marks=pytest.mark.clause("6.6.1/operatingMode"),
        ),
        pytest.param(
            brake,
            Halted(),
            lambda state: state.driving,
            id="driving",
            marks=pytest.mark.clause("6.6.1/driving"),
        ),
        pytest.param(
            work,
            runs(),
            lambda state: state.action_states,
            id="actionStates",
            marks=pytest.mark.clause("6.6.1/actionStates"),
        ),
        pytest.param(
            work_beside,
            runs(),
            lambda state: state.instant_action_states,
            id="instantActionStates",
            marks=pytest.mark.clause("6.6.1/instantActionStates"),
        ),
        pytest.param(
            stand,
            PauseButton(pressed=True),
            lambda state: state.paused,
            id="paused",
            marks=pytest.mark.clause("6.6.1/paused"),
        ),
        pytest.param(
            stand,
            SafetyReport(EmergencyStop.MANUAL),
            lambda state: state.safety_state,
            id="safetyState",
            marks=pytest.mark.clause("6.6.1/safetyState"),
        ),
        pytest.param(
            drive,
            at(9.0),
            lambda state: state.new_base_request,
            id="newBaseRequest",
            marks=pytest.mark.clause("6.6.1/newBaseRequest"),
        ),
        pytest.param(
            stand,
            BatteryReport(50.0, charging=True),
            lambda state: state.power_supply.charging,
            id="charging",
            marks=pytest.mark.clause("6.6.1/charging"),
        ),
        pytest.param(
            stand,
            MapsReport((ATTIC,)),
            lambda state: state.maps,
            id="maps",
            marks=pytest.mark.clause("6.6.1/maps"),
        ),
    ],
)
def test_common_triggers(
    version: str, prepare: Callable[[Bench], None], event: Event, read: Callable[[State], object]
) -> None:
    bench = Bench(rules=RULES[version])
    prepare(bench)

    assert sends_one_state(bench, event, read)


@pytest.mark.clause("6.6.1/zoneSets")
def test_a_received_zone_set() -> None:
    bench = Bench(rules=RULES["3.0.0"])

    assert sends_one_state(bench, ZoneSetReceived(transfer(GATE)), lambda state: state.zone_sets)


@pytest.mark.clause("6.6.1/zoneRequests")
def test_a_zone_request_that_is_granted() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    ask(bench)
    granted = ResponsesReceived(responses("zone-1", "GRANTED"), NOON)

    assert sends_one_state(bench, granted, lambda state: state.zone_requests)
