"""Signing in at the panel: authorization code flow with PKCE, state and nonce (OpenID Connect, RFC 7636).

Nothing is kept here while somebody is at the issuer: what has to be known again at their return is with their
browser, in a cookie that scripts do not get.
"""

from __future__ import annotations

import secrets
from base64 import urlsafe_b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from hmac import compare_digest
from http import HTTPStatus
from typing import TYPE_CHECKING, Literal, Self
from urllib.parse import quote, urlencode

from nena_shared.log import get_logger
from nena_shared.web.oidc.errors import IssuerAwayError, NoRoleError, TokenRefusedError
from nena_shared.web.oidc.metadata import Metadata
from nena_shared.web.oidc.person import OidcUser
from nena_shared.web.oidc.settings import protected_url
from nena_status_aggregator.settings import PanelOidcSettings

if TYPE_CHECKING:  # its libraries are an extra
    from nena_shared.web.oidc.access_tokens import AccessTokens
from urllib.parse import urlsplit

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from typing_extensions import TypedDict

from nena_shared.clock import Clock
from nena_shared.web.rate_limit import RateLimit
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.api.session import SIGN_IN, TOKEN_LIMIT, keep

log = get_logger(__name__)

CALLBACK = "api/v1/session/oidc/callback"
"""Where the issuer sends browsers back to, below the panel."""

SHOWN = 200
"""Characters of an issuer's own words that are logged."""

Why = Literal["away", "expired", "refused", "role", "unfit"]


class SignInError(Exception):
    """Nobody is signed in; ``why`` is what the page tells, the text what the log tells."""

    def __init__(self, why: Why, reason: str) -> None:
        super().__init__(reason)
        self.why = why


@dataclass(frozen=True, slots=True)
class Attempt:
    """What a browser has to bring back."""

    state: str
    """Shows that who comes back is who went."""
    nonce: str
    """Shows that the ID token was made for this sign-in."""
    verifier: str
    """Shows the issuer that who has the code is who asked for it."""

    @classmethod
    def new(cls) -> Self:
        """Make one that nobody guesses."""
        return cls(*(secrets.token_urlsafe(32) for _ in range(3)))

    @classmethod
    def read(cls, text: str) -> Self | None:
        """Read what :meth:`text` has made; None: it is something else."""
        parts = text.split(".")
        return cls(*parts) if len(parts) == 3 and all(parts) else None  # noqa: PLR2004 - the fields

    def text(self) -> str:
        """Give it as the value of a cookie."""
        return f"{self.state}.{self.nonce}.{self.verifier}"

    @property
    def challenge(self) -> str:
        """What the issuer gets of the verifier at first (S256)."""
        return urlsafe_b64encode(sha256(self.verifier.encode()).digest()).rstrip(b"=").decode()


@dataclass(frozen=True, slots=True)
class SignedIn:
    """Somebody, and the access token that says so."""

    user: OidcUser
    token: str


