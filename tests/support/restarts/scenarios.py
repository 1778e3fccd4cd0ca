"""Orders of all kinds for a robot whose agent dies."""

from __future__ import annotations

from pydantic import JsonValue

from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import State
from support.restarts.scenario import Scenario, Step, When, instants
from support.robot_core import MAP, action, order
from support.zones import transfer, zone

PASS = {"drive": {"strategy": "pass_through", "pass_radius": 1.0, "deviation_xy": 1.0}}
STOP = {"drive": {"strategy": "stop_at_nodes"}}


def reached(sequence_id: int, order_id: str = "o1") -> When:
    """Wait until a node is reached."""
    return lambda state: state.order_id == order_id and state.last_node_sequence_id >= sequence_id


def ended(order_id: str) -> When:
    """Wait until an order has nothing left to do."""

    def when(state: State) -> bool:
        return state.order_id == order_id and not state.node_states and all_ended(state)

    return when


def shown(action_id: str, *statuses: str) -> When:
    """Wait until an action is in one of ``statuses``."""

    def when(state: State) -> bool:
        states = (*state.action_states, *state.instant_action_states)
        return any(each.action_id == action_id and each.action_status in statuses for each in states)

    return when


def all_ended(state: State) -> bool:
    """Return whether no action of the order is left."""
    ended_ones = (ActionStatus.FINISHED, ActionStatus.FAILED)
    return all(each.action_status in ended_ones for each in state.action_states)


ACTIONS = {
    "n1": [action("pick", "HARD", "pick")],
    "n2": [action("soft", "SOFT"), action("none", "NONE")],
    "n3": [action("press", "HARD", "press"), action("last", "HARD")],
}
PLACE: dict[str, JsonValue] = {"x": 0.0, "y": 0.0, "theta": 0.0, "mapId": MAP, "lastNodeId": "n0"}
EDGE_ACTIONS = {"n1-n2": [action("lamp", "NONE", "lamp")]}


WAY = order("n0", "n1", "n2", "n3")
WORK = order("n0", "n1", "n2", "n3", node_actions=ACTIONS, edge_actions=EDGE_ACTIONS)
BACK = order("n3", "n2", order_id="o2", node_actions={"n2": [action("drop", "SOFT")]})
CANCEL = action("cancel", "NONE", "cancelOrder")


def _orders() -> tuple[Scenario, ...]:
    two = order("n0", "n1", "n2", "n3", released=2)
    more = order("n1", "n2", "n3", "n4", update=1, first=2, released=2, node_actions={"n2": ACTIONS["n2"]})
    rest = order("n2", "n3", "n4", update=2, first=4, node_actions={"n4": [action("end", "HARD")]})
    return (
        Scenario("stop at nodes", [Step(WAY), Step(BACK, ended("o1"))], settings=STOP),
        Scenario("pass through", [Step(WAY), Step(BACK, ended("o1"))], settings=PASS),
        Scenario("actions", [Step(WORK)], settings=PASS),
        Scenario("actions of 3.0", [Step(WORK), Step(BACK, ended("o1"))], version="3.0.0", settings=STOP),
        Scenario("updates", [Step(two), Step(more, reached(0)), Step(rest, reached(2))], settings=PASS),
    )


def _interventions() -> tuple[Scenario, ...]:
    pause, go_on = action("pause", "NONE", "startPause"), action("go on", "NONE", "stopPause")
    return (
        Scenario(
            "pause",
            [
                Step(WORK),
                Step(instants(pause), reached(4)),
                Step(instants(go_on), shown("pause", "FINISHED", "FAILED")),
            ],
            settings=PASS,
            changeful=True,
        ),
        Scenario(
            "cancel",
            [
                Step(WORK),
                Step(instants(CANCEL), reached(2)),
                Step(instants(action("i", "NONE")), ended("o1")),
            ],
            settings=STOP,
            changeful=True,
        ),
        Scenario(
            "instant actions",
            [
                Step(WAY),
                Step(instants(action("i1", "NONE"), action("i2", "NONE", "press")), reached(0)),
                Step(instants(action("i3", "NONE", "stateRequest")), reached(2)),
            ],
            settings=PASS,
        ),
    )


def _only_in_3_0() -> tuple[Scenario, ...]:
    slow = zone("slow", "SPEED_LIMIT", 5.0, 8.0, maximum_speed=0.5)
    release = zone("ask", "RELEASE", 14.0, 16.0)
    wait = action("wait", "HARD", "waitForTrigger", triggerType=["FLEET_CONTROL"])
    held = order("n0", "n1", "n2", node_actions={"n1": [wait]})
    return (
        Scenario(
            "zones",
            [
                Step(transfer(slow, release)),
                Step(instants(action("enable", "NONE", "enableZoneSet", zoneSetId="s1"))),
                Step(WAY, shown("enable", "FINISHED")),
                Step(BACK, ended("o1")),
            ],
            version="3.0.0",
            settings=PASS,
        ),
        Scenario(
            "a cancel at a node, and another order",
            [
                Step(held),
                Step(instants(CANCEL), shown("wait", "RUNNING")),
                Step(order("n1", "n0", order_id="o2"), shown("cancel", "FINISHED")),
            ],
            version="3.0.0",
            settings=STOP,
        ),
        Scenario(
            "a position and a trigger",
            [
                Step(instants(action("place", "NONE", "initializePosition", retriable=None, **PLACE))),
                Step(held, shown("place", "FINISHED", "FAILED")),
                Step(instants(action("go", "NONE", "trigger")), shown("wait", "RUNNING")),
                Step(instants(action("tidy up", "NONE", "clearInstantActions")), ended("o1")),
            ],
            version="3.0.0",
            settings=STOP,
        ),
    )


SCENARIOS = {each.name: each for each in (*_orders(), *_interventions(), *_only_in_3_0())}
