from __future__ import annotations

from typing import Any

import pytest

from nena_shared.web.oidc.key_set import KEYS_LIMIT, KeySet
from support.oidc_issuer import ec_key, rsa_key

RSA = rsa_key().public
EC = ec_key().public
SECRET = {"kty": "oct", "k": "c2VjcmV0", "kid": "secret", "alg": "HS256"}


def without(key: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in key.items() if name not in names}


def test_a_key_is_found_by_its_id() -> None:
    keys = KeySet.of({"keys": [RSA, EC]})

    assert keys.has("rsa-1", "RS256")
    assert not keys.has("rsa-2", "RS256")
    found = keys.find("rsa-1", "RS256")
    assert found is not None
    assert found.key_id == "rsa-1"
    assert keys.find("rsa-1", "RS256") is found
    assert keys.find("rsa-2", "RS256") is None


def test_a_key_is_for_signatures_of_its_kind_only() -> None:
    keys = KeySet.of({"keys": [RSA, EC]})

    assert keys.find("ec-1", "RS256") is None
    assert keys.find("rsa-1", "ES256") is None
    assert keys.find("rsa-1", "RS512") is None, "its alg says RS256"
    assert KeySet.of({"keys": [without(RSA, "alg")]}).find("rsa-1", "RS512") is not None


def test_without_an_id_there_must_be_no_choice() -> None:
    alone = KeySet.of({"keys": [RSA]})
    assert alone.has(None, "RS256")
    assert not alone.has(None, "ES256")

    both = KeySet.of({"keys": [RSA, EC]})
    assert both.has(None, "RS256")
    assert both.has(None, "ES256")
    assert not KeySet.of({"keys": [RSA, RSA]}).has(None, "RS256")
    twins = KeySet.of({"keys": [EC, {**ec_key().public, "kid": EC["kid"]}]})
    assert twins.find("ec-1", "ES256") is None


def test_what_is_no_public_key_for_signatures_is_passed_over() -> None:
    keys = KeySet.of({"keys": [SECRET, {**EC, "use": "enc"}, 5, {}, RSA]})

    assert not keys.has("secret", "RS256")
    assert not keys.has("ec-1", "ES256")
    assert keys.has("rsa-1", "RS256")


def test_a_damaged_key_is_none() -> None:
    keys = KeySet.of({"keys": [{**RSA, "n": "!"}, {**EC, "crv": "P-0"}]})

    assert keys.find("rsa-1", "RS256") is None
    assert keys.find("ec-1", "ES256") is None


@pytest.mark.parametrize(
    "document", [{}, {"keys": {}}, {"keys": []}, {"keys": [SECRET]}, {"keys": [RSA] * (KEYS_LIMIT + 1)}]
)
def test_a_set_without_a_key_is_none(document: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="keys"):
        KeySet.of(document)
