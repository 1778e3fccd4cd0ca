"""Who may do what over HTTP: every request shows a token, and the token's user has the role that it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from math import ceil

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from nena_shared.clock import Clock, SystemClock
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError
from nena_shared.web.lasting_answer import LastingAnswer
from nena_shared.web.problem import refusal
from nena_shared.web.rate_limit import RateLimit
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role, User, UserBook, users_of

log = get_logger(__name__)

COOKIE = "nena_token"
"""Where a browser keeps its token: out of reach of scripts, and never sent from other sites' pages."""

WRONG_TOKENS_PER_SECOND = 0.2
WRONG_TOKENS_AT_ONCE = 10
"""How often an address may show a token that nobody has."""

RoleNeeded = Callable[[str, str], Role | None]
"""Tells from method and path what a request takes; None: it is for everybody."""


class Refused(Exception):  # noqa: N818 - it is an answer, no fault
    """A request that is not let through."""

    def __init__(self, status: HTTPStatus, detail: str, **headers: str) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers


@dataclass(slots=True)
class AccessControl:
    """ASGI middleware; leaves the :class:`User` in ``request.state.user``, None where nobody is known."""

    app: ASGIApp
    settings: HttpSettings
    role_needed: RoleNeeded
    book: UserBook | None
    """Who may log in; None: nobody has to."""
    clock: Clock = field(default_factory=SystemClock)
    cookies: bool = False
    """Whether a browser may show its token as a cookie: only where requests of other pages are refused."""
    _requests: RateLimit = field(init=False)
    _wrong_tokens: RateLimit = field(init=False)

    def __post_init__(self) -> None:
        self._requests = RateLimit(self.settings.requests_per_second, self.settings.burst)
        self._wrong_tokens = RateLimit(WRONG_TOKENS_PER_SECOND, WRONG_TOKENS_AT_ONCE)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or answer 401, 403, 429 or 503."""
        if scope["type"] == "http":
            try:
                scope.setdefault("state", {})["user"] = self._let_in(scope)
            except Refused as error:
                answer = refusal(error.status, error.detail, error.headers)
                await answer(scope, receive, send)
                return
            if scope["method"] == "GET" and self.book and scope["state"]["user"]:
                may_stay = partial(self._may_stay, scope)
                lasting = LastingAnswer(receive, send, allowed=may_stay, clock=self.clock)
                receive, send = lasting.receive, lasting.send
        await self.app(scope, receive, send)

    def _let_in(self, scope: Scope) -> User | None:
        address = scope["client"][0] if scope.get("client") else "unknown"
        headers = Headers(scope=scope)
        role = self.role_needed(scope["method"], scope["path"])
        token = token_of(headers, cookies=self.cookies)
        user = self._who(token, address) if token and role else None
        self._check_rate(self._requests, f"user {user.name}" if user else address, self.clock.monotonic())
        if self.book is None or role is None:
            return user
        if user is None:
            detail = "Log in: send your token as `Authorization: Bearer TOKEN`."
            raise Refused(HTTPStatus.UNAUTHORIZED, detail, **{"www-authenticate": 'Bearer realm="NeNa"'})
        if user.role < role:
            detail = f"{user.name} is {user.role.name.lower()}; this takes the role {role.name.lower()}."
            raise Refused(HTTPStatus.FORBIDDEN, detail)
        if role > Role.VIEWER:
            log.info("command let in", user=user.name, method=scope["method"], path=scope["path"])
        return user

    def _may_stay(self, scope: Scope) -> bool:
        """Tell whether somebody who was let in would be let in again."""
        role = self.role_needed(scope["method"], scope["path"])
        token = token_of(Headers(scope=scope), cookies=self.cookies)
        try:
            user = self.book.who(token) if self.book else None
        except ConfigurationError:
            user = None
        if user is None or (role and user.role < role):
            log.info("an answer ends: its user may no longer have it", user=scope["state"]["user"].name)
            return False
        return True

    def _who(self, token: str, address: str) -> User | None:
        if self.book is None:
            return None
        try:
            user = self.book.who(token)
        except ConfigurationError as error:
            log.error("nobody is let in: the file of users cannot be used", problems=error.problems)  # noqa: TRY400
            detail = "The file of users cannot be used; the service's log says why."
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, detail) from error
        if user is None:
            log.warning("a token that nobody has", address=address)
            self._check_rate(self._wrong_tokens, address, self.clock.monotonic())
        return user

    def _check_rate(self, limit: RateLimit, asker: str, now: float, *, cost: float = 1.0) -> None:
        if seconds := limit.wait(asker, now, cost=cost):
            detail = f"Too many requests. Ask again in {seconds:.1f} s."
            raise Refused(HTTPStatus.TOO_MANY_REQUESTS, detail, **{"retry-after": str(ceil(seconds))})


def protect(app: ASGIApp, settings: HttpSettings, role_needed: RoleNeeded) -> AccessControl:
    """Put access control before ``app``, with the users that the settings name.

    Raises:
        ConfigurationError: the file of users cannot be used.

    """
    return AccessControl(app, settings, role_needed, users_of(settings))


def token_of(headers: Headers, *, cookies: bool) -> str:
    """Give the token that a request shows, in its header or, where that is taken, its cookie; empty: none."""
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return token.strip()
    if not cookies:
        return ""
    try:
        found = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return ""
    return found[COOKIE].value if COOKIE in found else ""


def reading_or(operating: Role, *, everybody: frozenset[str]) -> RoleNeeded:
    """Make the plain rule: who reads is a viewer, who changes something has ``operating``."""

    def needed(method: str, path: str) -> Role | None:
        if path in everybody:
            return None
        return Role.VIEWER if method in ("GET", "HEAD", "OPTIONS") else operating

    return needed
