"""Where a vehicle may drive at all, whatever it costs."""

from collections.abc import Mapping

from nena_order_service.routing.profile import RoutingProfile
from nena_shared.plant import DirectedEdge, Path, PlantModel, Point
from nena_shared.plant.geometry import MM_PER_M
from nena_shared.plant.vehicle_type import VehicleTypeOnPath


class Access:
    """Which edges of a plant are open to vehicles of one profile.

    Closed are locked paths, directions in which path or vehicle have no speed, what the plant does not open
    to the vehicle's type, load or height, and points on maps where it must not drive. A vehicle that stands
    on a point which is closed to it may leave.
    """

    def __init__(
        self, plant: PlantModel, profile: RoutingProfile, locks: Mapping[str, bool] | None = None
    ) -> None:
        """Look at a plant; `locks` says of paths whether they are locked, over what the plant says."""
        self._points = plant.points_by_name
        self._profile = profile
        self._locks = locks or {}

    def allows(self, edge: DirectedEdge) -> bool:
        """Whether such a vehicle may drive along the edge."""
        return (
            not self._locks.get(edge.path.name, edge.path.locked)
            and self._profile.speed_mm_s(edge) > 0
            and self._path_is_open(edge.path)
            and self._point_is_open(self._points[edge.destination])
        )

    def _path_is_open(self, path: Path) -> bool:
        types = self._profile.vehicle_types
        return all(map(path.is_open_to, types)) and all(map(self._fits, self._profile.uses_of(path)))

    def _fits(self, use: VehicleTypeOnPath) -> bool:
        box = self._profile.bounding_box
        low_enough = use.max_height is None or box is None or box.height_mm <= use.max_height * MM_PER_M
        return low_enough and use.allows(loaded=self._profile.loaded)

    def _point_is_open(self, point: Point) -> bool:
        maps = self._profile.allowed_maps
        on_map = maps is None or point.map_id is None or point.map_id in maps
        return on_map and all(map(point.is_open_to, self._profile.vehicle_types))
