from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner, Result

from nena_cli.__main__ import app
from nena_cli.diagnosis import explain_order, explain_vehicle, with_services
from nena_client import ServiceState
from nena_shared.fleet_api.attention import Acknowledgement, AttentionList, Matter, MatterKind, advice_on
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import Hold, TransportOrderState, TransportOrderStatus
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus

NOW = datetime(2026, 1, 1, 12, tzinfo=UTC)


def vehicle(
    name: str, state: VehicleState = VehicleState.EXECUTING, *behind: str, **more: Any
) -> VehicleStatus:
    wait = TrafficWait(
        vehicles=behind, at="B", cause=WaitCause.PASSES, reason=f"waits for {', '.join(behind)}"
    )
    return VehicleStatus.model_validate(
        {
            "name": name,
            "manufacturer": "NeNa",
            "serial_number": name,
            "state": state,
            "processing_state": ProcessingState.IDLE,
            "connection": "ONLINE",
            "reason": "reason of " + name,
            "wait": wait if behind else None,
            **more,
        }
    )


def order(name: str, state: TransportOrderState, **more: Any) -> TransportOrderStatus:
    return TransportOrderStatus.model_validate(
        {
            "name": name,
            "version": 1,
            "state": state,
            "reason": "reason of " + name,
            "type": "-",
            "priority": 0,
            "drive_orders": (),
            "current_drive_order_index": -1,
            "created": NOW,
            **more,
        }
    )


def test_a_circle_is_left_by_rerouting_its_first_vehicle() -> None:
    fleet = [
        vehicle("V-1", VehicleState.EXECUTING, "V-2"),
        vehicle("V-2", VehicleState.EXECUTING, "V-1"),
        vehicle("V-3", VehicleState.EXECUTING, "V-1"),
    ]
    advice = explain_vehicle("V-3", {each.name: each for each in fleet}).advice
    assert "nena vehicles reroute V-1 --forced" in advice


def test_a_waiting_vehicle_is_explained_to_the_head_of_its_queue() -> None:
    fleet = {
        "V-1": vehicle("V-1", VehicleState.EXECUTING, "V-2"),
        "V-2": vehicle("V-2", VehicleState.EXECUTING, "V-3"),
        "V-3": vehicle("V-3", VehicleState.ERROR, errors=("emergency stop",)),
    }
    found = explain_vehicle("V-1", fleet)

    assert [(each.name, each.state, each.reason) for each in found.steps] == [
        ("V-1", "WAITING", "waits for V-2"),
        ("V-2", "WAITING", "waits for V-3"),
        ("V-3", "ERROR", "reason of V-3; emergency stop"),
    ]
    assert "nena vehicles show V-3" in found.advice


def test_a_vehicle_behind_one_that_is_not_known() -> None:
    found = explain_vehicle("V-1", {"V-1": vehicle("V-1", VehicleState.EXECUTING, "foreign")})

    assert [each.name for each in found.steps] == ["V-1"]
    assert found.advice == ""


def test_an_order_is_explained_through_its_dependency_and_vehicle() -> None:
    fleet = {"V-1": vehicle("V-1", VehicleState.UNAVAILABLE, connection="SILENT")}
    orders = [
        order("T-2", TransportOrderState.ACTIVE),
        order("T-1", TransportOrderState.BEING_PROCESSED, processing_vehicle="V-1"),
    ]
    found = explain_order(orders, fleet)

    assert [each.name for each in found.steps] == ["T-2", "T-1", "V-1"]
    assert found.advice == "Check the robot's power, its network and its edge agent."


def test_a_held_order_is_resumed() -> None:
    hold = Hold(by="Ann", reason="tea", since=NOW)
    advice = explain_order([order("T", TransportOrderState.ACTIVE, held=hold)], {}).advice
    assert "nena orders resume T" in advice


def test_an_order_without_a_vehicle_says_its_own_reason() -> None:
    (step,) = explain_order([order("T", TransportOrderState.DISPATCHABLE)], {}).steps
    assert step.reason == "reason of T"


