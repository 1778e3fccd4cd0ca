"""Routes of the operation table: FastAPI validates, describes and answers them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from http import HTTPStatus
from inspect import Parameter, Signature
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import Depends, FastAPI, Header, Query, Request, Response
from starlette.exceptions import HTTPException

from nena_order_service.api import problems
from nena_order_service.api.audit import origin_of
from nena_order_service.api.operations import Call, ETag, HostOperations, Reply
from nena_shared.fleet_api.audit import AuditInterface
from nena_shared.fleet_api.operations.operation import Operation
from nena_shared.fleet_api.refusals import Refusal, by_status
from nena_shared.fleet_api.requests import BY_LIMIT, SOMEBODY, DispatchRequest
from nena_shared.fleet_api.transport_order import TransportOrderBatch, TransportOrderRequest
from nena_shared.web.access import user_of
from nena_shared.web.problem import problem_response

READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
TRACEPARENT_HEADER: Final = re.compile(
    r"(?!ff|00.{53}-)[0-9a-f]{2}(-(?!0{32})[0-9a-f]{32}-(?!0{16})[0-9a-f]{16}-[0-9a-f]{2})(?=-|$)"
)

IfMatch = Annotated[
    str | None, Header(alias="If-Match", max_length=1000, description="ETag of the version to change.")
]
IfNoneMatch = Annotated[
    str | None, Header(alias="If-None-Match", max_length=1000, description="ETag of the version you have.")
]
IdempotencyKey = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


def add_operation(app: FastAPI, operations: HostOperations, operation: Operation[Any]) -> None:
    """Add the route of an operation."""
    reads = operation.method in READING
    fields = operation.request.model_fields if operation.request and reads else {}
    names = {field.alias or name for name, field in fields.items()}

    async def endpoint(http: Request, **values: Any) -> Response:  # noqa: ANN401 - as validated by FastAPI
        refuse_unknown_query(http, names)
        try:
            reply = await operations.execute(operation, _make_call(operation, http, values))
        except Exception as error:  # noqa: BLE001 - Starlette would raise it again, and the server close the connection
            return problems.response_to(http, error)
        return _make_response(operation, reply, values.get("if_none_match"))

    # FastAPI reads the parameters of an endpoint from its signature (PEP 362).
    signature = Signature([_make_parameter("http", Request), *_parameters_of(operation)])
    endpoint.__signature__ = signature  # type: ignore[attr-defined]
    status = HTTPStatus.CREATED if operation.creates else HTTPStatus.OK
    successes: dict[int | str, dict[str, Any]] = {
        int(also): {"model": operation.answer, "description": text} for also, text in operation.also.items()
    }

    def describe_example(example: object) -> dict[str, Any]:
        return {"content": {"application/json": {"example": example}}}

    handler, examples = operations.handlers[operation.name], dict[str, Any]()
    if handler.body:
        examples["requestBody"] = describe_example(handler.body)
    if handler.answer:
        examples["responses"] = {str(int(status)): describe_example(handler.answer)}
    app.add_api_route(
        operation.path,
        endpoint,
        methods=[operation.method],
        name=operation.name,
        operation_id=operation.name,
        summary=operation.summary,
        tags=[operation.noun.tag],
        status_code=status,
        response_model=operation.answer,
        responses=successes | refusals_of(operation.refusals),
        openapi_extra=examples,
    )


def _parameters_of(operation: Operation[Any]) -> Iterator[Parameter]:
    reads = operation.method in READING
    if "{" in operation.path:
        yield _make_parameter("name", operation.noun.name_type)
    if operation.request and reads:
        yield _make_parameter("request", Annotated[operation.request, Query()])
    if operation.creates and not operation.subject and "idempotency_key" in operation.request.model_fields:
        yield _make_parameter("idempotency_key", IdempotencyKey, default=None)
    elif operation.versioned and reads:
        yield _make_parameter("if_none_match", IfNoneMatch, default=None)
    elif operation.versioned:
        yield _make_parameter("if_match", IfMatch, default=None)
    if operation.may_be_empty:
        yield _make_parameter("request", operation.request | None, default=None)
    elif operation.request and not reads:
        yield _make_parameter("request", operation.request)


def _make_parameter(name: str, kind: Any, *, default: Any = Parameter.empty) -> Parameter:  # noqa: ANN401 - any type
    return Parameter(name, Parameter.KEYWORD_ONLY, annotation=kind, default=default)


def known_query(*names: str) -> Any:  # noqa: ANN401 - of FastAPI
    """Return the dependency of a route that refuses all query parameters but these."""

    def check(request: Request) -> None:
        refuse_unknown_query(request, names)

    return Depends(check)


def refuse_unknown_query(request: Request, known: Collection[str]) -> None:
    """Raise HTTPException for an unknown query parameter: a misspelt filter would find everything."""
    for name in request.query_params:
        if name not in known:
            names = ", ".join(sorted(known)) or "none"
            raise HTTPException(
                HTTPStatus.BAD_REQUEST, f"Unknown query parameter {name[:100]!r}. Known here: {names}."
            )


def refusals_of(refusals: Iterable[Refusal]) -> dict[int | str, dict[str, Any]]:
    """Return the refusals of an operation as FastAPI's ``responses``."""
    return {int(status): problem_response(text) for status, text in by_status(refusals).items()}


def _make_call(operation: Operation[Any], http: Request, values: dict[str, Any]) -> Call[Any]:
    request, key, version = (values.get(name) for name in ("request", "idempotency_key", "if_match"))
    if request is None and operation.may_be_empty:
        request = operation.request()
    if key and request is not None and request.idempotency_key is None:
        request = request.model_copy(update={"idempotency_key": key})
    # Later versions may only be longer; they begin like version 00 (W3C Trace Context, sections 3.2 and 4.3).
    # An invalid trace is ignored: it must not keep an order from being created.
    if trace := TRACEPARENT_HEADER.match(http.headers.get("traceparent", "")):
        request = _with_trace(request, f"00{trace[1]}")
    user = user_of(http.scope)
    caller = user.known_as[:BY_LIMIT] if user else SOMEBODY  # an issuer's long subject is cut
    seen = None if version is None else ETag(version)
    return Call(values.get("name", ""), request, caller, seen, origin_of(http, AuditInterface.REST))


def _with_trace(request: Any, trace: str) -> Any:  # noqa: ANN401 - the body of any operation
    """Return a request with the caller's trace for each order that it creates without one of its own."""
    match request:
        case TransportOrderRequest(traceparent=None) | DispatchRequest(traceparent=None):
            return request.model_copy(update={"traceparent": trace})
        case TransportOrderBatch(transport_orders=orders):
            return request.model_copy(
                update={"transport_orders": tuple(_with_trace(order, trace) for order in orders)}
            )
        case _:
            return request


def _make_response(operation: Operation[Any], reply: Reply, if_none_match: str | None) -> Response:
    body = reply.body
    if isinstance(body, bytes):
        return Response(body, reply.status, media_type="application/json")
    headers: dict[str, str] = {}
    version: int | None = getattr(body, "version", None)
    if version is not None:
        headers["ETag"] = ETag.of(version).value
        if if_none_match is not None and ETag(if_none_match).fits(version):
            return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    if operation.creates:
        name: str = getattr(body, "name", "")
        headers["Location"] = f"{operation.creates}/{quote(name)}"
    return Response(body.model_dump_json(by_alias=True), reply.status, headers, "application/json")
