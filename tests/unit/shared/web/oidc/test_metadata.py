from __future__ import annotations

from typing import Any

import pytest

from nena_shared.web.oidc.errors import IssuerAwayError
from nena_shared.web.oidc.metadata import metadata_of, place_of

ISSUER = "https://login.example/realms/site"
GOOD = {"issuer": ISSUER, "jwks_uri": "https://login.example/keys", "scopes_supported": ["openid"]}


@pytest.mark.parametrize("issuer", [ISSUER, f"{ISSUER}/"])
def test_it_is_at_one_place(issuer: str) -> None:
    assert place_of(issuer) == f"{ISSUER}/.well-known/openid-configuration"


def test_only_what_is_needed_is_read() -> None:
    found = metadata_of(GOOD, ISSUER)

    assert found.jwks_uri == "https://login.example/keys"
    assert found.token_endpoint_auth_methods_supported == ("client_secret_basic",)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"issuer": f"{ISSUER}/"}, "write http.oidc.issuer in just this way"),
        ({"issuer": "https://evil.example"}, "calls itself 'https://evil.example'"),
        ({"jwks_uri": "http://login.example/keys"}, "jwks_uri.*https"),
        ({"jwks_uri": "file:///etc/passwd"}, "jwks_uri"),
        ({"jwks_uri": None}, "jwks_uri"),
        ({"token_endpoint": 5}, "token_endpoint"),
        ({"issuer": "x" * 100_000}, "write http.oidc.issuer in just this way"),
        ({"token_endpoint_auth_methods_supported": [5] * 10_000}, "token_endpoint_auth_methods"),
    ],
)
def test_a_description_that_does_not_fit_says_why(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(IssuerAwayError, match=reason) as caught:
        metadata_of({**GOOD, **change}, ISSUER)
    assert len(str(caught.value)) < 1000
