"""The OIDC issuer: its metadata and keys, fetched with limits and cached."""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import httpx
from jwt import PyJWK
from jwt.exceptions import PyJWTError
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from nena_shared.clock import Clock, SystemClock
from nena_shared.extensions.oidc.tokens import TokenHeader, header_of, verified
from nena_shared.extensions.oidc.users import user_of
from nena_shared.findings import in_words, shortened
from nena_shared.log import get_logger
from nena_shared.rate_limit import RateLimit
from nena_shared.settings import ConfigurationError
from nena_shared.web.issued_tokens import IssuerUnavailableError, OidcUser, TokenRefusedError
from nena_shared.web.settings import OidcSettings, ProtectedUrl

ANSWER_LIMIT = 512 * 1024
"""Maximum size of a response, bytes; a discovery document has about 5 KB, a key set somewhat more."""

Answer = tuple[int, dict[str, Any]]
"""Status and JSON object of a response."""


class BoundedHttp:
    """HTTP client with limits; opens a new connection for each request, as requests are rare."""

    def __init__(self, settings: OidcSettings) -> None:
        """Create the client; raises ConfigurationError if the CA file for the issuer is unusable."""
        self._timeout = settings.timeout
        try:
            self._tls = ssl.create_default_context(cafile=settings.ca)
        except OSError as error:
            raise ConfigurationError([f"http.oidc.ca: {settings.ca}: {error}"]) from error

    async def get(self, url: str) -> dict[str, Any]:
        """Fetch a JSON object.

        Raises:
            IssuerUnavailableError: no JSON object was received in time.
        """
        status, found = await self.ask("GET", url)
        if status != HTTPStatus.OK:
            raise IssuerUnavailableError(f"{url} answered {status}")
        return found

    async def ask(
        self,
        method: str,
        url: str,
        form: Mapping[str, str] | None = None,
        login: tuple[str, str] | None = None,
    ) -> Answer:
        """Send a request with ``form`` as body and ``login`` as user name and password.

        Raises:
            IssuerUnavailableError: no JSON object was received in time.
        """
        try:
            async with (
                # httpx's timeout counts for each read: an issuer that drips bytes would never reach it
                asyncio.timeout(self._timeout),
                httpx.AsyncClient(verify=self._tls, timeout=self._timeout, trust_env=False) as client,
                client.stream(method, url, data=form, auth=login, headers=HEADERS) as answer,
            ):
                found = json.loads(await _read_body(answer))
        except TimeoutError as error:
            raise IssuerUnavailableError(f"{url} has not answered within {self._timeout:g} s") from error
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            raise IssuerUnavailableError(f"{url}: {str(error) or type(error).__name__}") from error
        except (ValueError, RecursionError) as error:
            raise IssuerUnavailableError(f"{url} answered {answer.status_code}, which is not JSON") from error
        if not isinstance(found, dict):
            raise IssuerUnavailableError(f"{url} answered with JSON that is not an object")
        return answer.status_code, found


HEADERS = {"accept": "application/json", "accept-encoding": "identity"}
"""Requests uncompressed responses, so that the size limit applies to received and stored data alike."""


async def _read_body(answer: httpx.Response) -> bytes:
    body = bytearray()
    async for chunk in answer.aiter_raw():
        body += chunk
        if len(body) > ANSWER_LIMIT:
            raise IssuerUnavailableError(f"{answer.url} answered with more than {ANSWER_LIMIT} bytes")
    return bytes(body)


PROBLEMS_SHOWN = 5


class Metadata(BaseModel):
    """The parts of the issuer's metadata that are used here."""

    model_config = ConfigDict(frozen=True)

    issuer: str
    jwks_uri: ProtectedUrl
    authorization_endpoint: str = ""
    token_endpoint: str = ""
    # OpenID Connect Discovery 1.0, 3: the default of issuers that omit it
    token_endpoint_auth_methods_supported: tuple[str, ...] = Field(default=("client_secret_basic",))


def metadata_url(issuer: str) -> str:
    """Return the URL of an issuer's metadata."""
    return f"{issuer.rstrip('/')}/.well-known/openid-configuration"


