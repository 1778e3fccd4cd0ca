"""An issuer's keys: when they are requested, the maximum rate, and what is valid while it is unavailable."""

from __future__ import annotations

import asyncio
import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from nena_shared.extensions.oidc.issuer import (
    ANSWER_LIMIT,
    FRESH,
    KEPT,
    KEYS_LIMIT,
    LOOKS_AT_ONCE,
    BoundedHttp,
    Issuer,
    IssuerTokens,
    KeySet,
    metadata_of,
    metadata_url,
)
from nena_shared.extensions.oidc.tokens import TokenHeader
from nena_shared.fleet_api.base import Role
from nena_shared.settings import ConfigurationError
from nena_shared.web.issued_tokens import IssuerUnavailableError, NoRoleError, TokenRefusedError
from nena_shared.web.settings import OidcSettings
from support.broker import free_port
from support.clocks import ManualClock
from support.oidc_issuer import DISCOVERY, KEYS, OidcIssuer, ec_key, rsa_key
from support.waiting import PATIENCE, awaited, until

KNOWN = TokenHeader("rsa-1", "RS256")
NEW = TokenHeader("ec-2", "ES256")


class Watched:
    """The program's knowledge of an issuer, and its clock."""

    def __init__(self, settings: OidcSettings) -> None:
        self.clock = ManualClock()
        self.issuer = Issuer(settings, self.clock)


@pytest.fixture
def watched(settings: OidcSettings) -> Watched:
    return Watched(settings)


async def test_keys_are_fetched_on_demand_and_cached(watched: Watched, issuer: OidcIssuer) -> None:
    assert not issuer.asked
    for _ in range(3):
        assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
    assert (await watched.issuer.metadata()).jwks_uri == f"{issuer.address}{KEYS}"

    assert issuer.asked == {DISCOVERY: 1, KEYS: 1}


async def test_concurrent_requests_fetch_once(watched: Watched, issuer: OidcIssuer) -> None:
    await asyncio.gather(*(watched.issuer.key(KNOWN) for _ in range(20)))

    assert issuer.asked[KEYS] == 1


async def test_new_key_is_fetched_immediately(watched: Watched, issuer: OidcIssuer) -> None:
    await watched.issuer.key(KNOWN)
    issuer.keys = [ec_key("ec-2")]

    assert (await watched.issuer.key(NEW)).key_id == "ec-2"
    with pytest.raises(TokenRefusedError, match="does not have this key"):
        await watched.issuer.key(KNOWN)


async def test_invented_key_ids_do_not_cause_unlimited_requests(watched: Watched, issuer: OidcIssuer) -> None:
    await watched.issuer.key(KNOWN)
    for number in range(LOOKS_AT_ONCE - 1):
        with pytest.raises(TokenRefusedError, match="does not have this key"):
            await watched.issuer.key(TokenHeader(f"made-up-{number}", "RS256"))
    for number in range(50):
        with pytest.raises(IssuerUnavailableError, match="too many requests"):
            await watched.issuer.key(TokenHeader(f"made-up-more-{number}", "RS256"))

    assert issuer.asked[KEYS] == LOOKS_AT_ONCE
    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
    watched.clock.advance(10.0)
    issuer.keys.append(ec_key("ec-2"))
    assert (await watched.issuer.key(NEW)).key_id == "ec-2"


async def test_revoked_key_expires(watched: Watched, issuer: OidcIssuer) -> None:
    await watched.issuer.key(KNOWN)
    issuer.keys = [ec_key("ec-2")]
    watched.clock.advance(FRESH)

    async def is_refused() -> bool:
        try:
            await watched.issuer.key(KNOWN)
        except TokenRefusedError:
            return True
        return False

    await awaited(is_refused, bool, seconds=PATIENCE, what="the key counts no longer")


async def test_keys_without_ids_are_cached(watched: Watched, issuer: OidcIssuer) -> None:
    keys = [
        {name: value for name, value in key.public.items() if name != "kid"} for key in (rsa_key(), ec_key())
    ]
    issuer.broken[KEYS] = json.dumps({"keys": keys}).encode()
    for algorithm in 3 * ("RS256", "ES256"):
        assert (await watched.issuer.key(TokenHeader(None, algorithm))).algorithm_name == algorithm

    assert issuer.asked[KEYS] == 1


