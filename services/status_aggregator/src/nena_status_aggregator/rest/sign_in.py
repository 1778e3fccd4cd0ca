"""Signing in at the panel by the issuer, under ``/api/v1/session/oidc``: away to it, and back."""

from __future__ import annotations

from http import HTTPStatus
from urllib.parse import urlsplit

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from typing_extensions import TypedDict

from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.web.rate_limit import RateLimit
from nena_status_aggregator.rest.problem import ProblemError
from nena_status_aggregator.rest.roles import SIGN_IN
from nena_status_aggregator.rest.session import TOKEN_LIMIT, keep
from nena_status_aggregator.sign_in import Attempt, SignedIn, SignIn, SignInError

log = get_logger(__name__)

COOKIE = "nena_sign_in"
"""Where a browser keeps its attempt. Unlike the token it comes along from the issuer's page."""
PATIENCE = 600
"""Seconds that somebody may take at the issuer."""
PER_SECOND = 0.5
AT_ONCE = 20
"""Sign-ins that may begin or end at an address: each may cost a request to the issuer."""


class Offer(TypedDict):
    """Where a sign-in begins; none where there is no issuer."""

    start: str | None


def make_router(sign_in: SignIn | None, clock: Clock) -> APIRouter:
    """Make the routes; without ``sign_in`` there is only what says so."""
    router = APIRouter(prefix=SIGN_IN, tags=["session"])

    @router.get("")
    async def offer() -> Offer:
        """Tell where a browser can begin to sign in by the issuer."""
        return {"start": f"{sign_in.panel}{SIGN_IN.lstrip('/')}/start" if sign_in else None}

    if sign_in:
        _add_steps(router, sign_in, clock)
    return router


def _add_steps(router: APIRouter, sign_in: SignIn, clock: Clock) -> None:
    limit = RateLimit(PER_SECOND, AT_ONCE)
    home = urlsplit(sign_in.panel)
    path, secure = f"{home.path}{SIGN_IN.lstrip('/')}", home.scheme == "https"

    def check_rate(request: Request) -> None:
        asker = request.client.host if request.client else "unknown"
        if limit.wait(asker, clock.monotonic()):
            raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, "Too many sign-ins. Try again in a moment.")

    @router.get("/start")
    async def start(request: Request) -> Response:
        """Send the browser to the issuer."""
        check_rate(request)
        attempt = Attempt.new()
        try:
            answer = _sent(await sign_in.begin(attempt))
        except SignInError as error:
            return _failed(sign_in, error)
        answer.set_cookie(
            COOKIE, attempt.text(), PATIENCE, path=path, httponly=True, samesite="lax", secure=secure
        )
        return answer

    @router.get("/callback")
    async def callback(request: Request) -> Response:
        """Take the browser back: to the panel, whatever else the request asks for."""
        check_rate(request)
        attempt = Attempt.read(request.cookies.get(COOKIE, ""))
        try:
            done = await sign_in.finish(attempt, request.query_params)
            answer = _welcomed(sign_in, done, secure=secure)
        except SignInError as error:
            answer = _failed(sign_in, error)
        answer.delete_cookie(COOKIE, path=path, httponly=True, samesite="lax", secure=secure)
        return answer


def _welcomed(sign_in: SignIn, done: SignedIn, *, secure: bool) -> Response:
    if len(done.token) > TOKEN_LIMIT:
        message = f"the access token has {len(done.token)} characters: browsers keep {TOKEN_LIMIT}"
        raise SignInError("unfit", f"{message}. Have the issuer put fewer claims into it")
    answer = _sent(sign_in.panel)
    keep(answer, done.token, secure=secure)
    log.info("signed in", user=done.user.known_as, role=done.user.role.name.lower())
    return answer


def _failed(sign_in: SignIn, error: SignInError) -> Response:
    log.warning("nobody signed in by the OIDC issuer", why=error.why, reason=str(error))
    return _sent(f"{sign_in.panel}login.html?problem={error.why}")


def _sent(where: str) -> Response:
    return RedirectResponse(where, HTTPStatus.SEE_OTHER, {"cache-control": "no-store"})
