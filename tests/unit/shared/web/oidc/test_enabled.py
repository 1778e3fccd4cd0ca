from __future__ import annotations

import subprocess
import sys

import pytest

from nena_shared.settings import ConfigurationError
from nena_shared.web.oidc.access_tokens import AccessTokens
from nena_shared.web.oidc.enabled import access_tokens_of
from nena_shared.web.oidc.settings import OidcSettings
from nena_shared.web.settings import HttpSettings

OIDC = OidcSettings(issuer="https://login.example", audience="nena")


def test_it_is_off_until_an_issuer_is_named() -> None:
    assert access_tokens_of(HttpSettings(port=0)) is None
    assert isinstance(access_tokens_of(HttpSettings(port=0, oidc=OIDC)), AccessTokens)


def test_without_its_libraries_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [each for each in sys.modules if each.startswith("nena_shared.web.oidc.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "jwt", None)

    with pytest.raises(ConfigurationError, match=r"http\.oidc\.issuer: .*jwt.*\[oidc\]"):
        access_tokens_of(HttpSettings(port=0, oidc=OIDC))


def test_a_service_without_it_loads_none_of_its_libraries() -> None:
    code = "import nena_order_service.app, nena_status_aggregator.__main__, sys; print('jwt' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)

    assert done.stdout.strip() == "False"
