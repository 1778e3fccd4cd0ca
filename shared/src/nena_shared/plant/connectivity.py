"""Which points can be reached from which, over drivable paths that are not locked."""

from collections import defaultdict, deque
from collections.abc import Mapping

from nena_shared.plant.model import PlantModel


def cut_off_points(model: PlantModel) -> tuple[str, ...]:
    """Return the points, in the model's order, outside the strong component of the best connected one.

    Empty if every point can be reached from every other. The best connected point is the one with most edges.
    """
    forward: defaultdict[str, list[str]] = defaultdict(list)
    backward: defaultdict[str, list[str]] = defaultdict(list)
    for edge in model.edges():
        if not edge.path.locked:
            forward[edge.source].append(edge.destination)
            backward[edge.destination].append(edge.source)
    names = [point.name for point in model.points]
    if not names:
        return ()
    start = max(names, key=lambda name: min(len(forward[name]), len(backward[name])))
    connected = _reachable(start, forward) & _reachable(start, backward)
    return tuple(name for name in names if name not in connected)


def _reachable(start: str, neighbours: Mapping[str, list[str]]) -> set[str]:
    seen = {start}
    waiting = deque([start])
    while waiting:
        for name in neighbours[waiting.popleft()]:
            if name not in seen:
                seen.add(name)
                waiting.append(name)
    return seen