def metadata_of(document: dict[str, Any], issuer: str) -> Metadata:
    """Parse the metadata of ``issuer``.

    Raises:
        IssuerUnavailableError: required fields are missing, or the metadata belongs to another issuer.
    """
    try:
        found = Metadata.model_validate(document)
    except ValidationError as error:
        problems = "; ".join(in_words(error.errors(), whole="the document", most=PROBLEMS_SHOWN))
        raise IssuerUnavailableError(f"{metadata_url(issuer)} is invalid: {problems}") from error
    # OpenID Connect Discovery 1.0, 4.3: exactly equal, or one issuer could name the keys of another
    if found.issuer != issuer:
        raise IssuerUnavailableError(
            f"its issuer is {shortened(repr(found.issuer))}: set http.oidc.issuer to exactly this value"
        )
    return found


KEYS_LIMIT = 100

KINDS = {"RS": "RSA", "PS": "RSA", "ES": "EC", "Ed": "OKP"}
"""Key type (kty) by the first letters of the signature algorithm. Shared secrets are not supported."""


class KeySet:
    """Public signature keys by key ID; all other keys are ignored."""

    def __init__(self, keys: Sequence[Mapping[str, Any]]) -> None:
        self._keys_at = keys
        self._made: dict[tuple[str | None, str], PyJWK] = {}

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> KeySet:
        """Parse a JWK Set; raises ValueError if the document is not a JWK Set, or contains no usable key."""
        listed = document.get("keys")
        if not isinstance(listed, list) or len(listed) > KEYS_LIMIT:
            raise ValueError(f"the document has no list of keys, or more than {KEYS_LIMIT} keys")
        usable = [each for each in listed if isinstance(each, dict) and _is_usable(each)]
        if not usable:
            raise ValueError("the document has no public signature key")
        return cls(usable)

    def has(self, kid: str | None, algorithm: str) -> bool:
        """Return whether :meth:`find` returns a key."""
        return self.find(kid, algorithm) is not None

    def find(self, kid: str | None, algorithm: str) -> PyJWK | None:
        """Return the key with this ID for a signature algorithm; without an ID, the only suitable key."""
        if (made := self._made.get((kid, algorithm))) is not None:
            return made
        fitting = [key for key in self._keys_at if _fits_key(key, kid, algorithm)]
        if len(fitting) != 1:
            return None
        try:
            made = PyJWK(dict(fitting[0]), algorithm=algorithm)
        # 0040: a damaged key makes only its own tokens unusable, not the whole set
        except PyJWTError:
            return None
        self._made[kid, algorithm] = made
        return made


def _is_usable(key: Mapping[str, Any]) -> bool:
    # RFC 7517, 4.2 and 4.4: `use` and `alg` are optional
    return key.get("kty") in KINDS.values() and key.get("use", "sig") == "sig"


def _fits_key(key: Mapping[str, Any], kid: str | None, algorithm: str) -> bool:
    named = kid is None or key.get("kid") == kid
    return named and key["kty"] == KINDS[algorithm[:2]] and key.get("alg", algorithm) == algorithm


log = get_logger(__name__)

FRESH = 3600.0
"""Age after which the next request fetches the keys again, which drops revoked ones, seconds."""
KEPT = 24 * 3600.0
"""Validity of cached keys while the issuer is unavailable, seconds."""
LOOKS_PER_SECOND = 0.1
LOOKS_AT_ONCE = 3
"""Maximum rate of requests to the issuer, however many unknown keys tokens name."""


@dataclass(frozen=True, slots=True)
class _KnownKeys:
    metadata: Metadata
    keys: KeySet
    at: float
    """Time of the fetch, monotonic seconds."""


_Serves = Callable[[_KnownKeys], bool]
"""Returns whether cached keys are sufficient for a request."""


