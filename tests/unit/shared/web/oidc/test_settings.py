from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from nena_shared.web.oidc.settings import OidcSettings

GOOD: dict[str, Any] = {"issuer": "https://login.example/realms/site", "audience": "nena"}


@pytest.mark.parametrize(
    "issuer",
    [
        "https://login.example",
        "https://login.example/",
        "https://192.0.2.1:8443/realms/site",
        "http://127.0.0.1:8080/realms/site",
        "http://localhost:8080",
        "http://[::1]:8080/",
    ],
)
def test_an_issuer_stays_as_it_writes_itself(issuer: str) -> None:
    assert OidcSettings.model_validate({**GOOD, "issuer": issuer}).issuer == issuer


@pytest.mark.parametrize(
    ("issuer", "complaint"),
    [
        ("http://login.example", "it has to be https"),
        ("http://192.0.2.1", "it has to be https"),
        ("http://localhost.example", "it has to be https"),
        ("login.example", "an address such as"),
        ("", "an address such as"),
        ("https://", "an address such as"),
        ("file:///etc/passwd", "an address such as"),
        ("https://login.example/?realm=site", "without"),
        ("https://login.example/#here", "without"),
        ("https://me@login.example/", "an address such as"),
    ],
)
def test_an_issuer_that_others_could_play_is_refused(issuer: str, complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        OidcSettings.model_validate({**GOOD, "issuer": issuer})


@pytest.mark.parametrize("algorithm", ["none", "None", "HS256", "HS512", "ES256K", ""])
def test_only_signatures_by_private_keys_can_be_allowed(algorithm: str) -> None:
    with pytest.raises(ValidationError, match="algorithms"):
        OidcSettings.model_validate({**GOOD, "algorithms": ["RS256", algorithm]})


@pytest.mark.parametrize(
    "wrong",
    [{"audience": ""}, {"roles": {}}, {"roles": {"chef": "king"}}, {"algorithms": []}, {"leeway": -1}],
)
def test_what_would_let_in_nobody_or_everybody_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        OidcSettings.model_validate({**GOOD, **wrong})


def test_audience_and_issuer_have_to_be_given() -> None:
    with pytest.raises(ValidationError, match="audience"):
        OidcSettings.model_validate({"issuer": GOOD["issuer"]})
