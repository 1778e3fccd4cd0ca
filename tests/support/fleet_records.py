"""Messages of a small fleet, as services read them."""

from __future__ import annotations

import json
from typing import Any, TypeVar

from msgspec.structs import replace

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.records import record_of
from nena_shared.vda5050.state import MobileRobotPosition, State
from nena_shared.vda5050.v3_0 import CODEC
from nena_shared.vda5050.visualization import Visualization
from support import fleet_examples

H = TypeVar("H", bound=Header)


def state(number: int = 1, **content: Any) -> State:
    """Return the record of a state, see :func:`fleet_examples.state`."""
    return recorded(State, fleet_examples.state(number, **content))


def visualization(number: int = 1, **content: Any) -> Visualization:
    """Return the record of a visualization, see :func:`fleet_examples.visualization`."""
    return recorded(Visualization, fleet_examples.visualization(number, **content))


def recorded(kind: type[H], message: H) -> H:
    """Return the record of a message, encoded in the newest version, which has most fields."""
    record: Any = record_of(kind, CODEC, json.loads(CODEC.encode(message)))
    assert record is not None
    again: H = replace(record, version=message.version)
    return again


def place(x: float, y: float, *, map_id: str = "hall", localized: bool = True) -> MobileRobotPosition:
    """Return a position, m."""
    return MobileRobotPosition(x=x, y=y, theta=0.0, map_id=map_id, localized=localized)
