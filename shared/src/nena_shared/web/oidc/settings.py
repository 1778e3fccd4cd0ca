"""Settings of signing in by an OpenID Connect issuer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from nena_shared.settings import SettingsGroup
from nena_shared.web.addresses import is_loopback

Algorithm = Literal["RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA"]
"""Signatures by a private key. Those by a shared secret (HS256, ...) and ``none`` are no choice."""

RoleName = Literal["viewer", "operator", "admin"]


def protected_url(url: str) -> str:
    """Give ``url`` back where nobody on the way can change what comes from it.

    Raises:
        ValueError: it is no URL of the kind, or neither https nor of this machine.

    """
    parts = urlsplit(url)
    host = parts.hostname or ""
    if parts.scheme not in ("https", "http") or not host or parts.username is not None:
        message = "an address such as https://login.example/realms/site is needed"
        raise ValueError(message)
    if parts.scheme == "http" and not is_loopback(host):
        message = "it has to be https: whoever is on the way could put keys of their own in its place"
        raise ValueError(message)
    return url


def _without_query(url: str) -> str:
    if "?" in url or "#" in url:
        message = "the address of a whole place is needed, without ? and #"
        raise ValueError(message)
    return url


ProtectedUrl = Annotated[str, AfterValidator(protected_url)]
ProtectedPlace = Annotated[ProtectedUrl, AfterValidator(_without_query)]


class OidcSettings(SettingsGroup):
    """Whose access tokens count beside NeNa's own, and for what."""

    issuer: ProtectedPlace = Field(
        description="The OpenID Connect issuer, just as it writes its own address: its tokens count too."
    )
    audience: str = Field(min_length=1, description="What the issuer's tokens have to be meant for (aud).")
    roles_claim: str = Field(
        "roles",
        min_length=1,
        description="Claim that names somebody's roles or groups; dots lead into tables: realm_access.roles.",
    )
    roles: dict[str, RoleName] = Field(
        {"nena-viewer": "viewer", "nena-operator": "operator", "nena-admin": "admin"},
        min_length=1,
        description="Role here (viewer, operator, admin) for each value of that claim; the highest counts.",
    )
    user_claim: str = Field(
        "preferred_username", min_length=1, description="Claim with the name for panel and log; else sub."
    )
    algorithms: tuple[Algorithm, ...] = Field(
        ("RS256", "ES256"), min_length=1, description="Signatures that count."
    )
    leeway: float = Field(
        30.0, ge=0, le=300, description="Seconds that the clocks of issuer and service may differ."
    )
    timeout: float = Field(5.0, gt=0, le=60, description="Seconds that the issuer has to answer.")
    ca: Path | None = Field(
        None, description="PEM file: who vouches for the issuer where the system's certificates do not."
    )
