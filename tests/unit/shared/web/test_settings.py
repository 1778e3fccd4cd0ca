from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from nena_shared.settings import ConfigurationError
from nena_shared.web.settings import HttpSettings, OidcSettings, check_exposure, is_loopback, network_of

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
def test_issuer_url_is_unchanged(issuer: str) -> None:
    assert OidcSettings.model_validate({**GOOD, "issuer": issuer}).issuer == issuer


@pytest.mark.parametrize(
    ("issuer", "complaint"),
    [
        ("http://login.example", "must be https"),
        ("http://192.0.2.1", "must be https"),
        ("http://localhost.example", "must be https"),
        ("login.example", "an address such as"),
        ("", "an address such as"),
        ("https://", "an address such as"),
        ("file:///etc/passwd", "an address such as"),
        ("https://login.example/?realm=site", "must not contain"),
        ("https://login.example/#here", "must not contain"),
        ("https://me@login.example/", "an address such as"),
    ],
)
def test_unprotected_issuer_is_refused(issuer: str, complaint: str) -> None:
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
def test_settings_that_admit_no_one_or_everyone_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        OidcSettings.model_validate({**GOOD, **wrong})


def test_audience_and_issuer_are_required() -> None:
    with pytest.raises(ValidationError, match="audience"):
        OidcSettings.model_validate({"issuer": GOOD["issuer"]})


TLS = {"tls_certificate": Path("c.pem"), "tls_key": Path("k.pem")}
USERS: dict[str, Any] = {"users": Path("users.toml")}
OIDC: dict[str, Any] = {"oidc": OidcSettings(issuer="https://login.example", audience="nena")}


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "localhost"])
def test_loopback_needs_nothing(host: str) -> None:
    check_exposure(HttpSettings(host=host, port=0))


@pytest.mark.parametrize("tls", [TLS, {"reverse_proxy": True}])
@pytest.mark.parametrize("login", [USERS, OIDC])
def test_tls_and_login_allow_any_address(tls: dict[str, Any], login: dict[str, Any]) -> None:
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
def test_every_missing_setting_is_listed(given: dict[str, Any], complaints: list[str]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        check_exposure(HttpSettings(host="192.0.2.1", port=0, **given))

    assert len(caught.value.problems) == len(complaints)
    for problem, complaint in zip(caught.value.problems, complaints, strict=True):
        assert complaint in problem


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "localhost"])
def test_loopback_hosts(host: str) -> None:
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "fleet.example", "", "localhost.example"])
def test_other_hosts_are_not_loopback(host: str) -> None:
    assert not is_loopback(host)


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("192.0.2.1", "192.0.2.1"),
        ("::ffff:192.0.2.1", "192.0.2.1"),
        ("2001:db8:1:2:3::4", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("testclient", "testclient"),
    ],
)
def test_ipv6_addresses_of_one_network_count_as_one(address: str, network: str) -> None:
    assert network_of(address) == network