async def test_cached_keys_are_valid_for_a_limited_time_while_the_issuer_is_unavailable(
    watched: Watched, issuer: OidcIssuer
) -> None:
    await watched.issuer.key(KNOWN)
    issuer.broken[DISCOVERY] = b"gone"
    watched.clock.advance(FRESH)

    with capture_logs() as logged:
        assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
        with pytest.raises(IssuerUnavailableError, match="not JSON"):
            await watched.issuer.key(NEW)
    assert [each["event"] for each in logged].count(
        "OIDC issuer unavailable; only NeNa's own tokens are accepted"
    ) == 1
    watched.clock.advance(KEPT - FRESH)
    with pytest.raises(IssuerUnavailableError, match="not JSON"):
        await watched.issuer.key(KNOWN)

    issuer.broken.clear()
    watched.clock.advance(10.0)
    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"


async def test_cached_keys_are_used_while_the_issuer_hangs(watched: Watched, issuer: OidcIssuer) -> None:
    await watched.issuer.key(KNOWN)
    issuer.silent.add(DISCOVERY)
    watched.clock.advance(FRESH)
    before = issuer.asked[DISCOVERY]
    for _ in range(3):
        assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
    assert issuer.asked[DISCOVERY] == before, "nobody has waited for it"
    await until(lambda: issuer.asked[DISCOVERY] > before, what="the issuer is asked")

    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
    assert (await watched.issuer.metadata()).issuer == issuer.address
    assert (issuer.asked[DISCOVERY], watched.issuer.problem) == (before + 1, ""), "it is asked once at a time"
    watched.clock.advance(KEPT - FRESH)
    too_late = asyncio.create_task(watched.issuer.key(KNOWN))
    issuer.closing.set()
    with pytest.raises(IssuerUnavailableError):
        await too_late


@pytest.mark.parametrize("path", [DISCOVERY, KEYS])
async def test_issuer_that_was_never_reachable_is_reported(
    watched: Watched, issuer: OidcIssuer, path: str
) -> None:
    issuer.broken[path] = b"{}"
    with pytest.raises(IssuerUnavailableError):
        await watched.issuer.key(KNOWN)
    issuer.broken.clear()

    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"


async def test_get_returns_the_json_object(issuer: OidcIssuer, settings: OidcSettings) -> None:
    found = await BoundedHttp(settings).get(f"{issuer.address}{DISCOVERY}")

    assert found["issuer"] == issuer.address


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (b"<html>", "not JSON"),
        (b"[]", "not an object"),
        (b"[" * 100_000, "not JSON"),
        (b"\xff", "not JSON"),
        (gzip.compress(b"{}", mtime=0), "not JSON"),
        (b" " * (ANSWER_LIMIT + 1), "more than"),
    ],
)
async def test_any_response_yields_a_reason(
    issuer: OidcIssuer, settings: OidcSettings, answer: bytes, reason: str
) -> None:
    issuer.broken[DISCOVERY] = answer
    with pytest.raises(IssuerUnavailableError, match=reason):
        await BoundedHttp(settings).get(f"{issuer.address}{DISCOVERY}")


async def test_other_status_is_an_error(issuer: OidcIssuer, settings: OidcSettings) -> None:
    with pytest.raises(IssuerUnavailableError, match="answered 404"):
        await BoundedHttp(settings).get(f"{issuer.address}/elsewhere")


async def test_redirects_are_not_followed(issuer: OidcIssuer, settings: OidcSettings) -> None:
    issuer.moved[DISCOVERY] = "/keys"
    with pytest.raises(IssuerUnavailableError, match="answered 302"):
        await BoundedHttp(settings).get(f"{issuer.address}{DISCOVERY}")
    assert issuer.asked["/keys"] == 0


async def test_request_times_out(issuer: OidcIssuer, settings: OidcSettings) -> None:
    issuer.silent.add(DISCOVERY)
    impatient = BoundedHttp(settings.model_copy(update={"timeout": 0.2}))
    with pytest.raises(IssuerUnavailableError, match="not answered within"):
        await impatient.get(f"{issuer.address}{DISCOVERY}")


async def test_unreachable_server_is_reported(settings: OidcSettings) -> None:
    with pytest.raises(IssuerUnavailableError, match=r"127\.0\.0\.1"):
        await BoundedHttp(settings).get(f"http://127.0.0.1:{free_port()}/")


@pytest.mark.parametrize("content", [None, "no certificate"])
def test_invalid_ca_file_is_reported(settings: OidcSettings, tmp_path: Path, content: str | None) -> None:
    file = tmp_path / "ca.pem"
    if content:
        file.write_text(content)
    with pytest.raises(ConfigurationError, match=r"http\.oidc\.ca"):
        BoundedHttp(settings.model_copy(update={"ca": file}))


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


