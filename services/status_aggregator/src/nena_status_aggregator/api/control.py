"""Commands of the control panel, ``/api/v1/control``: forwarded to the order service, which authorises them.

Pages of other origins must not be able to send commands. Therefore requests of other origins are refused,
commands must be JSON (which needs a CORS preflight that is never granted), and the host name must be trusted
(against DNS rebinding).
"""

from __future__ import annotations

import asyncio
import re
import ssl
from typing import Annotated
from urllib.parse import SplitResult, unquote, urlsplit

import httpx
from fastapi import APIRouter, Path, Request, Response, params
from typing_extensions import TypedDict

from nena_shared.log import get_logger
from nena_shared.plant_terms import MAX_BYTES
from nena_shared.web.access import token_of
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.settings import OrderServiceSettings

log = get_logger(__name__)


class OrderServiceClient:
    """Forwards requests to the order service, each with its own connection and without retries."""

    def __init__(self, settings: OrderServiceSettings) -> None:
        self._url = str(settings.url).rstrip("/") if settings.url else ""
        self._timeout = httpx.Timeout(settings.timeout, connect=min(5.0, settings.timeout))
        self._tls = ssl.create_default_context(cafile=settings.ca)

    @property
    def enabled(self) -> bool:
        """Whether it has a URL."""
        return bool(self._url)

    async def forward(
        self, request: Request, body: bytes | None = None, *, within: float | None = None
    ) -> Response:
        """Forward one request and return its response; ``within``: maximum time, seconds; None: as set.

        Raises:
            ProblemError: 404 for a path that is not forwarded, or without a URL; 502 without an answer. A
                command may have been executed nevertheless.
        """
        if not self.enabled:
            detail = "Commands are disabled. Set --order_service.url, e.g. to http://127.0.0.1:55200."
            raise ProblemError(Rejection.COMMANDS_DISABLED, detail)
        method, path, query = request.method, resource_of(request), request.url.query
        url = f"{self._url}/v1/{path}" + (f"?{query}" if query else "")
        headers = {"user-agent": "nena-panel"}  # the audit trail shows it
        if body is not None:
            headers["content-type"] = "application/json"
        if token := token_of(request.scope, cookies=True):
            headers["authorization"] = f"Bearer {token}"
        try:
            async with (
                asyncio.timeout(within),
                httpx.AsyncClient(
                    timeout=self._timeout, verify=self._tls, trust_env=False, follow_redirects=False
                ) as client,
            ):
                answer = await client.request(method, url, content=body, headers=headers)
        except (httpx.HTTPError, TimeoutError) as error:
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
    r"(transportOrders|vehicles|paths|stops|schedules|plantDrafts|plantVersions)(/[^/]+(/[A-Za-z]+)?)?"
    r"|traffic/plan|audit|zoneSets|recordings"
)
"""Paths of forwarded queries and commands: the resources that the panel uses."""
ALTERATIONS = re.compile(r"transportOrders/[^/]+")
"""Paths of forwarded changes of single fields (PATCH): waiting orders."""
CHANGES = re.compile(
    r"paths/[^/]+/lock|vehicles/[^/]+/integrationLevel|schedules/[^/]+(/enabled)?|plantDrafts/[^/]+"
)
"""Paths of forwarded changes (PUT): lock of a path, integration level, schedules, drafts of plants."""
REMOVALS = re.compile(r"(schedules|plantDrafts)/[^/]+|plantDrafts/[^/]+/run")
"""Paths of forwarded removals (DELETE)."""
BODY_LIMIT = 256 * 1024
"""Maximum size of a command, bytes; drafts of plants may have ``MAX_BYTES``."""


class Control(TypedDict):
    """Whether commands are enabled."""

    enabled: bool


def own_page(trusted_hosts: tuple[str, ...]) -> params.Depends:
    """Return the dependency that refuses requests of other pages; see :func:`check_origin`."""

    async def check(request: Request) -> None:
        check_origin(request, trusted_hosts)

    return params.Depends(check)


def make_router(client: OrderServiceClient, trusted_hosts: tuple[str, ...]) -> APIRouter:
    """Create the routes."""
    router = APIRouter(prefix=PREFIX, tags=["control"], dependencies=[own_page(trusted_hosts)])

    @router.get("")
    async def control() -> Control:
        """Return whether commands are enabled."""
        return {"enabled": client.enabled}

    async def forward(request: Request, _path: Annotated[str, Path(alias="path")]) -> Response:
        """Forward a request to the order service's `/v1`; see its API."""
        return await client.forward(request, await read_body(request) if request.method != "GET" else None)

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


async def read_body(request: Request) -> bytes:
    """Return the body of a command.

    Raises:
        ProblemError: 415 if it is not JSON, 413 if it is too long.
    """
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != "application/json":
        detail = "Send commands as JSON, with Content-Type: application/json."
        raise ProblemError(Rejection.COMMAND_NOT_JSON, detail)
    limit = MAX_BYTES if request.url.path.startswith(f"{PREFIX}/plantDrafts/") else BODY_LIMIT
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > limit:
            detail = f"Command exceeds {limit} bytes."
            raise ProblemError(Rejection.COMMAND_TOO_LONG, detail)
    return bytes(body)
