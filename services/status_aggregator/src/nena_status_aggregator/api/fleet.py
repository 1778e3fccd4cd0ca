"""The fleet, ``/api/v1``: everything, single robots, transport orders, plant model."""

from __future__ import annotations

from fastapi import APIRouter, Response

from nena_shared.clock import iso
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import as_json, require
from nena_status_aggregator.fleet.view_builder import view_known_actions
from nena_status_aggregator.fleet.views import (
    FleetParts,
    KnownActionView,
    OrderView,
    PeripheralView,
    RobotView,
)


class RobotResource(RobotView):
    """A robot with the age of its last state, s; null before the first."""

    stateAge: float | None  # noqa: N815 - the name on the wire


def with_age(aggregator: Aggregator, view: RobotView) -> RobotResource:
    """Add the age of the last state to a robot's view."""
    robot = aggregator.model.robots.get(RobotKey(view["manufacturer"], view["serialNumber"]))
    age = robot.state_age(aggregator.now()) if robot else None
    return {**view, "stateAge": None if age is None else round(age, 3)}


def make_robots_router(aggregator: Aggregator) -> APIRouter:
    """Create the routes of single robots."""
    router = APIRouter(prefix="/api/v1/robots/{manufacturer}/{serial}", tags=["fleet"])
    model = aggregator.model

    @router.get("", responses={200: {"model": RobotResource}})
    async def robot(manufacturer: str, serial: str) -> Response:
        """Return one robot."""
        aggregator.publish_changes()
        view = model.robot_view(RobotKey(manufacturer, serial))
        missing = f"Unknown robot {manufacturer}/{serial}; /api/v1/fleet lists all known robots."
        return as_json(with_age(aggregator, require(view, Rejection.UNKNOWN_ROBOT, missing)))

    @router.get("/actions", responses={200: {"model": list[KnownActionView]}})
    async def actions(manufacturer: str, serial: str) -> Response:
        """Return the actions of a robot's factsheet, with their parameters."""
        robot_data = model.robots.get(RobotKey(manufacturer, serial))
        missing = f"No factsheet received from {manufacturer}/{serial}; request it with factsheetRequest."
        return as_json(
            view_known_actions(
                require(robot_data.factsheet if robot_data else None, Rejection.NO_FACTSHEET, missing)
            )
        )

    @router.get("/map", response_class=Response)
    async def robot_map(manufacturer: str, serial: str) -> Response:
        """Return a robot's grid map as a PNG image; the robot's `grid` contains its pose."""
        robot_data = model.robots.get(RobotKey(manufacturer, serial))
        missing = (
            f"No map received from {manufacturer}/{serial}; NeNa's edge agent publishes the map of its Nav2."
        )
        image = require(robot_data.map if robot_data else None, Rejection.NO_MAP, missing).png
        return Response(image, media_type="image/png", headers={"cache-control": "no-cache"})

    return router


class FleetResource(FleetParts):
    """The whole fleet. `time` is the time of the response, `id` the number of the last change it contains.

    `share` is the share of the robots that this aggregator monitors, `1/1` for all of them.
    """

    time: str
    share: str
    robots: list[RobotResource]


def make_router(aggregator: Aggregator) -> APIRouter:
    """Create the routes of the whole fleet."""
    router = APIRouter(prefix="/api/v1", tags=["fleet"])
    model = aggregator.model

    @router.get("/fleet", responses={200: {"model": FleetResource}})
    async def fleet() -> Response:
        """Return the whole fleet: robots, orders, devices, plant model summary, broker connection."""
        aggregator.publish_changes()
        view = model.snapshot()
        robots = [with_age(aggregator, robot_view) for robot_view in view["robots"]]
        time, share = iso(aggregator.now().utc), str(aggregator.share)
        return as_json({**view, "time": time, "share": share, "robots": robots})

    @router.get("/orders", responses={200: {"model": list[OrderView]}})
    async def orders() -> Response:
        """Return all transport orders."""
        aggregator.publish_changes()
        return as_json(model.snapshot()["orders"])

    @router.get("/peripherals", responses={200: {"model": list[PeripheralView]}})
    async def peripherals() -> Response:
        """Return all peripheral devices, such as doors, with their jobs."""
        aggregator.publish_changes()
        return as_json(model.snapshot()["peripherals"])

    @router.get("/plant")
    async def plant() -> Response:
        """Return the plant model published by the order service."""
        missing = (
            "No plant model received. Start the order service with one, on the same broker and topic prefix."
        )
        return Response(
            require(model.plant, Rejection.NO_PLANT_MODEL, missing).to_json(), media_type="application/json"
        )

    return router