def test_key_without_an_id_must_be_unambiguous() -> None:
    alone = KeySet.of({"keys": [RSA]})
    assert alone.has(None, "RS256")
    assert not alone.has(None, "ES256")

    both = KeySet.of({"keys": [RSA, EC]})
    assert both.has(None, "RS256")
    assert both.has(None, "ES256")
    assert not KeySet.of({"keys": [RSA, RSA]}).has(None, "RS256")
    twins = KeySet.of({"keys": [EC, {**ec_key().public, "kid": EC["kid"]}]})
    assert twins.find("ec-1", "ES256") is None


def test_other_keys_are_ignored() -> None:
    keys = KeySet.of({"keys": [SECRET, {**EC, "use": "enc"}, 5, {}, RSA]})

    assert not keys.has("secret", "RS256")
    assert not keys.has("ec-1", "ES256")
    assert keys.has("rsa-1", "RS256")


def test_damaged_key_is_not_found() -> None:
    keys = KeySet.of({"keys": [{**RSA, "n": "!"}, {**EC, "crv": "P-0"}]})

    assert keys.find("rsa-1", "RS256") is None
    assert keys.find("ec-1", "ES256") is None


@pytest.mark.parametrize(
    "document", [{}, {"keys": {}}, {"keys": []}, {"keys": [SECRET]}, {"keys": [RSA] * (KEYS_LIMIT + 1)}]
)
def test_key_set_without_keys_is_refused(document: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="key"):
        KeySet.of(document)


ISSUER = "https://login.example/realms/site"
GOOD = {"issuer": ISSUER, "jwks_uri": "https://login.example/keys", "scopes_supported": ["openid"]}


@pytest.mark.parametrize("issuer", [ISSUER, f"{ISSUER}/"])
def test_it_is_at_one_place(issuer: str) -> None:
    assert metadata_url(issuer) == f"{ISSUER}/.well-known/openid-configuration"


def test_only_needed_parts_are_read() -> None:
    found = metadata_of(GOOD, ISSUER)

    assert found.jwks_uri == "https://login.example/keys"
    assert found.token_endpoint_auth_methods_supported == ("client_secret_basic",)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"issuer": f"{ISSUER}/"}, "set http.oidc.issuer to exactly this value"),
        ({"issuer": "https://evil.example"}, "its issuer is 'https://evil.example'"),
        ({"jwks_uri": "http://login.example/keys"}, "jwks_uri.*https"),
        ({"jwks_uri": "file:///etc/passwd"}, "jwks_uri"),
        ({"jwks_uri": None}, "jwks_uri"),
        ({"token_endpoint": 5}, "token_endpoint"),
        ({"issuer": "x" * 100_000}, "set http.oidc.issuer to exactly this value"),
        ({"token_endpoint_auth_methods_supported": [5] * 10_000}, "token_endpoint_auth_methods"),
    ],
)
def test_invalid_metadata_is_explained(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(IssuerUnavailableError, match=reason) as caught:
        metadata_of({**GOOD, **change}, ISSUER)
    assert len(str(caught.value)) < 1000


@pytest.fixture
def tokens(settings: OidcSettings) -> IssuerTokens:
    return IssuerTokens(Issuer(settings))


async def test_user_is_read_from_a_token(tokens: IssuerTokens, issuer: OidcIssuer) -> None:
    ann = await tokens.user_of(issuer.token("ann"))

    assert (ann.name, ann.role, ann.subject) == ("ann", Role.OPERATOR, "id-of-ann")


async def test_keys_rotate_while_tokens_are_used(tokens: IssuerTokens, issuer: OidcIssuer) -> None:
    old = issuer.token("ann")
    await tokens.user_of(old)
    issuer.keys.insert(0, ec_key("ec-2"))

    assert (await tokens.user_of(issuer.token("vic"))).role is Role.VIEWER
    assert (await tokens.user_of(old)).name == "ann"


async def test_unknown_key_is_refused(tokens: IssuerTokens, issuer: OidcIssuer) -> None:
    with pytest.raises(TokenRefusedError, match="does not have this key"):
        await tokens.user_of(issuer.token("ann", ec_key("made-up")))


async def test_user_without_a_role_is_reported(tokens: IssuerTokens, issuer: OidcIssuer) -> None:
    with pytest.raises(NoRoleError, match="bob"):
        await tokens.user_of(issuer.token("bob"))


async def test_disallowed_algorithm_causes_no_request(settings: OidcSettings, issuer: OidcIssuer) -> None:
    tokens = IssuerTokens(Issuer(settings.model_copy(update={"algorithms": ("ES256",)})))
    with pytest.raises(TokenRefusedError, match="only ES256"):
        await tokens.user_of(issuer.token("ann"))
    assert not issuer.asked
