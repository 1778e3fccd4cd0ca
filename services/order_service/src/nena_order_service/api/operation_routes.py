"""REST routes of the operation table: each reads its requests, calls its operation, and answers.

FastAPI describes these routes (OpenAPI), but :class:`RestApp` answers without it: FastAPI's layers and its
search for dependencies would cost more than all else that a request needs.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Coroutine, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from email.message import Message
from functools import lru_cache
from http import HTTPStatus
from inspect import Parameter, Signature
from typing import Annotated, Any, Final, get_args, get_origin
from urllib.parse import quote

from fastapi import FastAPI, Header, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import TypeAdapter, ValidationError
from starlette.exceptions import HTTPException
from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from nena_order_service.api import problems
from nena_order_service.api.audit import origin_of
from nena_order_service.api.body_limit import check_content_length, read_body
from nena_order_service.api.encoding import SLICE, EncodedPage, encode
from nena_order_service.api.examples import examples_of
from nena_order_service.api.host_requests import ETag
from nena_order_service.api.operations import Call, Handler, Reply
from nena_shared.fleet_api.audit import AuditInterface
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.refusals import Refusal, by_status
from nena_shared.fleet_api.requests import BY_LIMIT, SOMEBODY, DispatchRequest
from nena_shared.fleet_api.transport_order import TransportOrderBatch, TransportOrderRequest
from nena_shared.web.access import user_of
from nena_shared.web.headers import header_of
from nena_shared.web.problem import problem_response

READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
TRACEPARENT_HEADER: Final = re.compile(
    r"(?!ff|00.{53}-)[0-9a-f]{2}(-(?!0{32})[0-9a-f]{32}-(?!0{16})[0-9a-f]{16}-[0-9a-f]{2})(?=-|$)"
)
CONTENT_TYPES_KEPT: Final = 100
"""Number of content types that are parsed once."""

BODY: Final = ("body",)

IfMatch = Annotated[
    str | None, Header(alias="If-Match", max_length=1000, description="ETag of the version to change.")
]
IfNoneMatch = Annotated[
    str | None, Header(alias="If-None-Match", max_length=1000, description="ETag of the version you have.")
]
IdempotencyKey = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


class RestApp(FastAPI):
    """An application that answers operations itself, and everything else by FastAPI."""

    def __init__(self, routes: Iterable[OperationRoute], **described: Any) -> None:  # noqa: ANN401
        """``described`` are arguments of FastAPI."""
        super().__init__(**described)
        self._by_path: Final = defaultdict[tuple[str, ...], list[OperationRoute]](list)
        for each in routes:
            self._by_path[_key(each.operation.method, each.path)].append(each)
            self.router.routes.append(each)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        route = self._route_of(scope) if scope["type"] == "http" else None
        if route is None:
            await super().__call__(scope, receive, send)
            return
        request = Request(scope, receive)
        try:
            response = await route.answer(request)
        except Exception as error:  # noqa: BLE001 - logged there if it was not foreseen
            response = problems.response_to(request, error)
        await response(scope, receive, send)

    def _route_of(self, scope: Scope) -> OperationRoute | None:
        path = scope["path"]
        for each in self._by_path.get(_key(scope["method"], path), ()):
            if match := each.path_regex.fullmatch(path):
                scope["path_params"] = match.groupdict()
                return each
        return None


def _key(method: str, path: str) -> tuple[str, ...]:
    """Return the method and the beginning of a path, which contains no name."""
    return method, *path.split("/", 3)[:3]


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of a request, and a parameter of the endpoint that FastAPI describes."""

    name: str
    location: tuple[str, ...]
    """Its location in errors."""
    kind: Any
    default: Any = Parameter.empty
    adapter: TypeAdapter[Any] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "adapter", TypeAdapter(self.kind))

    @property
    def parameter(self) -> Parameter:
        """Parameter of the endpoint."""
        return Parameter(self.name, Parameter.KEYWORD_ONLY, annotation=self.kind, default=self.default)


