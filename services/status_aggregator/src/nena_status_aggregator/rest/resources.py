"""The resources under ``/api/v1`` that are of all robots: fleet, orders, plant."""

from __future__ import annotations

from fastapi import APIRouter, Response
from typing_extensions import TypedDict

from nena_shared.utc import iso
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.fleet_model.views import LinkView, MalformedView, OrderView, PlantView
from nena_status_aggregator.rest.answers import as_json, found
from nena_status_aggregator.rest.robots import RobotResource, with_age


class FleetResource(TypedDict):
    """Everything. ``time`` is the time of the answer, ``id`` the number of the last change in it.

    ``share`` tells which share of the robots it is: ``1/1`` for all of them.
    """

    time: str
    share: str
    id: int
    robots: list[RobotResource]
    orders: list[OrderView]
    plant: PlantView | None
    link: LinkView
    malformed: MalformedView


def make_router(aggregator: Aggregator) -> APIRouter:
    """Make the routes over ``aggregator``."""
    router = APIRouter(prefix="/api/v1", tags=["fleet"])
    model = aggregator.model

    @router.get("/fleet", responses={200: {"model": FleetResource}})
    async def fleet() -> Response:
        """Everything: robots, orders, whether there is a plant model, the link to the broker."""
        aggregator.publish_changes()
        view = model.snapshot()
        robots = [with_age(aggregator, each) for each in view["robots"]]
        time, share = iso(aggregator.now().utc), str(aggregator.share)
        return as_json({**view, "time": time, "share": share, "robots": robots})

    @router.get("/orders", responses={200: {"model": list[OrderView]}})
    async def orders() -> Response:
        """All transport orders that are kept."""
        aggregator.publish_changes()
        return as_json(model.snapshot()["orders"])

    @router.get("/plant")
    async def plant() -> Response:
        """The plant model, as the order service publishes it."""
        missing = "There is no plant model. Start the order service with one, on the same broker and prefix."
        return Response(found(model.plant, missing).to_json(), media_type="application/json")

    return router
