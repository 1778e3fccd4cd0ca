"""What the routes answer with: bodies as JSON, and the version of what they show."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated
from urllib.parse import quote

from fastapi import Header, Response
from pydantic import BaseModel

from nena_order_service.host_requests import ETag
from nena_shared.fleet_api.transport_order import TransportOrderStatus

IfMatch = Annotated[
    str | None,
    Header(alias="If-Match", max_length=1000, description="ETag of the version that may be changed."),
]
IfNoneMatch = Annotated[
    str | None, Header(alias="If-None-Match", max_length=1000, description="ETag of what is known already.")
]


def as_json(body: BaseModel, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> Response:
    """Answer with a body."""
    return Response(body.model_dump_json(by_alias=True), status, headers, "application/json")


def seen(if_match: str | None) -> ETag | None:
    """Give what a host has seen; None: it does not say."""
    return None if if_match is None else ETag(if_match)


def order(status: TransportOrderStatus, *, if_none_match: str | None = None) -> Response:
    """Answer with an order and its version; only with the latter where the host knows that already."""
    tag = ETag.of(status.version).value
    if if_none_match is not None and ETag(if_none_match).fits(status.version):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers={"ETag": tag})
    return as_json(status, ETag=tag)


def created(status: TransportOrderStatus, *, new: bool) -> Response:
    """Answer with an order that was made now or before by the same request."""
    return as_json(
        status,
        HTTPStatus.CREATED if new else HTTPStatus.OK,
        Location=f"/v1/transportOrders/{quote(status.name)}",
        ETag=ETag.of(status.version).value,
    )