class OperationRoute(APIRoute):
    """The route of an operation."""

    def __init__(self, operation: Operation[Any], handler: Handler, *, max_body: int) -> None:
        """``max_body`` is the maximum size of a body, bytes, unless the operation has its own."""
        self.operation = operation
        self._handler = handler
        self._max_body = operation.max_body or max_body
        self._parts = tuple(_parts_of(operation))
        self._header = next((each for each in self._parts if each.location[0] == "header"), None)
        self._header_name = self._header.location[1].lower().encode() if self._header else b""
        self._has_body = any(each.location == BODY for each in self._parts)
        queried = operation.request.model_fields if operation.request and operation.method in READING else {}
        names = {name: field.alias or name for name, field in queried.items()}
        self._query = frozenset(names.values())
        self._lists = {names[name] for name, field in queried.items() if _is_list(field.annotation)}
        status = HTTPStatus.CREATED if operation.creates else HTTPStatus.OK
        successes: dict[int | str, dict[str, Any]] = {
            int(other): {"model": operation.answer, "description": text}
            for other, text in operation.also.items()
        }
        super().__init__(
            operation.path,
            _endpoint(self._parts),
            methods=[operation.method],
            name=operation.name,
            operation_id=operation.name,
            summary=operation.summary,
            tags=[operation.tag],
            status_code=status,
            response_model=operation.answer,
            responses=successes | refusals_of(operation.refusals),
            openapi_extra=examples_of(operation, status),
        )

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler for requests that FastAPI passes on."""
        return self.answer

    async def answer(self, request: Request) -> Response:
        """Call the operation; raises what :func:`nena_order_service.api.problems.response_to` answers."""
        given = self._validated(await self._read(request))
        if request.scope["query_string"]:
            refuse_unknown_query(request, self._query)
        reply = await self._handler(_call(self.operation, request, given))
        known = given.get("if_none_match")
        return await _response(self.operation, reply, known=None if known is None else ETag(known))

    async def _read(self, request: Request) -> dict[str, Any]:
        """Return the given values of the parts."""
        found: dict[str, Any] = dict(request.path_params)
        if self._header and (value := header_of(request.scope, self._header_name)) is not None:
            found[self._header.name] = value
        if self._query:
            found["request"] = self._query_of(request)
        if not self._has_body:
            check_content_length(request.scope, self._max_body)
        elif body := await read_body(request.scope, request.receive, self._max_body):
            found["request"] = _parsed(body) if _is_json(header_of(request.scope, b"content-type")) else body
        return found

    def _query_of(self, request: Request) -> dict[str, str | list[str]]:
        """Return the query parameters; of one that may not be repeated, the last value."""
        found: dict[str, str | list[str]] = dict(request.query_params)
        for name in self._lists & found.keys():
            found[name] = request.query_params.getlist(name)
        return found

    def _validated(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of the parts by name; those that were not given are missing."""
        values: dict[str, Any] = {}
        errors: list[Any] = []
        for part in self._parts:
            if part.name in found:
                try:
                    values[part.name] = part.adapter.validate_python(found[part.name], from_attributes=True)
                except ValidationError as error:
                    errors += [
                        {**each, "loc": (*part.location, *each["loc"])}
                        for each in error.errors(include_url=False)
                    ]
            elif part.default is Parameter.empty:
                errors.append({"type": "missing", "loc": part.location, "msg": "Field required"})
        if errors:
            raise RequestValidationError(errors)
        return values


def _parts_of(operation: Operation[Any]) -> Iterator[_Part]:
    """Return the parts of an operation's requests, in the order in which their errors are listed."""
    reads = operation.method in READING
    if "{" in operation.path:
        yield _Part("name", ("path", "name"), operation.name_type)
    if operation.request and reads:
        yield _Part("request", ("query",), Annotated[operation.request, Query()])
    if operation.creates and not operation.subject:
        yield _Part("idempotency_key", ("header", "Idempotency-Key"), IdempotencyKey, None)
    elif operation.versioned and reads:
        yield _Part("if_none_match", ("header", "If-None-Match"), IfNoneMatch, None)
    elif operation.versioned:
        yield _Part("if_match", ("header", "If-Match"), IfMatch, None)
    if operation.may_be_empty:
        yield _Part("request", BODY, operation.request | None, None)
    elif operation.request and not reads:
        yield _Part("request", BODY, operation.request)


