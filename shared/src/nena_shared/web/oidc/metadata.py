"""What an issuer says of itself (OpenID Connect Discovery 1.0)."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from nena_shared.misfits import in_words, shortened
from nena_shared.web.oidc.errors import IssuerAwayError
from nena_shared.web.oidc.settings import ProtectedUrl

PROBLEMS_SHOWN = 5


class Metadata(BaseModel):
    """Where an issuer has what; only what is used here."""

    model_config = ConfigDict(frozen=True)

    issuer: str
    jwks_uri: ProtectedUrl
    authorization_endpoint: str = ""
    token_endpoint: str = ""
    token_endpoint_auth_methods_supported: tuple[str, ...] = Field(default=("client_secret_basic",))


def place_of(issuer: str) -> str:
    """Tell where an issuer describes itself."""
    return f"{issuer.rstrip('/')}/.well-known/openid-configuration"


def metadata_of(document: dict[str, Any], issuer: str) -> Metadata:
    """Read the description of ``issuer``.

    Raises:
        IssuerAwayError: it does not say what is needed, or is that of another one.

    """
    try:
        found = Metadata.model_validate(document)
    except ValidationError as error:
        problems = "; ".join(in_words(error.errors(), whole="all of it", most=PROBLEMS_SHOWN))
        message = f"{place_of(issuer)} is not what it has to be: {problems}"
        raise IssuerAwayError(message) from error
    if found.issuer != issuer:
        message = f"it calls itself {shortened(repr(found.issuer))}: write http.oidc.issuer in just this way"
        raise IssuerAwayError(message)
    return found
