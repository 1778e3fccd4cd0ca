"""Cost evaluators: what it costs to drive along an edge. A router adds up those that are chosen for it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isnan
from types import MappingProxyType
from typing import Final, Protocol

from nena_order_service.routing.profile import RoutingProfile
from nena_shared.plant import DirectedEdge, Orientation, PlantModel, property_keys


class CostEvaluator(Protocol):
    """Returns the cost of an edge, 0 or more; infinity and NaN exclude the edge."""

    def __call__(self, edge: DirectedEdge, profile: RoutingProfile, /) -> float:
        """Return what it costs a vehicle of this profile to drive along the edge."""
        ...


class CostKey(StrEnum):
    """The names by which settings choose evaluators."""

    DISTANCE = "DISTANCE"
    TRAVELTIME = "TRAVELTIME"
    HOPS = "HOPS"
    EXPLICIT_PROPERTIES = "EXPLICIT_PROPERTIES"
    BOUNDING_BOX = "BOUNDING_BOX"


def distance(edge: DirectedEdge, _profile: RoutingProfile, /) -> float:
    """Return the length of the path in mm."""
    return float(edge.path.length_mm)


def travel_time(edge: DirectedEdge, profile: RoutingProfile, /) -> float:
    """Return the seconds that the way takes at the slower of the path's and the vehicle's highest speeds."""
    speed_mm_s = profile.speed_mm_s(edge)
    return edge.path.length_mm / speed_mm_s if speed_mm_s else inf


def hops(_edge: DirectedEdge, _profile: RoutingProfile, /) -> float:
    """Return 1, so that the route with the fewest paths is the cheapest."""
    return 1.0


@dataclass(frozen=True, slots=True)
class ExplicitProperties:
    """Costs written at the paths for each group: `tcs:routingCostForward<GROUP>` and `...Reverse<GROUP>`.

    Where the property is missing or no number from 0 up, the cost is `missing`: high, so that such a path is
    used only where there is no other way.
    """

    missing: float = 1_000_000.0

    def __call__(self, edge: DirectedEdge, profile: RoutingProfile, /) -> float:
        """Return the written cost; `Infinity` excludes the edge."""
        forward = edge.orientation is Orientation.FORWARD
        key = property_keys.ROUTING_COST_FORWARD if forward else property_keys.ROUTING_COST_REVERSE
        try:
            cost = float(edge.path.properties[key + profile.group])
        except (KeyError, ValueError):
            return self.missing
        return self.missing if isnan(cost) or cost < 0 else cost


class BoundingBoxLimit:
    """Excludes edges to points where the vehicle would stand out of the largest box that is allowed there.

    Costs nothing otherwise, so it goes together with other evaluators. Boxes are laid on each other by their
    reference points.
    """

    def __init__(self, plant: PlantModel) -> None:
        self._points = plant.points_by_name

    def __call__(self, edge: DirectedEdge, profile: RoutingProfile, /) -> float:
        """Return 0, or infinity where the vehicle is too large."""
        box = profile.bounding_box
        limit = self._points[edge.destination].max_vehicle_bounding_box
        return 0.0 if box is None or limit.holds(box) else inf


_EVALUATORS: Final[Mapping[CostKey, CostEvaluator]] = MappingProxyType(
    {
        CostKey.DISTANCE: distance,
        CostKey.TRAVELTIME: travel_time,
        CostKey.HOPS: hops,
        CostKey.EXPLICIT_PROPERTIES: ExplicitProperties(),
    }
)


def evaluators(keys: Iterable[CostKey], plant: PlantModel) -> tuple[CostEvaluator, ...]:
    """Return the evaluators that settings choose, for one plant."""
    return tuple(BoundingBoxLimit(plant) if key is CostKey.BOUNDING_BOX else _EVALUATORS[key] for key in keys)
