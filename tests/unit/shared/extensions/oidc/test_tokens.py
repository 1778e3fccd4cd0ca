"""Each rule of tokens, broken alone."""

from __future__ import annotations

import base64
import time
from typing import Any

import jwt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.extensions.oidc.issuer import KeySet
from nena_shared.extensions.oidc.tokens import LENGTH_LIMIT, header_of, verified
from nena_shared.web.issued_tokens import TokenRefusedError
from support.oidc_issuer import (
    AUDIENCE,
    SigningKey,
    ec_key,
    rsa_key,
    signed,
    signed_by_secret,
    unsigned,
)

ISSUER = "https://login.example"
ALLOWED = ("RS256", "ES256")
RSA, EC = rsa_key(), ec_key()
KEYS = KeySet.of({"keys": [RSA.public, EC.public]})
LEEWAY = 30.0
FAR = 4_000_000_000
"""A moment that is to come; not by the clock, so that the parameters of tests are always the same."""


def claims(**more: Any) -> dict[str, Any]:
    now = int(time.time())
    said = {"iss": ISSUER, "aud": AUDIENCE, "sub": "17", "exp": now + 300, "iat": now, **more}
    return {name: value for name, value in said.items() if value is not None}


def judged(token: str) -> dict[str, Any]:
    header = header_of(token, ALLOWED)
    key = KEYS.find(header.kid, header.algorithm)
    assert key is not None
    return verified(token, key, header, issuer=ISSUER, audience=AUDIENCE, leeway=LEEWAY)


@pytest.mark.parametrize("key", [RSA, EC], ids=["RS256", "ES256"])
def test_valid_token_is_accepted(key: SigningKey) -> None:
    assert judged(signed(claims(), key))["sub"] == "17"


def test_other_algorithm_is_accepted_if_allowed() -> None:
    token = signed(claims(), SigningKey(RSA.kid, "PS256", RSA.private))
    with pytest.raises(TokenRefusedError, match="only RS256, ES256"):
        header_of(token, ALLOWED)

    header = header_of(token, (*ALLOWED, "PS256"))
    key = KeySet.of({"keys": [{**RSA.public, "alg": "PS256"}]}).find(header.kid, header.algorithm)
    assert key is not None
    assert verified(token, key, header, issuer=ISSUER, audience=AUDIENCE, leeway=LEEWAY)["sub"] == "17"


def test_one_of_several_audiences_is_enough() -> None:
    assert judged(signed(claims(aud=["other", AUDIENCE]), RSA))


@pytest.mark.parametrize("kind", ["JWT", "at+jwt", "application/at+jwt", ""])
def test_access_token_types_are_accepted(kind: str) -> None:
    assert judged(signed(claims(), RSA, typ=kind))


def test_clocks_may_differ_a_little() -> None:
    now = time.time()
    assert judged(signed(claims(exp=now - LEEWAY / 2), RSA))
    assert judged(signed(claims(nbf=now + LEEWAY / 2), RSA))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"iss": "https://evil.example"}, "another issuer"),
        ({"iss": f"{ISSUER}/"}, "another issuer"),
        ({"iss": None}, "lacks the claim iss"),
        ({"aud": "somebody"}, "another audience"),
        ({"aud": [AUDIENCE.upper()]}, "another audience"),
        ({"aud": []}, "aud"),
        ({"aud": None}, "lacks the claim aud"),
        ({"exp": 1}, "has expired"),
        ({"exp": 1_700_000_000}, "has expired"),
        ({"exp": None}, "lacks the claim exp"),
        ({"exp": "soon"}, "cannot be read"),
        ({"exp": float("inf")}, "cannot be read"),
        ({"exp": []}, "cannot be read"),
        ({"nbf": FAR}, "not valid yet"),
        ({"iat": FAR}, "not valid yet"),
        ({"sub": None}, "lacks the claim sub"),
    ],
)
def test_each_violation_is_explained(change: dict[str, Any], reason: str) -> None:
    token = signed(claims(**change), RSA)

    with pytest.raises(TokenRefusedError, match=reason):
        judged(token)


def test_unsigned_token_is_refused() -> None:
    for name in ("none", "None", "NONE", "nOnE"):
        with pytest.raises(TokenRefusedError, match="algorithm is not accepted"):
            judged(unsigned(claims(), {"alg": name, "kid": RSA.kid}))


def test_public_key_is_not_accepted_as_shared_secret() -> None:
    """Try the attack on a verifier that lets the token choose the algorithm, and so accepts the public key as
    a secret.
    """
    for name in ("HS256", "RS256"):
        token = signed_by_secret(claims(), RSA.public_pem, {"alg": name, "kid": RSA.kid})
        with pytest.raises(TokenRefusedError, match="signature"):
            judged(token)


def test_foreign_key_is_refused() -> None:
    with pytest.raises(TokenRefusedError, match="its signature is invalid"):
        judged(signed(claims(), ec_key()))


def test_a_signature_by_a_key_in_the_token_is_refused() -> None:
    other = ec_key()
    with pytest.raises(TokenRefusedError, match="its signature is invalid"):
        judged(signed(claims(), other, jwk=other.public))


def test_changed_claims_are_refused() -> None:
    first, _, seal = signed(claims(), RSA).split(".")
    _, other, _ = signed(claims(sub="18"), RSA).split(".")

    with pytest.raises(TokenRefusedError, match="its signature is invalid"):
        judged(f"{first}.{other}.{seal}")


@pytest.mark.parametrize("header", [{"typ": "logout+jwt"}, {"typ": "dpop+jwt"}, {"crit": ["exp"]}])
def test_tokens_for_other_things_are_refused(header: dict[str, Any]) -> None:
    with pytest.raises(TokenRefusedError, match=r"type|cannot be read"):
        judged(signed(claims(), RSA, **header))


def _encoded(text: bytes) -> str:
    return base64.urlsafe_b64encode(text).rstrip(b"=").decode()


@pytest.mark.parametrize(
    "token",
    [
        "..",
        "a.b.c",
        f"{_encoded(b'[]')}..",
        f"{_encoded(b'[' * 9000)}.a.b",
        f"{_encoded(b'{')}.a.b",
        "x" * (LENGTH_LIMIT + 1),
        "\x00.\x00.\x00",
        "ä.ö.ü",
    ],
)
def test_damaged_texts_are_refused(token: str) -> None:
    with pytest.raises(TokenRefusedError):
        judged(token)


@given(st.text(max_size=60))
def test_any_invalid_token_raises_only_token_refused(token: str) -> None:
    with pytest.raises(TokenRefusedError):
        judged(token)


def test_the_library_signs_as_the_tests_say() -> None:
    """So that the tests above fail for the reason that they name."""
    assert jwt.get_unverified_header(signed(claims(), RSA)) == {"alg": "RS256", "kid": "rsa-1", "typ": "JWT"}
