"""The attention list, ``/api/v1/attention``: what needs a person, and who has seen it."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from nena_shared.fleet_api.attention import AcknowledgementRequest, AttentionList, Matter
from nena_shared.web.access import KnownUser
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.control import own_page
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError, as_json, require


def make_router(aggregator: Aggregator, trusted_hosts: tuple[str, ...]) -> APIRouter:
    """Create the routes; acknowledgements are accepted from the panel's own page and from programs."""
    router = APIRouter(prefix="/api/v1/attention", tags=["attention"])
    registry = aggregator.model.attention

    @router.get("", responses={200: {"model": AttentionList}})
    async def attention() -> Response:
        """Return everything that needs a person, urgent matters first, then as in the panel."""
        aggregator.publish_changes()
        return as_json(AttentionList(attention=registry.matters))

    @router.post(
        "/{matter_id:path}/acknowledgement",
        dependencies=[own_page(trusted_hosts)],
        responses={200: {"model": Matter}},
    )
    async def acknowledgement(matter_id: str, body: AcknowledgementRequest, request: Request) -> Response:
        """Acknowledge a matter with the name of the user or, without sign-in, of the person."""
        user: KnownUser | None = request.state.user
        by = user.name if user else body.by
        if by is None:
            detail = "Without sign-in, state the name of the person as `by`."
            raise ProblemError(Rejection.NAMELESS, detail)
        done = registry.acknowledge(matter_id, by, aggregator.now().utc)
        missing = f"Nothing with the ID {matter_id!r} needs a person; /api/v1/attention lists what does."
        found = require(done, Rejection.UNKNOWN_MATTER, missing)
        aggregator.acknowledgements.keep()
        aggregator.publish_changes()
        return as_json(found)

    return router
