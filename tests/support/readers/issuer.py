"""Readers of an OpenID Connect issuer's answers, and of tokens that claim to be its own."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress

from nena_shared.extensions.oidc.issuer import BoundedHttp, KeySet, metadata_of, metadata_url
from nena_shared.extensions.oidc.tokens import TokenHeader, header_of, verified
from nena_shared.web.issued_tokens import IssuerUnavailableError, TokenRefusedError
from nena_shared.web.settings import OidcSettings
from support.damage import damaged_text
from support.oidc_issuer import AUDIENCE, DISCOVERY, KEYS, OidcIssuer, ec_key, oidc_issuer, rsa_key
from support.readers.reader import Make, Place, Reader

ALGORITHMS = ("RS256", "PS512", "ES256", "EdDSA")


def _issuer(place: Place) -> tuple[OidcIssuer, BoundedHttp]:
    issuer = place.stack.enter_context(oidc_issuer())
    return issuer, BoundedHttp(OidcSettings(issuer=issuer.address, audience=AUDIENCE))


def discovery(place: Place) -> Reader:
    issuer, http = _issuer(place)

    def read(data: bytes) -> object:
        issuer.broken[DISCOVERY] = data
        return metadata_of(asyncio.run(http.get(metadata_url(issuer.address))), issuer.address)

    return Reader(read, (json.dumps(issuer.description()).encode(),), (IssuerUnavailableError,))


def keys(place: Place) -> Reader:
    """Read keys, look each up, and try it on a token."""
    issuer, http = _issuer(place)
    token = issuer.token()

    def read(data: bytes) -> None:
        issuer.broken[KEYS] = data
        found = KeySet.of(asyncio.run(http.get(f"{issuer.address}{KEYS}")))
        for algorithm in ALGORITHMS:
            for kid in ("rsa-1", "ec-1", None):
                if key := found.find(kid, algorithm):
                    with suppress(TokenRefusedError):
                        header = TokenHeader(kid, algorithm)
                        verified(token, key, header, issuer=issuer.address, audience=AUDIENCE, leeway=0)

    document = json.dumps({"keys": [rsa_key().public, ec_key().public]}).encode()
    return Reader(read, (document,), (IssuerUnavailableError, ValueError))


def tokens(place: Place) -> Reader:
    issuer, _ = _issuer(place)
    found = KeySet.of({"keys": [rsa_key().public]})

    def read(data: bytes) -> None:
        token = data.decode(errors="replace")
        header = header_of(token, ALGORITHMS)
        if key := found.find("rsa-1", header.algorithm):
            verified(token, key, header, issuer=issuer.address, audience=AUDIENCE, leeway=0)

    return Reader(read, (issuer.token().encode(),), (TokenRefusedError,), damaged_text)


ISSUER: dict[str, Make] = {
    "description of an issuer": discovery,
    "keys of an issuer": keys,
    "tokens": tokens,
}
