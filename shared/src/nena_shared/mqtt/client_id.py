"""MQTT client IDs that cannot be guessed.

When a client connects with the ID of another one, the broker disconnects the other one. A robot that knew the
client ID of another robot could keep it offline. So the ID ends in a digest of a secret of its owner.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import scrypt, sha256

from nena_shared.settings import ConfigurationError, MqttSettings

DIGITS = 16
"""Hexadecimal digits of the digest: 64 bits."""


def private_client_id(name: str, settings: MqttSettings) -> str:
    """Return ``name`` with a digest of the key or the password in ``settings``.

    It is the same after a restart. Without key and password it is ``name`` alone: clients have no identity.

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
    """Return a slow hash, so that passwords cannot be tried against an ID from a broker's log."""
    return scrypt(secret, salt=b"NeNa client id", n=2**14, r=8, p=1, dklen=32)