def test_an_order_service_that_is_not_ready_is_the_root() -> None:
    found = explain_order([order("T", TransportOrderState.DISPATCHABLE)], {})
    ready = ServiceState("active, ready", healthy=True)
    broken = ServiceState("active, not ready, The MQTT broker is not connected", healthy=False)

    assert with_services(found, {"http://a": ready}) == found
    root = with_services(found, {"http://a": ready, "http://b": broken})
    assert [(each.name, each.state) for each in root.steps] == [
        ("T", "DISPATCHABLE"),
        ("http://b", "NOT READY"),
    ]
    assert root.advice.startswith("Check the order service")


EMERGENCY = {"active_emergency_stop": "MANUAL"}
LOCKED = {"code": "but", "causes": [{"code": "travels"}, {"code": "path_locked", "causes": []}]}


@pytest.mark.parametrize(
    ("more", "state", "told", "advice"),
    [
        (EMERGENCY, "BLOCKED", "emergency stop MANUAL", "reset it when everyone is safe"),
        ({"active_emergency_stop": "REMOTE"}, "BLOCKED", "emergency stop REMOTE", "reset it"),
        ({"field_violation": True}, "BLOCKED", "protective field", "Go to the robot"),
        ({"paused": True}, "BLOCKED", "paused", "Go to the robot"),
        ({"localized": False}, "BLOCKED", "not localised", "Set its position"),
        ({"errors": ("CRITICAL bumper",)}, "ERROR", "CRITICAL bumper", "Go to the robot"),
        ({"taken_out": True}, "ERROR", "reason of V-1", "nena vehicles level V-1 TO_BE_UTILIZED"),
        (
            {"state": VehicleState.UNKNOWN, "connection": "UNREADABLE"},
            "UNKNOWN",
            "reason of V-1",
            "Compare its messages with VDA 5050",
        ),
        (
            {"state": VehicleState.UNAVAILABLE, "operating_mode": "MANUAL"},
            "UNAVAILABLE",
            "reason of V-1",
            "Switch the robot to AUTOMATIC.",
        ),
        ({"state": VehicleState.ERROR}, "ERROR", "reason of V-1", "Go to the robot"),
        (
            {"state": VehicleState.IDLE, "coded_reason": {"code": "must_recharge"}},
            "IDLE",
            "reason of V-1",
            "charging station",
        ),
        ({"coded_reason": LOCKED}, "EXECUTING", "reason of V-1", "Unlock it"),
    ],
)
def test_what_holds_a_robot_is_the_root_for_all_who_wait_behind_it(
    more: dict[str, Any], state: str, told: str, advice: str
) -> None:
    fleet = [
        vehicle("V-1", **more),
        vehicle("V-2", VehicleState.EXECUTING, "V-1"),
        vehicle("V-3", VehicleState.EXECUTING, "V-2"),
    ]
    found = explain_vehicle("V-3", {each.name: each for each in fleet})

    assert (found.steps[-1].name, found.steps[-1].state) == ("V-1", state)
    assert told in found.steps[-1].reason
    assert advice in found.advice


def matter(kind: MatterKind, subject: str = "", **more: Any) -> Matter:
    fields = {
        "id": f"{kind}:{subject}",
        "kind": kind,
        "urgent": kind.urgent,
        "subject": subject,
        "since": NOW,
        "reason": "it smokes",
        "advice": advice_on(kind, subject),
    }
    return Matter.model_validate(fields | more)


