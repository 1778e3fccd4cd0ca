"""Knows users by the issuer's access tokens."""

from __future__ import annotations

from typing import Any

from nena_shared.web.oidc.issuer import Issuer
from nena_shared.web.oidc.person import OidcUser, user_of
from nena_shared.web.oidc.token import header_of, verified


class AccessTokens:
    """Takes tokens that the issuer has made for this service's audience."""

    def __init__(self, issuer: Issuer) -> None:
        self.issuer = issuer

    async def who(self, token: str) -> OidcUser:
        """Give whose token it is.

        Raises:
            TokenRefusedError: it does not count.
            NoRoleError: its owner has no role here.
            IssuerAwayError: the issuer's keys are not to be had, so nothing can be said.

        """
        settings = self.issuer.settings
        return user_of(await self.claims(token, settings.audience), settings)

    async def claims(self, token: str, audience: str) -> dict[str, Any]:
        """Give the claims of a token of the issuer for ``audience``.

        Raises:
            TokenRefusedError: it does not count.
            IssuerAwayError: as :meth:`who`.

        """
        settings = self.issuer.settings
        header = header_of(token, settings.algorithms)
        key = await self.issuer.key(header)
        return verified(token, key, header, issuer=settings.issuer, audience=audience, leeway=settings.leeway)
