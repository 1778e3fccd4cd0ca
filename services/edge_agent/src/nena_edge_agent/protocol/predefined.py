"""The predefined instant actions that the core itself does (section 6.2.3)."""

from __future__ import annotations

from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType

CANCEL_ORDER = "cancelOrder"
START_PAUSE = "startPause"
STOP_PAUSE = "stopPause"
STATE_REQUEST = "stateRequest"
FACTSHEET_REQUEST = "factsheetRequest"
INITIALIZE_POSITION = "initializePosition"
"""``initPosition`` in 2.x."""

_POSITION = (
    Parameter("x", ValueDataType.NUMBER, description="m"),
    Parameter("y", ValueDataType.NUMBER, description="m"),
    Parameter("theta", ValueDataType.NUMBER, description="rad"),
    Parameter("mapId", ValueDataType.STRING),
    Parameter("lastNodeId", ValueDataType.STRING),
)


def _instant(action_type: str, description: str, parameters: tuple[Parameter, ...] = ()) -> ActionDeclaration:
    return ActionDeclaration(
        action_type, scopes=(ActionScope.INSTANT,), parameters=parameters, description=description
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
    )
}
"""Declarations by action type."""
