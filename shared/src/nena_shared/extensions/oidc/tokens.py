"""Check format, signature and claims of OIDC tokens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jwt
from jwt import PyJWK
from jwt import exceptions as flaws

from nena_shared.web.issued_tokens import TokenRefusedError

LENGTH_LIMIT = 16_384
"""Characters."""

# RFC 9068, 2.1: at+jwt; many issuers still write JWT or nothing
TYPES = frozenset({"", "jwt", "at+jwt", "application/at+jwt"})
"""Accepted types (typ) of tokens; tokens of other types do not prove an identity."""

REQUIRED = ["exp", "iss", "aud", "sub"]

UNREADABLE = (flaws.PyJWTError, ValueError, TypeError, OverflowError, RecursionError)
"""Exceptions of the library for malformed tokens."""

REASONS: dict[type[Exception], str] = {
    flaws.ExpiredSignatureError: "it has expired",
    flaws.ImmatureSignatureError: "it is not valid yet; check the clocks",
    flaws.InvalidAudienceError: "it is for another audience (aud)",
    flaws.InvalidIssuerError: "it is from another issuer (iss)",
    flaws.InvalidSignatureError: "its signature is invalid",
}


@dataclass(frozen=True, slots=True)
class TokenHeader:
    """The header of a token; not verified yet."""

    kid: str | None
    algorithm: str


def header_of(token: str, algorithms: Sequence[str]) -> TokenHeader:
    """Parse the header of a token.

    Raises:
        TokenRefusedError: the token is malformed, or its type or algorithm is not accepted.
    """
    try:
        if len(token) > LENGTH_LIMIT:
            raise TokenRefusedError("it is too long")
        header = jwt.get_unverified_header(token)
    except UNREADABLE as error:
        raise TokenRefusedError("it cannot be read") from error
    algorithm = header.get("alg")
    if algorithm not in algorithms:
        raise TokenRefusedError(
            f"its signature algorithm is not accepted, only {', '.join(algorithms)} (alg)"
        )
    # RFC 7515, 4.1.11: extensions that a reader must understand, and this one knows none
    if "crit" in header or str(header.get("typ") or "").lower() not in TYPES:
        raise TokenRefusedError("its type is not accepted (typ, crit)")
    return TokenHeader(header.get("kid"), str(algorithm))


def verified(
    token: str, key: PyJWK, header: TokenHeader, *, issuer: str, audience: str, leeway: float
) -> dict[str, Any]:
    """Verify a token and return its claims; raises TokenRefusedError if the token is invalid."""
    try:
        claims: dict[str, Any] = jwt.decode(
            token,
            key,
            # 0031: the key was made for this algorithm, so a public key is never taken as a shared secret
            algorithms=[header.algorithm],
            issuer=issuer,
            audience=audience,
            leeway=leeway,
            options={"require": REQUIRED},
        )
    except flaws.MissingRequiredClaimError as error:
        raise TokenRefusedError(f"it lacks the claim {error.claim}") from error
    except UNREADABLE as error:
        raise TokenRefusedError(REASONS.get(type(error), "it cannot be read")) from error
    return claims
