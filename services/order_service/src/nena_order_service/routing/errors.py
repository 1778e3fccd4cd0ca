"""What can go wrong when a way is looked for."""

from collections.abc import Iterable

from nena_shared.plant import Vehicle


class NoRouteError(Exception):
    """No way leads from `source` to any of `destinations` for this vehicle without what it is to avoid."""

    def __init__(
        self, source: str, destinations: Iterable[str], vehicle: Vehicle | None, avoid: Iterable[str]
    ) -> None:
        self.source = source
        self.destinations = tuple(destinations)
        self.vehicle = None if vehicle is None else vehicle.name
        self.avoid = tuple(sorted(avoid))
        super().__init__(self._text())

    def _text(self) -> str:
        goal = " or ".join(map(repr, self.destinations)) or "a place that no vehicle can reach"
        who = f" for vehicle {self.vehicle!r}" if self.vehicle else ""
        without = f" without {', '.join(map(repr, self.avoid))}" if self.avoid else ""
        return (
            f"No route from {self.source!r} to {goal}{who}{without}. "
            "Look for locked paths, missing reverse speeds and one-way tracks in the plant model, "
            "and for what is closed to the vehicle's type, load or size or lies on another map."
        )
