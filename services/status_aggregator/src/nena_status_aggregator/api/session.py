"""What each request takes: data a viewer, commands an operator; the page's own files are for everybody."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request, Response
from typing_extensions import TypedDict

from nena_shared.web.access import COOKIE, KnownUser, RoleNeeded, token_of
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role
from nena_status_aggregator.api.problems import ProblemError

API = "/api/"
METRICS = "/metrics"
SESSION = "/api/v1/session"
SIGN_IN = f"{SESSION}/oidc"
"""Below it is what a browser needs before anybody is known."""


def make_rule(settings: HttpSettings) -> RoleNeeded:
    """Make the rule of this service."""

    def needed(method: str, path: str) -> Role | None:
        if path == METRICS:
            return None if settings.open_metrics else Role.VIEWER
        if not path.startswith(API):
            return None
        if path == SESSION:  # to log out takes nothing
            return None if method == "DELETE" else Role.VIEWER
        if path == SIGN_IN or path.startswith(f"{SIGN_IN}/"):
            return None
        return Role.VIEWER if method in ("GET", "HEAD") else Role.OPERATOR

    return needed


TOKEN_LIMIT = 3800
"""Characters of a token that browsers keep: with name and attributes a cookie has at most 4096 bytes."""


class Session(TypedDict):
    """Who asks; nobody where nobody has to log in."""

    user: str | None
    role: str | None


def make_router() -> APIRouter:
    """Make the routes."""
    router = APIRouter(prefix=SESSION, tags=["session"])

    @router.get("")
    async def session(request: Request) -> Session:
        """Tell who asks; 401 where one has to log in first."""
        return _of(request)

    @router.post("")
    async def log_in(request: Request, response: Response) -> Session:
        """Keep the token of `Authorization: Bearer TOKEN` in the browser, until that is closed."""
        token = token_of(request.headers, cookies=True)
        if len(token) > TOKEN_LIMIT:
            detail = f"Browsers keep no token of {len(token)} characters, only up to {TOKEN_LIMIT}."
            raise ProblemError(HTTPStatus.BAD_REQUEST, detail)
        keep(response, token, secure=request.url.scheme == "https")
        return _of(request)

    @router.delete("", status_code=HTTPStatus.NO_CONTENT)
    async def log_out(response: Response) -> None:
        """Have the browser forget the token."""
        response.delete_cookie(COOKIE, httponly=True, samesite="strict")

    return router


def keep(response: Response, token: str, *, secure: bool) -> None:
    """Have the browser keep a token until it is closed; how long the token counts is looked at here."""
    response.set_cookie(COOKIE, token, httponly=True, samesite="strict", secure=secure)


def _of(request: Request) -> Session:
    user: KnownUser | None = request.state.user
    return {"user": user.name if user else None, "role": user.role.name.lower() if user else None}
