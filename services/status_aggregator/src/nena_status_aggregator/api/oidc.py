"""OpenID Connect sign-in at the panel, ``/api/v1/session/oidc``.

Uses the authorization code flow with PKCE, state and nonce. The server stores nothing during a sign-in; the
values to verify are in an HttpOnly cookie.
"""

from __future__ import annotations

import secrets
from base64 import urlsafe_b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from hmac import compare_digest
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Literal, Self
from urllib.parse import quote, urlencode, urlsplit

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from typing_extensions import TypedDict

from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.rate_limit import RateLimit
from nena_shared.web.issued_tokens import IssuerUnavailableError, NoRoleError, OidcUser, TokenRefusedError
from nena_shared.web.settings import protected_url
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.api.session import SIGN_IN, TOKEN_LIMIT, keep
from nena_status_aggregator.settings import PanelOidcSettings

if TYPE_CHECKING:
    from nena_shared.extensions.oidc.issuer import IssuerTokens, Metadata


log = get_logger(__name__)

CALLBACK = "api/v1/session/oidc/callback"
"""Path of the redirect URI, below the panel's URL."""

LOGGED_LENGTH = 200
"""Maximum logged length of an issuer's text, characters."""

Why = Literal["away", "expired", "refused", "role", "unfit"]


class SignInError(Exception):
    """Sign-in failed; ``why`` is shown on the sign-in page, the message is logged."""

    def __init__(self, why: Why, reason: str) -> None:
        super().__init__(reason)
        self.why = why


@dataclass(frozen=True, slots=True)
class Attempt:
    """Values that a browser must return after authentication at the issuer (RFC 7636, OpenID Connect)."""

    state: str
    """Binds the response to this browser."""
    nonce: str
    """Binds the ID token to this sign-in."""
    verifier: str
    """Binds the authorization code to this client (PKCE)."""

    @classmethod
    def new(cls) -> Self:
        """Create an unguessable attempt."""
        return cls(*(secrets.token_urlsafe(32) for _ in range(3)))

    @classmethod
    def read(cls, text: str) -> Self | None:
        """Parse the result of :meth:`text`; None if it is invalid."""
        parts = text.split(".")
        return cls(*parts) if len(parts) == 3 and all(parts) else None  # noqa: PLR2004 - the fields

    def text(self) -> str:
        """Return the attempt as a cookie value."""
        return f"{self.state}.{self.nonce}.{self.verifier}"

    @property
    def challenge(self) -> str:
        """The PKCE code challenge (S256)."""
        return urlsafe_b64encode(sha256(self.verifier.encode()).digest()).rstrip(b"=").decode()


@dataclass(frozen=True, slots=True)
class SignedIn:
    """A signed-in user and the access token."""

    user: OidcUser
    token: str


class SignIn:
    """The authorization code flow between browser and issuer."""

    def __init__(self, tokens: IssuerTokens, settings: PanelOidcSettings) -> None:
        """Create the flow; ``settings`` define a client.

        Raises:
            ConfigurationError: the client secret file is unusable.
        """
        self.panel = f"{str(settings.panel_url).rstrip('/')}/"
        self._client = str(settings.client_id)
        self._secret = settings.secret()
        self._scopes = " ".join(settings.scopes)
        self._tokens = tokens
        self._issuer = tokens.issuer

    async def begin(self, attempt: Attempt) -> str:
        """Return the URL of the issuer's sign-in page.

        Raises:
            SignInError: the issuer's metadata is unavailable.
        """
        try:
            place = (await self._issuer.metadata()).authorization_endpoint
        except IssuerUnavailableError as error:
            raise SignInError("away", str(error)) from error
        asked = {
            "response_type": "code",
            "client_id": self._client,
            "redirect_uri": self._callback_url,
            "scope": self._scopes,
            "state": attempt.state,
            "nonce": attempt.nonce,
            "code_challenge": attempt.challenge,
            "code_challenge_method": "S256",
        }
        return f"{_check_protected(place)}{'&' if '?' in place else '?'}{urlencode(asked)}"

    async def finish(self, attempt: Attempt | None, query: Mapping[str, str]) -> SignedIn:
        """Complete a sign-in; ``query`` is the query of the issuer's redirect.

        Raises:
            SignInError: the sign-in failed.
        """
        if attempt is None or not _is_same(query.get("state", ""), attempt.state):
            raise SignInError("expired", "missing or wrong state parameter")
        if "code" not in query:
            raise SignInError(
                "refused", f"the issuer answered {query.get('error', 'nothing')[:LOGGED_LENGTH]!r}"
            )
        try:
            return await self._exchange_code(attempt, query["code"])
        except IssuerUnavailableError as error:
            raise SignInError("away", str(error)) from error
        except NoRoleError as error:
            raise SignInError("role", str(error)) from error
        except TokenRefusedError as error:
            raise SignInError("unfit", f"token rejected: {error}") from error

    async def _exchange_code(self, attempt: Attempt, code: str) -> SignedIn:
        metadata = await self._issuer.metadata()
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": self._callback_url,
            "code_verifier": attempt.verifier,
        }
        login = self._client_login(metadata, form)
        status, answer = await self._issuer.http.ask(
            "POST", _check_protected(metadata.token_endpoint), form, login
        )
        if status != HTTPStatus.OK:
            raise SignInError(
                "refused", f"the issuer answered {str(answer.get('error'))[:LOGGED_LENGTH]!r} ({status})"
            )
        access, identity = answer.get("access_token"), answer.get("id_token")
        if not isinstance(access, str) or not isinstance(identity, str):
            raise SignInError("unfit", "the issuer returned no access_token or no id_token")
        claims = await self._tokens.claims(identity, self._client)
        if not _is_same(str(claims.get("nonce")), attempt.nonce):
            raise SignInError("unfit", "the ID token belongs to another sign-in (nonce)")
        # OpenID Connect Core 3.1.3.7: a token for several audiences has to name in azp whom it was issued to.
        assumed = self._client if claims["aud"] in (self._client, [self._client]) else None
        if claims.get("azp", assumed) != self._client:
            raise SignInError("unfit", "the ID token belongs to another client (azp)")
        user = await self._tokens.user_of(access)
        # Else a stolen access token of somebody else could be slipped into this sign-in.
        if user.subject != claims["sub"]:
            raise SignInError("unfit", "access token and ID token belong to different users (sub)")
        return SignedIn(user, access)

    @property
    def _callback_url(self) -> str:
        return f"{self.panel}{CALLBACK}"

    def _client_login(self, metadata: Metadata, form: dict[str, str]) -> tuple[str, str] | None:
        """Authenticate the client with a method that the issuer supports (RFC 6749, 2.3.1)."""
        if self._secret is None:
            form["client_id"] = self._client
            return None
        if "client_secret_basic" in metadata.token_endpoint_auth_methods_supported:
            return quote(self._client, safe=""), quote(self._secret, safe="")
        form |= {"client_id": self._client, "client_secret": self._secret}
        return None


