"""The issuer as this program knows it: asked when it is needed, remembered for a while."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from jwt import PyJWK

from nena_shared.clock import Clock, SystemClock
from nena_shared.log import get_logger
from nena_shared.web.oidc.bounded_http import BoundedHttp
from nena_shared.web.oidc.errors import IssuerAwayError, TokenRefusedError
from nena_shared.web.oidc.key_set import KeySet
from nena_shared.web.oidc.metadata import Metadata, metadata_of, place_of
from nena_shared.web.oidc.settings import OidcSettings
from nena_shared.web.oidc.token import Header
from nena_shared.web.rate_limit import RateLimit

log = get_logger(__name__)

FRESH = 3600.0
"""Seconds after which the first request has the issuer asked anew, which ends keys that it has taken back."""
KEPT = 24 * 3600.0
"""Seconds for which its keys count where it was not, or cannot be, asked anew."""
LOOKS_PER_SECOND = 0.1
LOOKS_AT_ONCE = 3
"""How often it is asked at most, whatever keys tokens name."""


@dataclass(frozen=True, slots=True)
class _Known:
    metadata: Metadata
    keys: KeySet
    at: float
    """Seconds of the monotonic clock."""


_Serves = Callable[[_Known], bool]
"""Tells whether what is known is enough for a request."""


class Issuer:
    """Gives the issuer's keys and description.

    It is asked once at a time. Nobody waits for that whom what is known serves.
    """

    def __init__(self, settings: OidcSettings, clock: Clock | None = None) -> None:
        """Prepare; nothing is asked yet.

        Raises:
            ConfigurationError: the file of who vouches for it cannot be used.

        """
        self.settings = settings
        self.http = BoundedHttp(settings)
        self.problem = ""
        """Why the last look failed; empty when it did not."""
        self._clock = clock or SystemClock()
        self._looks = RateLimit(LOOKS_PER_SECOND, LOOKS_AT_ONCE)
        self._lock = asyncio.Lock()
        self._known: _Known | None = None
        self._renewing: asyncio.Task[None] | None = None

    async def metadata(self) -> Metadata:
        """Give what it says of itself.

        Raises:
            IssuerAwayError: it cannot be asked.

        """
        return (await self._current(lambda _: True)).metadata

    async def key(self, header: Header) -> PyJWK:
        """Give the key that a token says it is signed with.

        Raises:
            TokenRefusedError: the issuer has no such key.
            IssuerAwayError: it cannot be asked, or was asked too often to be asked for this key too.

        """
        known = await self._current(lambda known: known.keys.has(header.kid, header.algorithm))
        key = known.keys.find(header.kid, header.algorithm)
        if key is None and self.problem:
            raise IssuerAwayError(self.problem)
        if key is None:
            message = "the issuer has no such key (kid)"
            raise TokenRefusedError(message)
        return key

    async def _current(self, serves: _Serves) -> _Known:
        """Give what is known at once where it serves, else what the issuer says now."""
        known = self._known
        if known and serves(known) and self._is_younger(known, KEPT):
            if not self._is_younger(known, FRESH):
                self._begin_to_renew()
            return known
        answered = await self._renew(serves)
        known = self._known
        if known and (answered or serves(known)) and self._is_younger(known, KEPT):
            return known
        raise IssuerAwayError(self.problem or "it was asked too often")

    def _begin_to_renew(self) -> None:
        """Have the issuer asked while requests go on; nothing happens where it is asked already."""
        if self._renewing is None or self._renewing.done():
            self._renewing = asyncio.create_task(self._renew_aside(), name="ask the OIDC issuer")

    async def _renew_aside(self) -> None:
        try:
            await self._renew(lambda _: True)
        except Exception:
            log.exception("the OIDC issuer was not asked; what is known counts for now")

    async def _renew(self, serves: _Serves) -> bool:
        """Ask the issuer, unless what it has just said serves; False: it was asked too often."""
        async with self._lock:
            known = self._known
            if known and serves(known) and self._is_younger(known, FRESH):
                return True
            if self._looks.wait("", self._clock.monotonic()):
                return False
            await self._look()
            return True

    async def _look(self) -> None:
        try:
            found = await self.http.get(place_of(self.settings.issuer))
            metadata = metadata_of(found, self.settings.issuer)
            keys = await self._keys(metadata.jwks_uri)
        except IssuerAwayError as error:
            if str(error) != self.problem:
                log.warning("the OIDC issuer cannot be asked; NeNa's own tokens count", reason=str(error))
            self.problem = str(error)
            return
        if self.problem or self._known is None:
            log.info("the OIDC issuer is known", issuer=self.settings.issuer)
        self.problem = ""
        self._known = _Known(metadata, keys, self._clock.monotonic())

    async def _keys(self, url: str) -> KeySet:
        try:
            return KeySet.of(await self.http.get(url))
        except ValueError as error:
            message = f"{url}: {error}"
            raise IssuerAwayError(message) from error

    def _is_younger(self, known: _Known, seconds: float) -> bool:
        return self._clock.monotonic() - known.at < seconds
