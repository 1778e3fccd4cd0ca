"""The predefined actions that the core itself does (section 6.2.3)."""

from __future__ import annotations

from collections.abc import Mapping

from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.rules import Rules

CANCEL_ORDER = "cancelOrder"
START_PAUSE = "startPause"
STOP_PAUSE = "stopPause"
STATE_REQUEST = "stateRequest"
FACTSHEET_REQUEST = "factsheetRequest"
INITIALIZE_POSITION = "initializePosition"
"""``initPosition`` in 2.x."""
CLEAR_INSTANT_ACTIONS = "clearInstantActions"
RETRY = "retry"
SKIP_RETRY = "skipRetry"
TRIGGER = "trigger"
ENABLE_ZONE_SET = "enableZoneSet"
DELETE_ZONE_SET = "deleteZoneSet"
WAIT_FOR_TRIGGER = "waitForTrigger"
DOWNLOAD_ZONE_SET = "downloadZoneSet"
DOWNLOAD_MAP = "downloadMap"
ENABLE_MAP = "enableMap"
DELETE_MAP = "deleteMap"
MAP_ACTIONS = frozenset({DOWNLOAD_MAP, ENABLE_MAP, DELETE_MAP})
TRIGGER_TYPE = "triggerType"

_POSITION = (
    Parameter("x", ValueDataType.NUMBER, description="m"),
    Parameter("y", ValueDataType.NUMBER, description="m"),
    Parameter("theta", ValueDataType.NUMBER, description="rad"),
    Parameter("mapId", ValueDataType.STRING),
    Parameter("lastNodeId", ValueDataType.STRING),
)


_WHICH = (Parameter("actionId", ValueDataType.STRING, description="of the RETRIABLE action"),)


_ZONE_SET = (Parameter("zoneSetId", ValueDataType.STRING),)


def _instant(action_type: str, description: str, parameters: tuple[Parameter, ...] = ()) -> ActionDeclaration:
    return ActionDeclaration(
        action_type, scopes=(ActionScope.INSTANT,), parameters=parameters, description=description
    )


def _on_node_too(
    action_type: str, description: str, parameters: tuple[Parameter, ...] = ()
) -> ActionDeclaration:
    return ActionDeclaration(
        action_type,
        scopes=(ActionScope.INSTANT, ActionScope.NODE),
        parameters=parameters,
        description=description,
    )


PREDEFINED: dict[str, ActionDeclaration] = {
    each.action_type: each
    for each in (
        _instant(
            CANCEL_ORDER,
            "Stops the robot where it is and ends the order.",
            (Parameter("orderId", ValueDataType.STRING, required=False),),
        ),
        _instant(START_PAUSE, "Stops driving and holds actions that can be held."),
        _instant(STOP_PAUSE, "Lets driving and held actions go on."),
        _instant(STATE_REQUEST, "Has the robot send its state."),
        _instant(FACTSHEET_REQUEST, "Has the robot send its factsheet."),
        _instant(INITIALIZE_POSITION, "Tells the localisation where the robot is.", _POSITION),
        _on_node_too(CLEAR_INSTANT_ACTIONS, "Takes the ended instant actions out of the state."),
        _on_node_too(ENABLE_ZONE_SET, "Has a zone set count in place of another one of its map.", _ZONE_SET),
        _instant(DELETE_ZONE_SET, "Forgets a zone set that is not enabled.", _ZONE_SET),
        _instant(RETRY, "Begins an action anew that failed and may be tried again.", _WHICH),
        _instant(SKIP_RETRY, "Lets an action that may be tried again be failed.", _WHICH),
        _instant(TRIGGER, "Releases the actions that wait for fleet control."),
        ActionDeclaration(
            WAIT_FOR_TRIGGER,
            scopes=(ActionScope.NODE,),
            parameters=(
                Parameter(TRIGGER_TYPE, ValueDataType.ARRAY, description="FLEET_CONTROL, LOCAL or others"),
            ),
            cancel_allowed=True,
            description="Waits until one of the triggers is pulled.",
        ),
    )
}
"""Declarations by action type."""


def spoken(declarations: Mapping[str, ActionDeclaration], rules: Rules) -> dict[str, ActionDeclaration]:
    """Leave out the predefined actions that a version of the standard does not have."""
    unknown: set[str] = set()
    if ActionStatus.RETRIABLE not in rules.action_statuses:
        unknown |= {RETRY, SKIP_RETRY}
    if not rules.instant_states_until_cleared:
        unknown.add(CLEAR_INSTANT_ACTIONS)
    if not rules.trigger_by_action:
        unknown.add(TRIGGER)
    if not rules.maps:
        unknown |= MAP_ACTIONS
    if not rules.zones:
        unknown |= {ENABLE_ZONE_SET, DELETE_ZONE_SET, DOWNLOAD_ZONE_SET}
    return {name: each for name, each in declarations.items() if name not in unknown}