class SignIn:
    """Sends browsers to the issuer, and takes them back."""

    def __init__(self, tokens: AccessTokens, settings: PanelOidcSettings) -> None:
        """Prepare; ``settings`` name a client.

        Raises:
            ConfigurationError: the file with the client's password cannot be used.

        """
        self.panel = f"{str(settings.panel_url).rstrip('/')}/"
        self._client = str(settings.client_id)
        self._secret = settings.secret()
        self._scopes = " ".join(settings.scopes)
        self._tokens = tokens
        self._issuer = tokens.issuer

    async def begin(self, attempt: Attempt) -> str:
        """Tell where to send a browser.

        Raises:
            SignInError: the issuer cannot be asked where that is.

        """
        try:
            place = (await self._issuer.metadata()).authorization_endpoint
        except IssuerAwayError as error:
            raise SignInError("away", str(error)) from error
        asked = {
            "response_type": "code",
            "client_id": self._client,
            "redirect_uri": self._callback,
            "scope": self._scopes,
            "state": attempt.state,
            "nonce": attempt.nonce,
            "code_challenge": attempt.challenge,
            "code_challenge_method": "S256",
        }
        return f"{_protected(place)}{'&' if '?' in place else '?'}{urlencode(asked)}"

    async def finish(self, attempt: Attempt | None, came: Mapping[str, str]) -> SignedIn:
        """Take a browser back; ``came`` is what the issuer has sent with it.

        Raises:
            SignInError: nobody is signed in.

        """
        if attempt is None or not _is_same(came.get("state", ""), attempt.state):
            raise SignInError("expired", "the browser does not bring the state of its sign-in")
        if "code" not in came:
            raise SignInError("refused", f"the issuer says {came.get('error', 'nothing')[:SHOWN]!r}")
        try:
            return await self._exchange(attempt, came["code"])
        except IssuerAwayError as error:
            raise SignInError("away", str(error)) from error
        except NoRoleError as error:
            raise SignInError("role", str(error)) from error
        except TokenRefusedError as error:
            raise SignInError("unfit", f"a token is not accepted: {error}") from error

    async def _exchange(self, attempt: Attempt, code: str) -> SignedIn:
        metadata = await self._issuer.metadata()
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": self._callback,
            "code_verifier": attempt.verifier,
        }
        login = self._login(metadata, form)
        status, given = await self._issuer.http.ask("POST", _protected(metadata.token_endpoint), form, login)
        if status != HTTPStatus.OK:
            raise SignInError("refused", f"the issuer says {str(given.get('error'))[:SHOWN]!r} ({status})")
        access, identity = given.get("access_token"), given.get("id_token")
        if not isinstance(access, str) or not isinstance(identity, str):
            raise SignInError("unfit", "the issuer gives no access_token or no id_token")
        claims = await self._tokens.claims(identity, self._client)
        if not _is_same(str(claims.get("nonce")), attempt.nonce):
            raise SignInError("unfit", "the ID token is of another sign-in (nonce)")
        if claims.get("azp", self._client) != self._client:
            raise SignInError("unfit", "the ID token was made for another client (azp)")
        user = await self._tokens.who(access)
        if user.subject != claims["sub"]:
            raise SignInError("unfit", "access token and ID token are of two people (sub)")
        return SignedIn(user, access)

    @property
    def _callback(self) -> str:
        return f"{self.panel}{CALLBACK}"

    def _login(self, metadata: Metadata, form: dict[str, str]) -> tuple[str, str] | None:
        """Say who asks, in the way that the issuer takes (RFC 6749, section 2.3.1)."""
        if self._secret is None:
            form["client_id"] = self._client
            return None
        if "client_secret_basic" in metadata.token_endpoint_auth_methods_supported:
            return quote(self._client, safe=""), quote(self._secret, safe="")
        form |= {"client_id": self._client, "client_secret": self._secret}
        return None


def sign_in_of(tokens: AccessTokens | None) -> SignIn | None:
    """Give the sign-in by the issuer where the settings name a client; None: they do not.

    Raises:
        ConfigurationError: the file with the client's password cannot be used.

    """
    settings = tokens.issuer.settings if tokens else None
    if tokens is None or not isinstance(settings, PanelOidcSettings) or settings.client_id is None:
        return None
    if settings.client_id == settings.audience:
        log.warning(
            "ID tokens count as access tokens: http.oidc.audience is the panel's client_id; choose another",
            audience=settings.audience,
        )
    return SignIn(tokens, settings)


def _is_same(shown: str, kept: str) -> bool:
    """Compare in a time that tells nothing; JSON may hold halves of characters (surrogates)."""
    one, other = (text.encode("utf-8", "surrogatepass") for text in (shown, kept))
    return compare_digest(one, other)


def _protected(place: str) -> str:
    try:
        return protected_url(place)
    except ValueError as error:
        raise SignInError("away", f"the issuer's endpoint {place!r}: {error}") from error


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
