"""OIDC users: user and role from the claims of a token."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from nena_shared.fleet_api.base import Role
from nena_shared.web.issued_tokens import NoRoleError, OidcUser, TokenRefusedError
from nena_shared.web.settings import OidcSettings

NAME_LIMIT = 64

SUBJECT_LIMIT = 255
"""Maximum length of a subject, characters (OpenID Connect Core 1.0, section 2)."""


def user_of(claims: Mapping[str, Any], settings: OidcSettings) -> OidcUser:
    """Return the user of verified claims.

    Raises:
        TokenRefusedError: the subject or the expiry is invalid.
        NoRoleError: the claims map to no role.
    """
    subject = claims.get("sub")
    if not isinstance(subject, str) or not 0 < len(subject) <= SUBJECT_LIMIT or not subject.isprintable():
        raise TokenRefusedError("it names no user (sub)")
    name = _name_of(claims.get(settings.user_claim)) or subject[:NAME_LIMIT]
    return OidcUser(name, _role_of(name, claims, settings), subject, _end_of(claims, settings.leeway))


def values_of(claims: Mapping[str, Any], path: str) -> frozenset[str]:
    """Return the strings in a claim, which is a string or a list.

    A claim with the whole path as its name has priority, as some issuers use URLs as names.
    """
    found: Any = claims.get(path)
    if found is None:
        found = claims
        for step in path.split("."):
            found = found.get(step) if isinstance(found, Mapping) else None
    values = found if isinstance(found, list) else [found]
    return frozenset(each for each in values if isinstance(each, str))


def _role_of(name: str, claims: Mapping[str, Any], settings: OidcSettings) -> Role:
    given = values_of(claims, settings.roles_claim)
    roles = [Role[role.upper()] for value, role in settings.roles.items() if value in given]
    if not roles:
        wanted = ", ".join(settings.roles)
        raise NoRoleError(
            f"{name} has no role in NeNa. Ask the administrator of the issuer for one of: {wanted} "
            f"(claim {settings.roles_claim}), then sign in again."
        )
    return max(roles)


def _name_of(claim: object) -> str:
    return claim if isinstance(claim, str) and claim.isprintable() and len(claim) <= NAME_LIMIT else ""


def _end_of(claims: Mapping[str, Any], leeway: float) -> datetime:
    try:
        return datetime.fromtimestamp(int(claims["exp"]), UTC) + timedelta(seconds=leeway)
    except (ValueError, TypeError, OverflowError, OSError) as error:
        raise TokenRefusedError("its expiry (exp) is not a time") from error
