from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nena_shared.settings import ConfigurationError
from nena_shared.web.exposure import check_exposure
from nena_shared.web.oidc.settings import OidcSettings
from nena_shared.web.settings import HttpSettings

TLS = {"tls_certificate": Path("c.pem"), "tls_key": Path("k.pem")}
USERS: dict[str, Any] = {"users": Path("users.toml")}
OIDC: dict[str, Any] = {"oidc": OidcSettings(issuer="https://login.example", audience="nena")}


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "localhost"])
def test_loopback_needs_nothing(host: str) -> None:
    check_exposure(HttpSettings(host=host, port=0))


@pytest.mark.parametrize("tls", [TLS, {"reverse_proxy": True}])
@pytest.mark.parametrize("login", [USERS, OIDC])
def test_with_tls_and_login_it_may_be_anywhere(tls: dict[str, Any], login: dict[str, Any]) -> None:
    check_exposure(HttpSettings(host="192.0.2.1", port=0, **login, **tls))


@pytest.mark.parametrize(
    ("given", "complaints"),
    [
        ({}, ["without TLS", "without a login"]),
        (TLS, ["without a login"]),
        (USERS, ["without TLS"]),
        ({"reverse_proxy": True}, ["without a login"]),
        ({**USERS, "tls_key": Path("k.pem")}, ["belong together", "without TLS"]),
        ({**USERS, "tls_certificate": Path("c.pem")}, ["belong together"]),
    ],
)
def test_each_thing_that_is_missing_is_named(given: dict[str, Any], complaints: list[str]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        check_exposure(HttpSettings(host="192.0.2.1", port=0, **given))

    assert len(caught.value.problems) == len(complaints)
    for problem, complaint in zip(caught.value.problems, complaints, strict=True):
        assert complaint in problem