SEEN = {"acknowledged": Acknowledgement(by="Anna", at=NOW)}
READY = {"ready": True, "role": "active", "brokerConnected": True, "storeReady": True}
COUNTS = {"transportOrders": {"ACTIVE": 2}, "vehicles": {"IDLE": 3}, "oldestOrder": None}


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what the services answer by path; an exception is raised."""
    by_path: dict[str, Any] = {"/readyz": READY, "/v1/summary": COUNTS}
    make = httpx.Client

    def answer(request: httpx.Request) -> httpx.Response:
        found = by_path[request.url.path]
        if isinstance(found, Exception):
            raise found
        return found if isinstance(found, httpx.Response) else httpx.Response(200, json=found)

    monkeypatch.setattr(
        httpx, "Client", lambda **more: make(**{**more, "transport": httpx.MockTransport(answer)})
    )
    return by_path


def run_status(answers: dict[str, Any], *matters: Matter, options: tuple[str, ...] = ()) -> Result:
    found = AttentionList(attention=matters)
    answers.setdefault("/api/v1/attention", found.model_dump(mode="json", by_alias=True))
    return CliRunner().invoke(app, ["status", *options], env={"COLUMNS": "200"})


def test_status_of_a_fleet_that_needs_nobody(answers: dict[str, Any]) -> None:
    done = run_status(answers)
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines() == [
        "order service\thttp://127.0.0.1:55200: active, ready",
        "vehicles\t3: 3 IDLE",
        "open orders\t2: 2 ACTIVE",
        "needs attention\tnothing",
    ]


def test_status_lists_what_needs_a_person_and_what_it_holds_up(answers: dict[str, Any]) -> None:
    stop = matter(MatterKind.EMERGENCY_STOP, "AMR-1", robot_count=3, order_count=1)
    done = run_status(answers, stop, matter(MatterKind.PATH_LOCKED, "A --- B", **SEEN))
    assert done.exit_code == 1, done.output
    rows = [line.split("\t") for line in done.stdout.splitlines()[3:]]
    assert [(row[0], row[1], row[3], row[4]) for row in rows] == [
        (
            "emergency stop",
            "AMR-1",
            "it smokes (holds up 3 robots, 1 order)",
            "Find out why it was triggered; reset it when everyone is safe.",
        ),
        (
            "path locked",
            "A --- B",
            "it smokes (acknowledged by Anna)",
            "Unlock it when it is free, in the control panel or by nena paths unlock.",
        ),
    ]


def test_status_is_0_once_everything_is_acknowledged(answers: dict[str, Any]) -> None:
    done = run_status(answers, matter(MatterKind.JAM, "AMR-1", **SEEN), options=("--json",))
    assert done.exit_code == 0, done.output
    (shown,) = json.loads(done.stdout)["attention"]
    assert shown["acknowledged"]["by"] == "Anna"


def test_status_counts_what_it_does_not_list(answers: dict[str, Any]) -> None:
    done = run_status(answers, *(matter(MatterKind.ORDER_LATE, f"T-{number}") for number in range(23)))
    assert "and 3 more" in done.stdout


@pytest.mark.parametrize(
    ("path", "answer", "told"),
    [
        ("/api/v1/attention", httpx.ConnectError("refused"), "NENA_AGGREGATOR_URL"),
        ("/api/v1/attention", httpx.Response(401, json={"detail": "Sign in."}), "Sign in."),
        ("/api/v1/attention", httpx.Response(404, text="?"), "is it a status aggregator?"),
        ("/api/v1/attention", {"name": "another program"}, "is not a status aggregator"),
        ("/readyz", httpx.ConnectError("refused"), "not reachable: refused"),
        ("/readyz", {**READY, "ready": False, "problems": ["disk full"]}, "not ready, disk full"),
    ],
)
def test_status_is_2_if_a_service_does_not_answer(
    answers: dict[str, Any], path: str, answer: Any, told: str
) -> None:
    answers |= {path: answer, "/v1/summary": httpx.ConnectError("refused")}
    done = run_status(answers)
    assert (done.exit_code, told in done.output) == (2, True), done.output


def test_status_is_1_if_the_list_says_that_the_order_service_is_down(answers: dict[str, Any]) -> None:
    answers |= {"/readyz": httpx.ConnectError("refused"), "/v1/summary": httpx.ConnectError("refused")}
    done = run_status(answers, matter(MatterKind.ORDER_SERVICE_DOWN))
    assert (done.exit_code, "vehicles" in done.stdout) == (1, False), done.output


def test_status_waits_once_and_briefly_for_an_order_service_that_hangs(answers: dict[str, Any]) -> None:
    answers |= {"/readyz": httpx.ReadTimeout("timed out")}
    answers["/v1/summary"] = AssertionError("asked although it hangs")
    done = run_status(answers, matter(MatterKind.ORDER_SERVICE_DOWN))
    assert (done.exit_code, "not reachable: timed out" in done.stdout) == (1, True), done.output
