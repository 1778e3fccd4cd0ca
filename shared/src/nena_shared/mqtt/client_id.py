"""MQTT client ids that nobody else can take.

A broker gives a client id to whoever asks for it last, and throws out who had it. Where robots have
identities, a robot that knew the client id of another one could so keep it off the line. So the id ends in a
digest of what only its owner has.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import scrypt, sha256

from nena_shared.settings import ConfigurationError, MqttSettings

DIGITS = 16
"""Of the end, hexadecimal: 64 bits."""


def private_client_id(name: str, settings: MqttSettings) -> str:
    """Give ``name`` an end that only who has the key or the password in ``settings`` can know.

    It is the same after a restart. Without key and password it is ``name`` alone: nobody is known there.

    Raises:
        ConfigurationError: a file with the secret cannot be read.

    """
    secret = _secret(settings)
    if not secret:
        return name
    return f"{name}-{sha256(_hardened(secret) + name.encode()).hexdigest()[:DIGITS]}"


def _secret(settings: MqttSettings) -> bytes:
    if settings.tls.key is None:
        return (settings.secret() or "").encode()
    try:
        return settings.tls.key.read_bytes()
    except OSError as error:
        raise ConfigurationError([f"mqtt.tls.key: {error}"]) from error


@lru_cache(maxsize=1)
def _hardened(secret: bytes) -> bytes:
    """Make it slow to try out passwords by an id that stands in a broker's log."""
    return scrypt(secret, salt=b"NeNa client id", n=2**14, r=8, p=1, dklen=32)