def sign_in_of(tokens: Any) -> SignIn | None:  # noqa: ANN401 - IssuerTokens; loaded by access control
    """Return the sign-in if the settings define a client, else None.

    Raises:
        ConfigurationError: the client secret file is unusable.
    """
    settings = tokens.issuer.settings if tokens else None
    if tokens is None or not isinstance(settings, PanelOidcSettings) or settings.client_id is None:
        return None
    if settings.client_id == settings.audience:
        log.warning(
            "http.oidc.audience equals client_id: ID tokens count as access tokens; use another audience",
            audience=settings.audience,
        )
    return SignIn(tokens, settings)


def _is_same(shown: str, kept: str) -> bool:
    """Compare in constant time; supports lone surrogates, which JSON may contain."""
    return compare_digest(shown.encode("utf-8", "surrogatepass"), kept.encode("utf-8", "surrogatepass"))


def _check_protected(place: str) -> str:
    try:
        return protected_url(place)
    except ValueError as error:
        raise SignInError("away", f"the issuer's endpoint {place!r}: {error}") from error


COOKIE = "nena_sign_in"
"""Cookie of the attempt. SameSite=Lax, so that browsers send it with the issuer's redirect."""
TIMEOUT = 600
"""Time for a user to authenticate at the issuer, seconds."""
PER_SECOND = 0.5
AT_ONCE = 20
"""Rate limit of sign-in requests per client address, as each may cause a request to the issuer."""


class Offer(TypedDict):
    """URL that starts a sign-in; null without an issuer."""

    start: str | None


def make_router(sign_in: SignIn | None, clock: Clock) -> APIRouter:
    """Create the routes; without ``sign_in`` only the offer, which is null."""
    router = APIRouter(prefix=SIGN_IN, tags=["session"])

    @router.get("")
    async def offer() -> Offer:
        """Return the URL that starts the OIDC sign-in."""
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
            raise ProblemError(
                Rejection.TOO_MANY_SIGN_INS, "Too many sign-in requests. Try again in a moment."
            )

    @router.get("/start")
    async def start(request: Request) -> Response:
        """Redirect the browser to the issuer."""
        check_rate(request)
        attempt = Attempt.new()
        try:
            answer = _redirect_to(await sign_in.begin(attempt))
        except SignInError as error:
            return _report_failure(sign_in, error)
        answer.set_cookie(
            COOKIE, attempt.text(), TIMEOUT, path=path, httponly=True, samesite="lax", secure=secure
        )
        return answer

    @router.get("/callback")
    async def callback(request: Request) -> Response:
        """Complete the sign-in and redirect to the panel."""
        check_rate(request)
        attempt = Attempt.read(request.cookies.get(COOKIE, ""))
        try:
            done = await sign_in.finish(attempt, request.query_params)
            answer = _signed_in(sign_in, done, secure=secure)
        except SignInError as error:
            answer = _report_failure(sign_in, error)
        answer.delete_cookie(COOKIE, path=path, httponly=True, samesite="lax", secure=secure)
        return answer


def _signed_in(sign_in: SignIn, done: SignedIn, *, secure: bool) -> Response:
    if len(done.token) > TOKEN_LIMIT:
        message = f"the access token has {len(done.token)} characters; a cookie holds {TOKEN_LIMIT}"
        raise SignInError("unfit", f"{message}. Reduce its claims at the issuer")
    answer = _redirect_to(sign_in.panel)
    keep(answer, done.token, secure=secure)
    log.info("signed in", user=done.user.known_as, role=done.user.role.name.lower())
    return answer


def _report_failure(sign_in: SignIn, error: SignInError) -> Response:
    log.warning("OIDC sign-in failed", why=error.why, reason=str(error))
    return _redirect_to(f"{sign_in.panel}login.html?problem={error.why}")


def _redirect_to(where: str) -> Response:
    return RedirectResponse(where, HTTPStatus.SEE_OTHER, {"cache-control": "no-store"})
