"""Routes: the steps that lead a vehicle from one point to another."""

from dataclasses import dataclass

from nena_shared.plant import DirectedEdge, Orientation, Path
from nena_shared.plant.geometry import MM_PER_M


@dataclass(frozen=True, slots=True)
class Step:
    """One edge of a route and what it costs (the unit is that of the chosen evaluators, mm by default)."""

    edge: DirectedEdge
    cost: float

    @property
    def edge_id(self) -> str:
        """The id of the edge: the path's name, with a suffix for the backward direction."""
        return self.edge.id

    @property
    def path(self) -> Path:
        """The path that is driven."""
        return self.edge.path

    @property
    def source(self) -> str:
        """The name of the point where the step begins."""
        return self.edge.source

    @property
    def destination(self) -> str:
        """The name of the point where the step ends."""
        return self.edge.destination

    @property
    def orientation(self) -> Orientation:
        """Whether the path is driven forward or backward."""
        return self.edge.orientation


@dataclass(frozen=True, slots=True)
class Route:
    """A way from `source` to `destination`; without steps if the vehicle is there already."""

    source: str
    destination: str
    steps: tuple[Step, ...]

    @property
    def cost(self) -> float:
        """The sum of the steps' costs."""
        return sum((step.cost for step in self.steps), start=0.0)

    @property
    def length_m(self) -> float:
        """The length of the way in metres, whatever the costs are."""
        return sum(step.path.length_mm for step in self.steps) / MM_PER_M

    @property
    def points(self) -> tuple[str, ...]:
        """The names of all points on the way, with both ends."""
        return (self.source, *(step.destination for step in self.steps))
