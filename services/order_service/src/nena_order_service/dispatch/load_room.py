"""Whether a vehicle has room for what an order begins with picking up (VDA 5050 3.0 section 6.2.3, pick).

What robots carry stands in ``loads`` of their states (section 7.8): absent where they cannot tell, empty
where they carry nothing. How many places they have for loads stands in the load specification of their
factsheets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from nena_order_service.fleet.reported import State
from nena_shared.vda5050.factsheet import Factsheet, LoadSpecification


class Pick(NamedTuple):
    """What an order begins with: a load to be picked up before any is dropped."""

    load_type: str = ""
    """Empty: nobody says."""
    place: str = ""
    """The load handling device that is to take it (parameter lhd); empty: any."""


@dataclass(frozen=True, slots=True)
class Carried:
    """The loads of a vehicle that has some."""

    loads: tuple[str, ...]
    """At which of its places each is; empty: it does not say."""
    places: frozenset[str] = frozenset()
    """Its places for loads; none: it does not say."""
    places_of: Mapping[str, frozenset[str]] = field(default_factory=dict, hash=False)
    """Those for loads of single types."""

    def why_no_room(self, pick: Pick) -> str:
        """Say, as a predicate, why there is no room for a load; empty where there may be.

        Who does not say which places it has has one, and a load that does not say where it is is anywhere.
        """
        if pick.place:
            wanted, elsewhere = frozenset({pick.place}), frozenset(self.loads) - {"", pick.place}
        else:
            wanted = self.places_of.get(pick.load_type, self.places)
            elsewhere = self.places - wanted
        if sum(load not in elsewhere for load in self.loads) < max(len(wanted), 1):
            return ""
        loads = "a load" if len(self.loads) == 1 else f"{len(self.loads)} loads"
        where = f" at {pick.place!r}" if pick.place else ""
        return f"carries {loads}, and has no room for another one{where}"


def carried(state: State, factsheet: Factsheet | None) -> Carried | None:
    """Give what a robot says that it carries; None where that is nothing, or it cannot tell."""
    if not state.loads:
        return None
    loads = tuple(each.load_position or "" for each in state.loads)
    told = factsheet.load_specification if factsheet else None
    if told is None or not told.load_positions:
        return Carried(loads)
    return Carried(loads, frozenset(told.load_positions), _places_of(told))


def _places_of(told: LoadSpecification) -> dict[str, frozenset[str]]:
    """Give the places for loads of each type; a load set that names none is for all of them."""
    all_places, found = frozenset(told.load_positions or ()), dict[str, frozenset[str]]()
    for each in told.load_sets or ():
        places = all_places.intersection(each.load_positions or all_places)
        found[each.load_type] = found.get(each.load_type, frozenset()) | places
    return found