class Issuer:
    """Fetches and caches the issuer's keys and metadata.

    Only one request to the issuer runs at a time. Requests that cached keys can serve do not wait for it.
    """

    def __init__(self, settings: OidcSettings, clock: Clock | None = None) -> None:
        """Create the issuer; nothing is requested yet.

        Raises:
            ConfigurationError: the CA file for the issuer is unusable.
        """
        self.settings = settings
        self.http = BoundedHttp(settings)
        self.problem = ""
        """Error of the last request; empty if it succeeded."""
        self._clock = clock or SystemClock()
        self._looks = RateLimit(LOOKS_PER_SECOND, LOOKS_AT_ONCE)
        self._lock = asyncio.Lock()
        self._known: _KnownKeys | None = None
        self._renewing: asyncio.Task[None] | None = None

    async def metadata(self) -> Metadata:
        """Return the issuer's metadata; raises IssuerUnavailableError if the issuer is unavailable."""
        return (await self._current_keys(lambda _: True)).metadata

    async def key(self, header: TokenHeader) -> PyJWK:
        """Return the signing key named in a token's header.

        Raises:
            TokenRefusedError: the issuer has no such key.
            IssuerUnavailableError: the issuer is unavailable, or the limit of requests to it is reached.
        """
        known = await self._current_keys(lambda known: known.keys.has(header.kid, header.algorithm))
        key = known.keys.find(header.kid, header.algorithm)
        # 0031: the issuer may have the key by now, so the token can be neither accepted nor refused
        if key is None and self.problem:
            raise IssuerUnavailableError(self.problem)
        if key is None:
            raise TokenRefusedError("the issuer does not have this key (kid)")
        return key

    async def _current_keys(self, serves: _Serves) -> _KnownKeys:
        """Return the cached keys if they are sufficient, else fetch them."""
        known = self._known
        if known and serves(known) and self._is_younger(known, KEPT):
            # in the background: an issuer that hangs delays no request that the known keys can serve
            if not self._is_younger(known, FRESH):
                self._begin_to_renew()
            return known
        answered = await self._renew_keys(serves)
        known = self._known
        if known and (answered or serves(known)) and self._is_younger(known, KEPT):
            return known
        raise IssuerUnavailableError(self.problem or "too many requests to the issuer")

    def _begin_to_renew(self) -> None:
        """Start renewing the keys in the background, unless a renewal is running."""
        if self._renewing is None or self._renewing.done():
            self._renewing = asyncio.create_task(self._renew_in_background(), name="ask the OIDC issuer")

    async def _renew_in_background(self) -> None:
        try:
            await self._renew_keys(lambda _: True)
        except Exception:
            log.exception("OIDC issuer unavailable; its known keys remain in use")

    async def _renew_keys(self, serves: _Serves) -> bool:
        """Fetch the keys unless they are sufficient by now; return False if the rate limit is reached."""
        async with self._lock:
            known = self._known
            if known and serves(known) and self._is_younger(known, FRESH):
                return True
            if self._looks.wait("", self._clock.monotonic()):
                return False
            await self._fetch_keys()
            return True

    async def _fetch_keys(self) -> None:
        try:
            found = await self.http.get(metadata_url(self.settings.issuer))
            metadata = metadata_of(found, self.settings.issuer)
            keys = await self._keys_at(metadata.jwks_uri)
        except IssuerUnavailableError as error:
            if str(error) != self.problem:
                log.warning("OIDC issuer unavailable; only NeNa's own tokens are accepted", reason=str(error))
            self.problem = str(error)
            return
        if self.problem or self._known is None:
            log.info("OIDC issuer reachable", issuer=self.settings.issuer)
        self.problem = ""
        self._known = _KnownKeys(metadata, keys, self._clock.monotonic())

    async def _keys_at(self, url: str) -> KeySet:
        try:
            return KeySet.of(await self.http.get(url))
        except ValueError as error:
            raise IssuerUnavailableError(f"{url}: {error}") from error

    def _is_younger(self, known: _KnownKeys, seconds: float) -> bool:
        return self._clock.monotonic() - known.at < seconds


class IssuerTokens:
    """Verifies the issuer's tokens for this service's audience."""

    def __init__(self, issuer: Issuer) -> None:
        self.issuer = issuer

    async def user_of(self, token: str) -> OidcUser:
        """Return the user of a token.

        Raises:
            TokenRefusedError: the token is invalid.
            NoRoleError: its user has no role here.
            IssuerUnavailableError: the issuer's keys are not available, so the token cannot be checked.
        """
        settings = self.issuer.settings
        return user_of(await self.claims(token, settings.audience), settings)

    async def claims(self, token: str, audience: str) -> dict[str, Any]:
        """Return the claims of a token of the issuer for ``audience``.

        Raises:
            TokenRefusedError: the token is invalid.
            IssuerUnavailableError: as in :meth:`user_of`.
        """
        settings = self.issuer.settings
        header = header_of(token, settings.algorithms)
        key = await self.issuer.key(header)
        return verified(token, key, header, issuer=settings.issuer, audience=audience, leeway=settings.leeway)


def make_reader(settings: OidcSettings) -> IssuerTokens:
    """Return what reads the tokens of an issuer.

    Raises:
        ConfigurationError: the CA file for the issuer is unusable.
    """
    return IssuerTokens(Issuer(settings))
