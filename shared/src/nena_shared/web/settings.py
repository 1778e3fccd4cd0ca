"""Settings of an HTTP service and its OIDC issuer; beyond loopback, TLS and login are required."""

from __future__ import annotations

from ipaddress import IPv4Address, IPv4Network, IPv6Network, ip_address, ip_network
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, IPvAnyNetwork

from nena_shared.settings import ConfigurationError, SettingsGroup

Algorithm = Literal["RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA"]
"""Asymmetric signature algorithms. Shared secrets (HS256, ...) and ``none`` are not accepted."""

RoleName = Literal["viewer", "operator", "admin"]


def protected_url(url: str) -> str:
    """Return ``url`` if its responses cannot be changed in transit.

    Raises:
        ValueError: the URL is invalid, or neither https nor loopback.
    """
    parts = urlsplit(url)
    host = parts.hostname or ""
    if parts.scheme not in ("https", "http") or not host or parts.username is not None:
        raise ValueError("must be an address such as https://login.example/realms/site")
    if parts.scheme == "http" and not is_loopback(host):
        raise ValueError("must be https: over http, keys could be replaced in transit")
    return url


def _without_query(url: str) -> str:
    if "?" in url or "#" in url:
        raise ValueError("must not contain ? or #")
    return url


ProtectedUrl = Annotated[str, AfterValidator(protected_url)]
ProtectedPlace = Annotated[ProtectedUrl, AfterValidator(_without_query)]


class OidcSettings(SettingsGroup):
    """The OIDC issuer, and the roles of its users."""

    issuer: ProtectedPlace = Field(description="OIDC issuer URL, exactly as in the issuer's metadata.")
    audience: str = Field(min_length=1, description="Required audience (aud) of the issuer's tokens.")
    roles_claim: str = Field(
        "roles",
        min_length=1,
        description="Claim with roles or groups; dots address nested claims, such as realm_access.roles.",
    )
    roles: dict[str, RoleName] = Field(
        {"nena-viewer": "viewer", "nena-operator": "operator", "nena-admin": "admin"},
        min_length=1,
        description="NeNa role (viewer, operator, admin) by claim value; the highest counts.",
    )
    user_claim: str = Field(
        "preferred_username",
        min_length=1,
        description="Claim with the user name for panel and log. Fallback: sub.",
    )
    algorithms: tuple[Algorithm, ...] = Field(
        ("RS256", "ES256"), min_length=1, description="Accepted signature algorithms."
    )
    leeway: float = Field(30.0, ge=0, le=300, description="Allowed clock difference to the issuer, seconds.")
    timeout: float = Field(5.0, gt=0, le=60, description="Timeout of requests to the issuer, seconds.")
    ca: Path | None = Field(None, description="CA bundle (PEM) for the issuer. Unset: the system CA store.")


class HttpSettings(SettingsGroup):
    """Address and access of an HTTP service."""

    host: str = Field(
        "127.0.0.1", description="Address to listen on; beyond loopback, TLS and authentication are required."
    )
    port: int = Field(ge=0, le=65535, description="TCP port to listen on; 0 for any free port.")
    users: Path | None = Field(
        None, description="Users file, created by `nena-deploy user add`. Unset: no login."
    )
    first_user: bool = Field(
        default=False,
        description="Create a missing users file with one admin; the token is written beside it.",
    )
    oidc: OidcSettings | None = Field(
        None, description="OpenID Connect issuer whose tokens are accepted in addition to http.users."
    )
    tls_certificate: Path | None = Field(None, description="Certificate (PEM) of the service; enables HTTPS.")
    tls_key: Path | None = Field(None, description="Private key (PEM) of the certificate.")
    reverse_proxy: bool = Field(
        default=False, description="Whether a reverse proxy in front of this address terminates TLS."
    )
    trusted_proxies: tuple[IPvAnyNetwork, ...] = Field(
        (IPv4Network("127.0.0.0/8"), IPv6Network("::1")),
        description="Addresses and networks of the reverse proxy: X-Forwarded-For and X-Forwarded-Proto of "
        "others are ignored.",
    )
    open_metrics: bool = Field(default=False, description="Serve /metrics without authentication.")
    requests_per_second: float = Field(
        500.0, gt=0, description="Sustained requests per second of one user or address."
    )
    burst: int = Field(1000, ge=1, description="Burst of requests of one user or address.")


OF_ONE_SITE = 64
"""Prefix length of an IPv6 site; a single machine may choose the other bits freely."""


def is_loopback(host: str) -> bool:
    """Return whether ``host`` is a loopback address; of names, only localhost counts."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        # RFC 6761, 6.3 reserves this name; what others resolve to may change
        return host == "localhost"


def network_of(address: str) -> str:
    """Return the network that counts as one client: an IPv4 address, or the /64 of an IPv6 address."""
    try:
        # %: the zone of a link-local IPv6 address (RFC 4007), not a part of it
        known = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(known, IPv4Address):
        return str(known)
    # a socket for both versions reports IPv4 clients as ::ffff:192.0.2.1
    return str(known.ipv4_mapped or ip_network((known, OF_ONE_SITE), strict=False))


def check_exposure(settings: HttpSettings) -> None:
    """Check that TLS and login are configured if the service listens beyond loopback.

    Raises:
        ConfigurationError: one of them is missing; a line for each.
    """
    problems = []
    if (settings.tls_certificate is None) is not (settings.tls_key is None):
        problems.append("http.tls_certificate and http.tls_key belong together: set both or neither.")
    if not is_loopback(settings.host):
        where = f"http.host: {settings.host} is reachable from other machines"
        if settings.tls_certificate is None and not settings.reverse_proxy:
            problems.append(
                f"{where}, without TLS. Set http.tls_certificate and http.tls_key; or http.reverse_proxy = "
                "true behind a proxy that terminates TLS and cannot be bypassed; or listen on 127.0.0.1."
            )
        if settings.users is None and settings.oidc is None:
            problems.append(
                f"{where}, without a login. Set http.users (see `nena-deploy user add`) or http.oidc.issuer."
            )
    if problems:
        raise ConfigurationError(problems)
