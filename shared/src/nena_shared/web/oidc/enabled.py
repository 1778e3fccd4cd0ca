"""Switches the issuer's tokens on where the settings name one; only then its libraries are loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nena_shared.settings import ConfigurationError
from nena_shared.web.settings import HttpSettings

if TYPE_CHECKING:
    from nena_shared.web.oidc.access_tokens import AccessTokens


def access_tokens_of(settings: HttpSettings) -> AccessTokens | None:
    """Give what knows users by the issuer's tokens; None: no issuer is named.

    Raises:
        ConfigurationError: the libraries are not installed, or a file cannot be used.

    """
    if settings.oidc is None:
        return None
    try:
        from nena_shared.web.oidc.access_tokens import AccessTokens  # noqa: PLC0415 - an extra
        from nena_shared.web.oidc.issuer import Issuer  # noqa: PLC0415
    except ImportError as error:
        problem = f"http.oidc.issuer: {error}; install this service with its extra: pip install SERVICE[oidc]"
        raise ConfigurationError([problem]) from error
    return AccessTokens(Issuer(settings.oidc))
