"""TLS to the broker: which certificates the client accepts, and its own."""

from __future__ import annotations

import ssl

from nena_shared.settings import ConfigurationError, MqttTlsSettings


def tls_context(settings: MqttTlsSettings) -> ssl.SSLContext | None:
    """Return the context of a connection; None where the connection is not encrypted.

    The files are read at each call, so that renewed ones are used from the next connection on. The broker's
    name is always checked against its certificate.

    Raises:
        ConfigurationError: a file cannot be read, is no PEM, or key and certificate do not belong together.

    """
    if not settings.wanted:
        return None
    try:
        context = ssl.create_default_context(cafile=settings.ca)
    except (OSError, ssl.SSLError) as error:
        raise ConfigurationError([f"mqtt.tls.ca: {settings.ca}: {_reason(error)}"]) from error
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if settings.certificate is not None:
        try:
            context.load_cert_chain(settings.certificate, settings.key)
        except (OSError, ssl.SSLError) as error:
            files = " and ".join(str(each) for each in (settings.certificate, settings.key) if each)
            raise ConfigurationError([f"mqtt.tls.certificate: {files}: {_reason(error)}"]) from error
    return context


def _reason(error: Exception) -> str:
    if isinstance(error, ssl.SSLError):
        return f"not a PEM file that fits ({error.reason or error})"
    return str(getattr(error, "strerror", None) or error)
