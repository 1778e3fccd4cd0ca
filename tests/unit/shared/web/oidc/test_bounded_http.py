from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from nena_shared.settings import ConfigurationError
from nena_shared.web.oidc.bounded_http import ANSWER_LIMIT, BoundedHttp
from nena_shared.web.oidc.errors import IssuerAwayError
from nena_shared.web.oidc.settings import OidcSettings
from support.broker import free_port
from support.oidc_issuer import DISCOVERY, OidcIssuer


async def test_it_gives_the_object_that_is_there(issuer: OidcIssuer, settings: OidcSettings) -> None:
    found = await BoundedHttp(settings).get(f"{issuer.address}{DISCOVERY}")

    assert found["issuer"] == issuer.address


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (b"<html>", "no JSON"),
        (b"[]", "no object"),
        (b"[" * 100_000, "no JSON"),
        (b"\xff", "no JSON"),
        (gzip.compress(b"{}", mtime=0), "no JSON"),
        (b" " * (ANSWER_LIMIT + 1), "more than"),
    ],
)
async def test_whatever_is_answered_there_is_a_reason(
    issuer: OidcIssuer, settings: OidcSettings, answer: bytes, reason: str
) -> None:
    issuer.broken[DISCOVERY] = answer
    with pytest.raises(IssuerAwayError, match=reason):
        await BoundedHttp(settings).get(f"{issuer.address}{DISCOVERY}")


async def test_another_status_is_none(issuer: OidcIssuer, settings: OidcSettings) -> None:
    with pytest.raises(IssuerAwayError, match="answered 404"):
        await BoundedHttp(settings).get(f"{issuer.address}/elsewhere")


async def test_it_follows_nowhere(issuer: OidcIssuer, settings: OidcSettings) -> None:
    issuer.moved[DISCOVERY] = "/keys"
    with pytest.raises(IssuerAwayError, match="answered 302"):
        await BoundedHttp(settings).get(f"{issuer.address}{DISCOVERY}")
    assert issuer.asked["/keys"] == 0


async def test_silence_ends(issuer: OidcIssuer, settings: OidcSettings) -> None:
    issuer.silent.add(DISCOVERY)
    impatient = BoundedHttp(settings.model_copy(update={"timeout": 0.2}))
    with pytest.raises(IssuerAwayError, match="not answered within"):
        await impatient.get(f"{issuer.address}{DISCOVERY}")


async def test_where_nobody_is_it_says_so(settings: OidcSettings) -> None:
    with pytest.raises(IssuerAwayError, match=r"127\.0\.0\.1"):
        await BoundedHttp(settings).get(f"http://127.0.0.1:{free_port()}/")


@pytest.mark.parametrize("content", [None, "no certificate"])
def test_a_file_of_certificates_that_is_none_is_told(
    settings: OidcSettings, tmp_path: Path, content: str | None
) -> None:
    file = tmp_path / "ca.pem"
    if content:
        file.write_text(content)
    with pytest.raises(ConfigurationError, match=r"http\.oidc\.ca"):
        BoundedHttp(settings.model_copy(update={"ca": file}))
