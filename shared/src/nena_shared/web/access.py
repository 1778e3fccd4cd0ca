"""Access control over HTTP: users, roles, cookies, OIDC tokens and rate limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from importlib.metadata import entry_points
from math import ceil

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from nena_shared.clock import Clock, SystemClock
from nena_shared.fleet_api.base import Role
from nena_shared.log import get_logger
from nena_shared.rate_limit import RateLimit
from nena_shared.settings import ConfigurationError
from nena_shared.web.issued_tokens import (
    GROUP,
    AccessTokens,
    IssuerUnavailableError,
    NoRoleError,
    OidcUser,
    TokenRefusedError,
)
from nena_shared.web.problem import refusal
from nena_shared.web.server_sent_events import while_allowed
from nena_shared.web.settings import HttpSettings, OidcSettings
from nena_shared.web.users import User, UsersFile, users_of


def access_tokens_of(settings: HttpSettings) -> AccessTokens | None:
    """Return the reader of the OIDC issuer's tokens; None: no issuer is configured.

    Raises:
        ConfigurationError: the libraries are not installed, or a file is unusable.
    """
    if settings.oidc is None:
        return None
    try:
        make_reader: Callable[[OidcSettings], AccessTokens] = entry_points(group=GROUP)["oidc"].load()
    except (ImportError, KeyError) as error:
        problem = f"http.oidc.issuer: {error}; install this service with its extra: pip install SERVICE[oidc]"
        raise ConfigurationError([problem]) from error
    return make_reader(settings.oidc)


log = get_logger(__name__)

COOKIE = "nena_token"
"""Cookie with a browser's token: HttpOnly and SameSite."""

DOTS_OF_JWT = 2
"""Number of dots in an OIDC token (JWT); NeNa's own tokens contain none."""

ISSUER_RETRY = 10
"""Retry-After for tokens that could not be checked, seconds."""

WRONG_TOKENS_PER_SECOND = 0.2
WRONG_TOKENS_AT_ONCE = 10
"""Rate limit of invalid tokens per address."""

KnownUser = User | OidcUser

RoleNeeded = Callable[[str, str], Role | None]
"""Returns the required role of a request, by method and path; None: no login required."""


class Refused(Exception):  # noqa: N818 - it is an answer, no fault
    """A request is rejected."""

    def __init__(self, status: HTTPStatus, detail: str, **headers: str) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers


