"""The issuer's public keys (JWK Set, RFC 7517)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from jwt import PyJWK
from jwt.exceptions import PyJWTError

KEYS_LIMIT = 100

KINDS = {"RS": "RSA", "PS": "RSA", "ES": "EC", "Ed": "OKP"}
"""The kind of key (kty) that a signature takes, by the first letters of its name. Shared secrets are none."""


class KeySet:
    """Keys by their ids; what is no public key for signatures is passed over."""

    def __init__(self, keys: Sequence[Mapping[str, Any]]) -> None:
        self._keys = keys
        self._made: dict[tuple[str | None, str], PyJWK] = {}

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> KeySet:
        """Read a JWK Set.

        Raises:
            ValueError: it is none, or has no key that could be used.

        """
        listed = document.get("keys")
        if not isinstance(listed, list) or len(listed) > KEYS_LIMIT:
            message = f"it has no list of at most {KEYS_LIMIT} keys"
            raise ValueError(message)
        usable = [each for each in listed if isinstance(each, dict) and _is_usable(each)]
        if not usable:
            message = "none of its keys is a public one for signatures"
            raise ValueError(message)
        return cls(usable)

    def has(self, kid: str | None, algorithm: str) -> bool:
        """Tell whether :meth:`find` gives a key."""
        return self.find(kid, algorithm) is not None

    def find(self, kid: str | None, algorithm: str) -> PyJWK | None:
        """Give the one key of this id for signatures of this kind; without an id there must be no choice."""
        if (made := self._made.get((kid, algorithm))) is not None:
            return made
        fitting = [each for each in self._keys if _fits(each, kid, algorithm)]
        if len(fitting) != 1:
            return None
        try:
            made = PyJWK(dict(fitting[0]), algorithm=algorithm)
        except PyJWTError:
            return None
        self._made[kid, algorithm] = made
        return made


def _is_usable(key: Mapping[str, Any]) -> bool:
    return key.get("kty") in KINDS.values() and key.get("use", "sig") == "sig"


def _fits(key: Mapping[str, Any], kid: str | None, algorithm: str) -> bool:
    named = kid is None or key.get("kid") == kid
    return named and key["kty"] == KINDS[algorithm[:2]] and key.get("alg", algorithm) == algorithm
