"""Sessions and roles: ``/api/v1/session``.

A browser sends its user's token once, like any client, and receives it as a cookie. The server stores no
sessions: the token alone identifies the user.
"""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request, Response
from typing_extensions import TypedDict

from nena_shared.fleet_api.base import Role
from nena_shared.fleet_api.topics import ORDER_SERVICE
from nena_shared.web.access import COOKIE, KnownUser, RoleNeeded, token_of
from nena_shared.web.metrics import METRICS
from nena_shared.web.settings import HttpSettings
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError

API = "/api/"
SESSION = "/api/v1/session"
SIGN_IN = f"{SESSION}/oidc"
"""OIDC sign-in, available without authentication."""


DECISIONS = f"/api/v1/recordings/{ORDER_SERVICE}"
"""Recordings of the order service: they name who commanded what, as its audit trail does."""


def make_rule(settings: HttpSettings) -> RoleNeeded:
    """Return the required role: viewer for data, operator for commands, none for the panel's files."""

    def needed(method: str, path: str) -> Role | None:
        if path == METRICS:
            return None if settings.open_metrics else Role.VIEWER
        if not path.startswith(API):
            return None
        if path == SESSION:  # signing out needs no role
            return None if method == "DELETE" else Role.VIEWER
        if path == SIGN_IN or path.startswith(f"{SIGN_IN}/"):
            return None
        if path.startswith(f"{DECISIONS}/"):
            return Role.ADMIN
        return Role.VIEWER if method in ("GET", "HEAD") else Role.OPERATOR

    return needed


TOKEN_LIMIT = 3800
"""Maximum length of a token in a cookie, characters; with name and attributes, cookies have 4096 bytes."""


class Session(TypedDict):
    """The signed-in user; null without authentication."""

    user: str | None
    role: str | None


def make_router() -> APIRouter:
    """Create the routes of the session."""
    router = APIRouter(prefix=SESSION, tags=["session"])

    @router.get("")
    async def session(request: Request) -> Session:
        """Return the signed-in user; 401 if sign-in is required."""
        return _session_of(request)

    @router.post("")
    async def log_in(request: Request, response: Response) -> Session:
        """Sign in: store the token of `Authorization: Bearer TOKEN` in a session cookie."""
        token = token_of(request.scope, cookies=True)
        if len(token) > TOKEN_LIMIT:
            detail = f"Token of {len(token)} characters is too long for a cookie; the limit is {TOKEN_LIMIT}."
            raise ProblemError(Rejection.TOKEN_TOO_LONG, detail)
        keep(response, token, secure=request.url.scheme == "https")
        return _session_of(request)

    @router.delete("", status_code=HTTPStatus.NO_CONTENT)
    async def log_out(response: Response) -> None:
        """Sign out: delete the session cookie."""
        response.delete_cookie(COOKIE, httponly=True, samesite="strict")

    return router


def keep(response: Response, token: str, *, secure: bool) -> None:
    """Store a token in a session cookie; its expiry is checked on each request."""
    response.set_cookie(COOKIE, token, httponly=True, samesite="strict", secure=secure)


def _session_of(request: Request) -> Session:
    user: KnownUser | None = request.state.user
    return {"user": user.name if user else None, "role": user.role.name.lower() if user else None}
