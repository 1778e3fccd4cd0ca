"""Commands of the control panel, ``/api/v1/control``: forwarded to the order service, which authorises them.

Pages of other origins must not be able to send commands. Therefore requests of other origins are refused,
commands must be JSON (which needs a CORS preflight that is never granted), and the host name must be trusted
(against DNS rebinding).
"""

from __future__ import annotations

import re
import ssl
from typing import Annotated
from urllib.parse import SplitResult, unquote, urlsplit

import httpx
from fastapi import APIRouter, Depends, Path, Request, Response
from typing_extensions import TypedDict

from nena_shared.log import get_logger
from nena_shared.web.access import token_of
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.settings import OrderServiceSettings

log = get_logger(__name__)


class OrderServiceClient:
    """Forwards requests to the order service, each with its own connection and without retries."""

    def __init__(self, url: str, settings: OrderServiceSettings) -> None:
        """Create the client; ``url`` is the base URL of the order service, without ``/v1``."""
        self._url = url.rstrip("/")
        self._timeout = httpx.Timeout(settings.timeout, connect=min(5.0, settings.timeout))
        self._tls = ssl.create_default_context(cafile=settings.ca)

    async def forward(
        self, method: str, path: str, query: str, body: bytes | None, *, token: str
    ) -> Response:
        """Send one request and return its response; ``path`` is percent-encoded and relative to ``/v1/``.

        Raises:
            ProblemError: 502 without an answer. A command may have been executed nevertheless.

        """
        url = f"{self._url}/v1/{path}" + (f"?{query}" if query else "")
        headers = {"user-agent": "nena-panel"}  # the audit trail shows it
        if body is not None:
            headers["content-type"] = "application/json"
        if token:
            headers["authorization"] = f"Bearer {token}"
        try:
            async with httpx.AsyncClient(
                timeout=self._timeout, verify=self._tls, trust_env=False, follow_redirects=False
            ) as client:
                answer = await client.request(method, url, content=body, headers=headers)
        except httpx.HTTPError as error:
            reason = str(error) or type(error).__name__
            log.warning("order service not reachable", method=method, path=path, reason=reason)
            detail = f"No answer from the order service ({reason}). Check that it is running and that "
            detail += "--order_service.url is correct. Check the order list before retrying."
            raise ProblemError(Rejection.ORDER_SERVICE_UNREACHABLE, detail) from error
        if method != "GET":
            log.info("command forwarded", method=method, path=path, status=answer.status_code)
        return Response(answer.content, answer.status_code, media_type=answer.headers.get("content-type"))


PREFIX = "/api/v1/control"
RESOURCES = re.compile(
    r"(transportOrders|vehicles|paths|stops|schedules)(/[^/]+(/[A-Za-z]+)?)?|traffic/plan|audit|zoneSets|recordings"
)
"""Paths of forwarded queries and commands: the resources that the panel uses."""
ALTERATIONS = re.compile(r"transportOrders/[^/]+")
"""Paths of forwarded changes of single fields (PATCH): waiting orders."""
CHANGES = re.compile(r"paths/[^/]+/lock|vehicles/[^/]+/integrationLevel|schedules/[^/]+(/enabled)?")
"""Paths of forwarded changes (PUT): lock of a path, integration level, schedules."""
REMOVALS = re.compile(r"schedules/[^/]+")
"""Paths of forwarded removals (DELETE)."""
BODY_LIMIT = 256 * 1024
"""Maximum size of a command, bytes."""


class Control(TypedDict):
    """Whether commands are enabled."""

    enabled: bool


def make_router(settings: OrderServiceSettings) -> APIRouter:
    """Create the routes; without a URL of the order service every command is refused."""
    client = OrderServiceClient(str(settings.url), settings) if settings.url else None

    async def own_page(request: Request) -> None:
        check_origin(request, settings.trusted_hosts)

    router = APIRouter(prefix=PREFIX, tags=["control"], dependencies=[Depends(own_page)])

    @router.get("")
    async def control() -> Control:
        """Return whether commands are enabled."""
        return {"enabled": client is not None}

    async def forward(request: Request, _path: Annotated[str, Path(alias="path")]) -> Response:
        """Forward a request to the order service's `/v1`; see its API."""
        if client is None:
            detail = "Commands are disabled. Set --order_service.url, e.g. to http://127.0.0.1:55200."
            raise ProblemError(Rejection.COMMANDS_DISABLED, detail)
        path = resource_of(request)
        body = await _read_body(request) if request.method != "GET" else None
        token = token_of(request.scope, cookies=True)
        return await client.forward(request.method, path, request.url.query, body, token=token)

    router.get("/{path:path}", name="ask")(forward)
    router.post("/{path:path}", name="command")(forward)
    router.put("/{path:path}", name="change")(forward)
    router.patch("/{path:path}", name="alter")(forward)
    router.delete("/{path:path}", name="remove")(forward)
    return router


def check_origin(request: Request, trusted_hosts: tuple[str, ...]) -> None:
    """Accept only requests from the panel itself and from programs.

    Raises:
        ProblemError: 403 for a page of another origin or an untrusted host name.

    """
    host = request.headers.get("host", "")
    if _split_url(f"//{host}").hostname not in trusted_hosts:
        detail = f"{host!r} is not a trusted host name of this service; see --order_service.trusted_hosts."
        raise ProblemError(Rejection.UNTRUSTED_PAGE, detail)
    origin = request.headers.get("origin")
    site = request.headers.get("sec-fetch-site", "same-origin")
    if (origin is not None and _split_url(origin).netloc != host) or site not in ("same-origin", "none"):
        raise ProblemError(
            Rejection.UNTRUSTED_PAGE, "Commands are accepted from this service's own page only."
        )


def _split_url(address: str) -> SplitResult:
    """Split a client's URL; an invalid one has empty parts."""
    try:
        return urlsplit(address)
    except ValueError:
        return urlsplit("")


def resource_of(request: Request) -> str:
    """Return the path to forward, percent-encoded as received.

    Raises:
        ProblemError: 404 for resources and methods that the panel does not use.

    """
    raw: bytes = request.scope["raw_path"]
    path = raw.decode("ascii").split("?", 1)[0].removeprefix(f"{PREFIX}/")
    dots = any(unquote(part) in (".", "..") for part in path.split("/"))
    allowed = {"PUT": CHANGES, "PATCH": ALTERATIONS, "DELETE": REMOVALS}.get(request.method, RESOURCES)
    if dots or not allowed.fullmatch(path):
        detail = f"No command at {request.url.path}; see /api/v1/openapi.json."
        raise ProblemError(Rejection.UNKNOWN_COMMAND, detail)
    return path


async def _read_body(request: Request) -> bytes:
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != "application/json":
        detail = "Send commands as JSON, with Content-Type: application/json."
        raise ProblemError(Rejection.COMMAND_NOT_JSON, detail)
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > BODY_LIMIT:
            detail = f"Command exceeds {BODY_LIMIT} bytes."
            raise ProblemError(Rejection.COMMAND_TOO_LONG, detail)
    return bytes(body)
