"""How the way of the robot shows in its messages."""

from __future__ import annotations

from datetime import datetime, timedelta
from functools import lru_cache
from itertools import pairwise
from math import dist

from nena_edge_agent.protocol.journey import Journey, Way
from nena_shared.vda5050.error import ErrorReference
from nena_shared.vda5050.state import InfoLevel, Information, IntermediatePath, PathPoint


def progress_information(journey: Journey) -> tuple[Information, ...]:
    """Tell what is driven and what is left of the goal and of the order, in metres and percent."""
    ways = {"goal": journey.to_goal, "order": journey.to_end}
    known = {name: way for name, way in ways.items() if way}
    if not known:
        return ()
    references = [each for name, way in known.items() for each in _references(name, way)]
    if journey.recoveries:
        references.append(_reference("recoveries", str(journey.recoveries)))
    sentences = [
        f"{way.left:.1f} m of the {name} are left, {way.percent} % driven" for name, way in known.items()
    ]
    return (
        Information(
            info_type="progress",
            info_level=InfoLevel.INFO,
            info_references=tuple(references),
            info_descriptor="; ".join(sentences),
        ),
    )


def intermediate_path(journey: Journey, start: datetime, speed: float) -> IntermediatePath | None:
    """Give navigation's plan with the times at which the robot will be there, None without a plan.

    ``start`` is when the robot is at its beginning, ``speed`` the one in m/s that it is thought to drive at.
    """
    plan = journey.plan
    if plan is None or speed <= 0:
        return None
    ways = [0.0]
    for one, other in pairwise(plan.points):
        ways.append(ways[-1] + dist(one, other))
    points = (
        PathPoint(x=x, y=y, eta=start + timedelta(seconds=way / speed))
        for (x, y), way in zip(plan.points, ways, strict=True)
    )
    return IntermediatePath(polyline=tuple(points))


def _references(name: str, way: Way) -> tuple[ErrorReference, ErrorReference]:
    return (
        _reference(f"{name}DistanceLeft", f"{way.left:.2f}"),
        _reference(f"{name}Percent", str(way.percent)),
    )


@lru_cache(maxsize=1024)
def _reference(key: str, value: str) -> ErrorReference:
    return ErrorReference(reference_key=key, reference_value=value)
