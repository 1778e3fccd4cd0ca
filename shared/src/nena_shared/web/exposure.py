"""Refuses to listen where others than this machine's own people could come, unless it is protected."""

from __future__ import annotations

from nena_shared.settings import ConfigurationError
from nena_shared.web.addresses import is_loopback
from nena_shared.web.settings import HttpSettings


def check_exposure(settings: HttpSettings) -> None:
    """See that an address beyond loopback has both TLS and a login.

    Raises:
        ConfigurationError: it has not; a line for each thing that is missing.

    """
    problems = []
    if (settings.tls_certificate is None) is not (settings.tls_key is None):
        problems.append("http.tls_certificate and http.tls_key belong together: give both, or none.")
    if not is_loopback(settings.host):
        where = f"http.host: {settings.host} is reached from other machines"
        if settings.tls_certificate is None and not settings.reverse_proxy:
            problems.append(
                f"{where}, without TLS. Set http.tls_certificate and http.tls_key; or http.reverse_proxy = "
                "true where a proxy does TLS and nobody gets past it; or listen on 127.0.0.1."
            )
        if settings.users is None and settings.oidc is None:
            problems.append(
                f"{where}, without a login. Set http.users (see `nena-deploy user add`) or http.oidc.issuer."
            )
    if problems:
        raise ConfigurationError(problems)