def _is_list(kind: Any) -> bool:  # noqa: ANN401 - any type
    """Return whether a query parameter may be repeated."""
    return get_origin(kind) in {list, tuple} or any(map(_is_list, get_args(kind)))


def _endpoint(parts: Iterable[_Part]) -> Callable[..., Any]:
    """Return an endpoint with these parameters, which is described but not called."""

    async def endpoint() -> None: ...

    endpoint.__signature__ = Signature(  # type: ignore[attr-defined]
        [each.parameter for each in parts]
    )
    return endpoint


@lru_cache(CONTENT_TYPES_KEPT)
def _is_json(content_type: str | None) -> bool:
    message = Message()
    message["content-type"] = content_type or ""
    subtype = message.get_content_subtype()
    return message.get_content_maintype() == "application" and (
        subtype == "json" or subtype.endswith("+json")
    )


def _parsed(body: bytes) -> Any:  # noqa: ANN401 - JSON
    try:
        return json.loads(body)
    except json.JSONDecodeError as error:
        finding = {"type": "json_invalid", "loc": ("body", error.pos), "msg": error.msg}
        raise RequestValidationError([finding]) from error
    except (ValueError, RecursionError) as error:
        raise HTTPException(HTTPStatus.BAD_REQUEST, "There was an error parsing the body") from error


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


def _call(operation: Operation[Any], http: Request, given: Mapping[str, Any]) -> Call[Any]:
    request, key, seen = given.get("request"), given.get("idempotency_key"), given.get("if_match")
    if request is None and operation.may_be_empty:
        request = operation.request()
    if key and request is not None and request.idempotency_key is None:
        request = request.model_copy(update={"idempotency_key": key})
    if trace := _traceparent(http):
        request = _traced(request, trace)
    user = user_of(http.scope)
    caller = user.known_as[:BY_LIMIT] if user else SOMEBODY  # an issuer's long subject is cut
    version = None if seen is None else ETag(seen)
    return Call(given.get("name", ""), request, caller, version, origin_of(http, AuditInterface.REST))


def _traced(request: Any, trace: str) -> Any:  # noqa: ANN401 - the body of any operation
    """Return a request with the caller's trace for each order that it creates without one of its own."""
    match request:
        case TransportOrderRequest(traceparent=None) | DispatchRequest(traceparent=None):
            return request.model_copy(update={"traceparent": trace})
        case TransportOrderBatch(transport_orders=orders):
            return request.model_copy(
                update={"transport_orders": tuple(_traced(each, trace) for each in orders)}
            )
        case _:
            return request


def _traceparent(http: Request) -> str | None:
    """Return the header ``traceparent`` in version 00; None without a valid one, which is ignored.

    Only later versions may be longer; they begin like version 00 (W3C Trace Context, sections 3.2 and 4.3).
    """
    found = TRACEPARENT_HEADER.match(header_of(http.scope, b"traceparent") or "")
    return f"00{found[1]}" if found else None


async def _response(operation: Operation[Any], reply: Reply, *, known: ETag | None) -> Response:
    headers: dict[str, str] = {}
    body: Any = reply.body
    if isinstance(body, EncodedPage):
        if len(body.objects) <= SLICE:  # a stream takes as long as the rest of a request
            content = b"".join([each async for each in body.parts()])
            return Response(content, reply.status, media_type="application/json")
        headers["Content-Length"] = str(body.size)
        return StreamingResponse(body.parts(), reply.status, headers, "application/json")
    if operation.versioned or hasattr(body, "version"):
        headers["ETag"] = ETag.of(body.version).value
        if known and known.fits(body.version):
            return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    if operation.creates:
        headers["Location"] = f"{operation.creates}/{quote(body.name)}"
    return Response(await encode(body), reply.status, headers, "application/json")