@dataclass(slots=True)
class AccessControl:
    """ASGI middleware that authenticates requests and sets ``request.state.user``; None: no user."""

    app: ASGIApp
    settings: HttpSettings
    role_needed: RoleNeeded
    users: UsersFile | None
    """Users with NeNa's own tokens."""
    clock: Clock = field(default_factory=SystemClock)
    cookies: bool = False
    """Whether tokens are accepted in a cookie; only for services that refuse requests of other origins."""
    oidc: AccessTokens | None = None
    """Users with tokens of an OIDC issuer. Without this and ``users``, no login is required."""
    _requests: RateLimit = field(init=False)
    _wrong_tokens: RateLimit = field(init=False)

    def __post_init__(self) -> None:
        self._requests = RateLimit(self.settings.requests_per_second, self.settings.burst)
        self._wrong_tokens = RateLimit(WRONG_TOKENS_PER_SECOND, WRONG_TOKENS_AT_ONCE)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or answer 401, 403, 429 or 503."""
        if scope["type"] == "http":
            try:
                scope.setdefault("state", {})["user"] = await self._authenticate_request(scope)
            except Refused as error:
                answer = refusal(error.status, error.detail, error.headers)
                await answer(scope, receive, send)
                return
            if scope["method"] == "GET" and self._login_required and scope["state"]["user"]:
                send = while_allowed(send, partial(self._may_stay, scope), self.clock)
        await self.app(scope, receive, send)

    @property
    def _login_required(self) -> bool:
        return self.users is not None or self.oidc is not None

    async def _authenticate_request(self, scope: Scope) -> KnownUser | None:
        address = scope["client"][0] if scope.get("client") else "unknown"
        role = self.role_needed(scope["method"], scope["path"])
        token = token_of(scope, cookies=self.cookies)
        user = await self._user_of(token, address) if token and role else None
        # with the kind in front: behind a careless proxy, a client can name itself like a user
        self._check_rate(self._requests, f"user {user.known_as}" if user else f"address {address}")
        if not self._login_required or role is None:
            return user
        if user is None:
            detail = "Log in: send your token as `Authorization: Bearer TOKEN`."
            raise _unknown_user(f"Unknown token. {detail}" if token else detail)
        if user.role < role:
            detail = f"{user.name} is {user.role.name.lower()}; this requires the role {role.name.lower()}."
            raise Refused(HTTPStatus.FORBIDDEN, detail)
        if role > Role.VIEWER:
            log.info("command accepted", user=user.known_as, method=scope["method"], path=scope["path"])
        return user

    def _may_stay(self, scope: Scope) -> bool:
        """Return whether the user of an open stream still has access."""
        user = scope["state"]["user"]
        # 0031: a right that the issuer withdraws ends with the token; nothing is asked meanwhile
        stays = self.clock.now() < user.expires if isinstance(user, OidcUser) else self._has_access(scope)
        if not stays:
            log.info("event stream ended: its user has lost access", user=user.known_as)
        return stays

    def _has_access(self, scope: Scope) -> bool:
        role = self.role_needed(scope["method"], scope["path"])
        token = token_of(scope, cookies=self.cookies)
        try:
            user = self.users.user_of(token) if self.users else None
        except ConfigurationError:
            return False
        return user is not None and (role is None or user.role >= role)

    async def _user_of(self, token: str, address: str) -> KnownUser | None:
        user = self._own_user(token) or await self._of_issuer(token, address)
        if user is None and self._login_required:
            self._count_wrong(address)
            log.warning("unknown token", address=address)
        return user

    def _own_user(self, token: str) -> User | None:
        try:
            return self.users.user_of(token) if self.users else None
        except ConfigurationError as error:
            # not the users of the last valid file: one of them may have been removed
            log.error("all logins are refused: the users file is invalid", problems=error.problems)  # noqa: TRY400
            detail = "The users file is invalid; see the service's log."
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, detail) from error

    async def _of_issuer(self, token: str, address: str) -> OidcUser | None:
        # so that an invented token of our own form causes no request to the issuer
        if self.oidc is None or token.count(".") != DOTS_OF_JWT:
            return None
        try:
            return await self.oidc.user_of(token)
        except TokenRefusedError as error:
            # these count, too: each has cost the check of a signature, and fills the log
            self._count_wrong(address)
            log.warning("invalid OIDC token", address=address, reason=str(error))
            raise _unknown_user(
                f"The token is not accepted: {error}. Sign in again.", "invalid_token"
            ) from error
        except NoRoleError as error:
            self._count_wrong(address)
            log.warning("user without a role", address=address, reason=str(error))
            raise Refused(HTTPStatus.FORBIDDEN, str(error)) from error
        except IssuerUnavailableError as error:
            self._count_wrong(address)
            log.warning("token could not be checked", address=address, reason=str(error))
            detail = (
                "The token cannot be checked: the OIDC issuer is unavailable; see the "
                "service's log. NeNa's own tokens still work."
            )
            wait = {"retry-after": str(ISSUER_RETRY)}
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, detail, **wait) from error

    def _count_wrong(self, address: str) -> None:
        """Count an invalid token; beyond the limit, reject it without a log line."""
        self._check_rate(self._wrong_tokens, address)

    def _check_rate(self, limit: RateLimit, asker: str) -> None:
        if seconds := limit.wait(asker, self.clock.monotonic()):
            detail = f"Too many requests. Retry in {seconds:.1f} s."
            raise Refused(HTTPStatus.TOO_MANY_REQUESTS, detail, **{"retry-after": str(ceil(seconds))})


def _unknown_user(detail: str, error: str = "") -> Refused:
    challenge = 'Bearer realm="NeNa"' + (f', error="{error}"' if error else "")
    return Refused(HTTPStatus.UNAUTHORIZED, detail, **{"www-authenticate": challenge})


def protect(app: ASGIApp, settings: HttpSettings, role_needed: RoleNeeded) -> AccessControl:
    """Wrap ``app`` in access control for the configured users.

    Raises:
        ConfigurationError: the users file is unusable, or the libraries for OIDC are missing.
    """
    oidc = access_tokens_of(settings)
    return AccessControl(app, settings, role_needed, users_of(settings), oidc=oidc)


def user_of(scope: Scope) -> KnownUser | None:
    """Return the user that :class:`AccessControl` has found; None: no user."""
    user: KnownUser | None = scope.get("state", {}).get("user")
    return user


def token_of(scope: Scope, *, cookies: bool) -> str:
    """Return the token of a request, from its header, else its cookie; empty: none."""
    headers = Headers(scope=scope)
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
