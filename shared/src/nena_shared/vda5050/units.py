"""Find numbers of robots that look as if they were in another unit than the standard's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from nena_shared.vda5050.base import Header, WireObject
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.repair import Repair, RepairKind
from nena_shared.vda5050.shape import fields_of

GREATEST: Final = 50.0
"""No robot is longer, in m, or faster, in m/s."""
_METRIC: Final = ("speed", "length", "width", "height", "depth", "diameter", "displacement", "x", "y")
"""Last words of the names of numbers in m or m/s."""


def units_in_doubt(message: Header) -> Iterator[Repair]:
    """Yield the numbers of a factsheet that may be in mm, and a charge of a state that may be a fraction."""
    if isinstance(message, Factsheet):
        yield from _long_numbers(message, "")
    # states are read as records, too
    charge = message.power_supply.state_of_charge if hasattr(message, "power_supply") else 0.0
    if 0 < charge <= 1:
        of_2_x = message.version.startswith("2.")
        field = "batteryState.batteryCharge" if of_2_x else "powerSupply.stateOfCharge"
        yield Repair(field, RepairKind.UNIT_IN_DOUBT, f"{charge:g} (a fraction?)")


def _long_numbers(part: WireObject, at: str) -> Iterator[Repair]:
    for field in fields_of(type(part)):
        value, path = getattr(part, field.name), f"{at}{field.wire[0]}"
        word = field.name.rpartition("_")[2]
        metric = isinstance(value, float) and word in _METRIC and "angular" not in field.name
        if metric and abs(value) > GREATEST:
            unit = "mm/s?" if word == "speed" else "mm?"
            yield Repair(path, RepairKind.UNIT_IN_DOUBT, f"{value:g} ({unit})")
        for inner in value if isinstance(value, tuple) else [value]:
            if isinstance(inner, WireObject):
                yield from _long_numbers(inner, f"{path}.")
