"""The order service's REST door, as the control panel reaches it through this program."""

from __future__ import annotations

import re
import ssl
from dataclasses import dataclass
from http import HTTPStatus
from typing import Annotated
from urllib.parse import SplitResult, unquote, urlsplit

import httpx
from fastapi import APIRouter, Depends, Path, Request, Response
from typing_extensions import TypedDict

from nena_shared.log import get_logger
from nena_shared.web.access import token_of
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.settings import OrderServiceSettings

log = get_logger(__name__)


class OrderServiceAwayError(Exception):
    """The order service has not answered; the text says what happened."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What the order service answered, problems included."""

    status: int
    content_type: str
    body: bytes


class OrderServiceDoor:
    """Passes requests on. Commands are rare: each has a connection of its own, and none is sent twice."""

    def __init__(self, url: str, settings: OrderServiceSettings) -> None:
        """Prepare; ``url`` is where the order service's ``/v1`` is."""
        self._url = url.rstrip("/")
        self._timeout = httpx.Timeout(settings.timeout, connect=min(5.0, settings.timeout))
        self._tls = ssl.create_default_context(cafile=settings.ca)

    async def ask(
        self, method: str, path: str, query: str = "", body: bytes | None = None, *, token: str = ""
    ) -> Answer:
        """Send one request; ``path`` is percent-encoded and begins below ``/v1/``, ``token`` says who asks.

        Raises:
            OrderServiceAwayError: there was no answer. A command may have been carried out all the same.

        """
        url = f"{self._url}/v1/{path}" + (f"?{query}" if query else "")
        headers = {"content-type": "application/json"} if body is not None else {}
        if token:
            headers["authorization"] = f"Bearer {token}"
        try:
            async with httpx.AsyncClient(
                timeout=self._timeout, verify=self._tls, trust_env=False, follow_redirects=False
            ) as client:
                answer = await client.request(method, url, content=body, headers=headers)
        except httpx.HTTPError as error:
            reason = str(error) or type(error).__name__
            log.warning("order service not reached", method=method, path=path, reason=reason)
            raise OrderServiceAwayError(reason) from error
        if method != "GET":
            log.info("command passed on", method=method, path=path, status=answer.status_code)
        return Answer(answer.status_code, answer.headers.get("content-type", ""), answer.content)


PREFIX = "/api/v1/control"
RESOURCES = re.compile(r"(transportOrders|vehicles)(/[^/]+(/[A-Za-z]+)?)?")
"""What is passed on: the resources that the panel uses."""
BODY_LIMIT = 256 * 1024
"""Bytes."""


class Control(TypedDict):
    """Whether commands are possible here."""

    enabled: bool


def make_router(settings: OrderServiceSettings) -> APIRouter:
    """Make the routes; without an address of the order service every command is refused."""
    door = OrderServiceDoor(str(settings.url), settings) if settings.url else None

    async def own_page(request: Request) -> None:
        check_origin(request, settings.trusted_hosts)

    router = APIRouter(prefix=PREFIX, tags=["control"], dependencies=[Depends(own_page)])

    @router.get("")
    async def control() -> Control:
        """Tell whether commands are possible here."""
        return {"enabled": door is not None}

    async def passed_on(request: Request, _path: Annotated[str, Path(alias="path")]) -> Response:
        """Pass a request on to the order service's `/v1`, whose interface describes it."""
        if door is None:
            detail = (
                "Commands are off. Start this program with --order_service.url, e.g. http://127.0.0.1:55200."
            )
            raise ProblemError(HTTPStatus.NOT_FOUND, detail)
        path = resource_of(request)
        body = await _body(request) if request.method == "POST" else None
        try:
            token = token_of(request.headers, cookies=True)
            answer = await door.ask(request.method, path, request.url.query, body, token=token)
        except OrderServiceAwayError as error:
            detail = f"The order service does not answer ({error}). Is it running, and does "
            detail += "--order_service.url name it? Look at what it did before you ask again."
            raise ProblemError(HTTPStatus.BAD_GATEWAY, detail) from error
        return Response(answer.body, answer.status, media_type=answer.content_type or None)

    router.get("/{path:path}", name="ask")(passed_on)
    router.post("/{path:path}", name="command")(passed_on)
    return router


def check_origin(request: Request, trusted_hosts: tuple[str, ...]) -> None:
    """Refuse what does not come from our own page, or from a program.

    Raises:
        ProblemError: 403 for a page of another origin and for a host name that is not ours.

    """
    host = request.headers.get("host", "")
    if _parts(f"//{host}").hostname not in trusted_hosts:
        detail = f"{host!r} is not one of the names of this service; see --order_service.trusted_hosts."
        raise ProblemError(HTTPStatus.FORBIDDEN, detail)
    origin = request.headers.get("origin")
    site = request.headers.get("sec-fetch-site", "same-origin")
    if (origin is not None and _parts(origin).netloc != host) or site not in ("same-origin", "none"):
        raise ProblemError(HTTPStatus.FORBIDDEN, "Commands are taken from this service's own page only.")


def _parts(address: str) -> SplitResult:
    """Split what a client says is an address; what is none has no parts."""
    try:
        return urlsplit(address)
    except ValueError:
        return urlsplit("")


def resource_of(request: Request) -> str:
    """Give the part of the path to pass on, percent-encoded as it came.

    Raises:
        ProblemError: 404 for what the order service has, but not for the panel.

    """
    raw: bytes = request.scope["raw_path"]
    path = raw.decode("ascii").split("?", 1)[0].removeprefix(f"{PREFIX}/")
    dots = any(unquote(part) in (".", "..") for part in path.split("/"))
    if dots or not RESOURCES.fullmatch(path):
        detail = f"There is nothing to command at {request.url.path}; see /api/v1/openapi.json."
        raise ProblemError(HTTPStatus.NOT_FOUND, detail)
    return path


async def _body(request: Request) -> bytes:
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != "application/json":
        detail = "Send commands as JSON, with Content-Type: application/json."
        raise ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, detail)
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > BODY_LIMIT:
            detail = f"A command has at most {BODY_LIMIT} bytes."
            raise ProblemError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, detail)
    return bytes(body)
