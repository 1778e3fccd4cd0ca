"""Settings of an HTTP service."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from nena_shared.settings import SettingsGroup
from nena_shared.web.oidc.settings import OidcSettings


class HttpSettings(SettingsGroup):
    """Where an HTTP service listens, and for whom."""

    host: str = Field(
        "127.0.0.1", description="Address to listen on; beyond loopback it has to be protected."
    )
    port: int = Field(ge=0, le=65535, description="TCP port to listen on; 0 takes a free one.")
    users: Path | None = Field(
        None, description="File of those who may log in, made by `nena-deploy user add`; none: everybody may."
    )
    first_user: bool = Field(
        default=False,
        description="Where the file of users is missing, make it with an admin; its token is put beside it.",
    )
    oidc: OidcSettings | None = Field(
        None, description="An OpenID Connect issuer whose tokens count beside those of http.users."
    )
    tls_certificate: Path | None = Field(None, description="PEM file with the service's certificate: https.")
    tls_key: Path | None = Field(None, description="PEM file with the key of the certificate.")
    reverse_proxy: bool = Field(
        default=False, description="Say that a reverse proxy in front of the address does TLS."
    )
    open_metrics: bool = Field(default=False, description="Give /metrics without a login.")
    requests_per_second: float = Field(
        500.0, gt=0, description="Requests that one user, or one address, may make in the long run."
    )
    burst: int = Field(1000, ge=1, description="Requests that one user, or one address, may make at once.")
