"""What access control knows of tokens that others issue, such as an OIDC issuer."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from nena_shared.fleet_api.base import Role


class TokenRefusedError(Exception):
    """The token is invalid; the message is the reason, e.g. "it has expired"."""


class NoRoleError(Exception):
    """The token is valid, but its user has no role; the message explains what to do."""


class IssuerUnavailableError(Exception):
    """The issuer is unavailable, so its tokens cannot be checked; the message explains why."""


@dataclass(frozen=True, slots=True)
class OidcUser:
    """A user authenticated by the issuer."""

    name: str
    role: Role
    subject: str
    """The issuer's ID of the user; never reused."""
    expires: datetime
    """Expiry of the token and its sessions, including leeway."""

    @property
    def known_as(self) -> str:
        """Unique identity; differs from those of NeNa's own users, even if the names are equal."""
        return f"{self.name} (subject {self.subject})"


class AccessTokens(Protocol):
    """Reads such tokens; see the entry point ``oidc`` of the group :data:`GROUP`."""

    async def user_of(self, token: str) -> OidcUser:
        """Return the user of a token; raises the errors above."""
        ...


GROUP = "nena.access_tokens"
"""Entry points of what makes a reader from its settings."""
