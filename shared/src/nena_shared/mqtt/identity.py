"""A program's identity at the broker: TLS, and client IDs that cannot be guessed."""

from __future__ import annotations

import ssl
from functools import lru_cache
from hashlib import scrypt, sha256

from nena_shared.settings import ConfigurationError, MqttSettings, MqttTlsSettings


def tls_context(settings: MqttTlsSettings) -> ssl.SSLContext | None:
    """Return the TLS context of a connection; None without TLS.

    The files are read on each call, so that the next connection uses renewed ones. The broker's host name is
    always verified.

    Raises:
        ConfigurationError: a file cannot be read or is not PEM, or key and certificate do not match.
    """
    if not settings.wanted:
        return None
    try:
        context = ssl.create_default_context(cafile=settings.ca)
    except (OSError, ssl.SSLError) as error:
        raise ConfigurationError([f"mqtt.tls.ca: {settings.ca}: {_reason_of(error)}"]) from error
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if settings.certificate is not None:
        try:
            context.load_cert_chain(settings.certificate, settings.key)
        except (OSError, ssl.SSLError) as error:
            files = " and ".join(str(each) for each in (settings.certificate, settings.key) if each)
            raise ConfigurationError([f"mqtt.tls.certificate: {files}: {_reason_of(error)}"]) from error
    return context


def _reason_of(error: Exception) -> str:
    if isinstance(error, ssl.SSLError):
        return f"not a PEM file, or key and certificate do not match ({error.reason or error})"
    return str(getattr(error, "strerror", None) or error)


DIGITS = 16
"""Length of the digest in hexadecimal digits: 64 bits."""


def private_client_id(name: str, settings: MqttSettings) -> str:
    """Return ``name`` with a digest of the key or password in ``settings``.

    The result is the same after a restart. Without key and password, it is just ``name``.

    Raises:
        ConfigurationError: the file with the secret cannot be read.
    """
    secret = _read_secret(settings)
    if not secret:
        return name
    # a client that connects with the ID of another one ends its connection (MQTT 3.1.1, 3.1.4),
    # so nobody may guess that of a robot
    return f"{name}-{sha256(_hash_slowly(secret) + name.encode()).hexdigest()[:DIGITS]}"


def _read_secret(settings: MqttSettings) -> bytes:
    if settings.tls.key is None:
        return (settings.secret() or "").encode()
    try:
        return settings.tls.key.read_bytes()
    except OSError as error:
        raise ConfigurationError([f"mqtt.tls.key: {error}"]) from error


@lru_cache(maxsize=1)
def _hash_slowly(secret: bytes) -> bytes:
    """Return a slow hash, so that passwords cannot be brute-forced from a client ID in a broker's log."""
    return scrypt(secret, salt=b"NeNa client id", n=2**14, r=8, p=1, dklen=32)
