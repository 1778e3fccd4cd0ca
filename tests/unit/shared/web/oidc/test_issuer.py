"""An issuer's keys: when they are asked for, how often at most, and what counts while it is away."""

from __future__ import annotations

import asyncio
import json

import pytest
from structlog.testing import capture_logs

from nena_shared.clock import ManualClock
from nena_shared.web.oidc.errors import IssuerAwayError, TokenRefusedError
from nena_shared.web.oidc.issuer import FRESH, KEPT, LOOKS_AT_ONCE, Issuer
from nena_shared.web.oidc.settings import OidcSettings
from nena_shared.web.oidc.token import Header
from support.oidc_issuer import DISCOVERY, KEYS, OidcIssuer, ec_key, rsa_key
from support.waiting import PATIENCE, awaited, until

KNOWN = Header("rsa-1", "RS256")
NEW = Header("ec-2", "ES256")


class Watched:
    """What the program knows of an issuer, and the clock that it goes by."""

    def __init__(self, settings: OidcSettings) -> None:
        self.clock = ManualClock()
        self.issuer = Issuer(settings, self.clock)


@pytest.fixture
def watched(settings: OidcSettings) -> Watched:
    return Watched(settings)


async def test_it_is_asked_when_a_key_is_needed_and_remembered(watched: Watched, issuer: OidcIssuer) -> None:
    assert not issuer.asked
    for _ in range(3):
        assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
    assert (await watched.issuer.metadata()).jwks_uri == f"{issuer.address}{KEYS}"

    assert issuer.asked == {DISCOVERY: 1, KEYS: 1}


async def test_those_who_come_at_once_ask_once(watched: Watched, issuer: OidcIssuer) -> None:
    await asyncio.gather(*(watched.issuer.key(KNOWN) for _ in range(20)))

    assert issuer.asked[KEYS] == 1


async def test_a_new_key_is_found_at_once(watched: Watched, issuer: OidcIssuer) -> None:
    await watched.issuer.key(KNOWN)
    issuer.keys = [ec_key("ec-2")]

    assert (await watched.issuer.key(NEW)).key_id == "ec-2"
    with pytest.raises(TokenRefusedError, match="no such key"):
        await watched.issuer.key(KNOWN)


async def test_made_up_keys_make_nobody_ask_without_end(watched: Watched, issuer: OidcIssuer) -> None:
    await watched.issuer.key(KNOWN)
    for number in range(LOOKS_AT_ONCE - 1):
        with pytest.raises(TokenRefusedError, match="no such key"):
            await watched.issuer.key(Header(f"made-up-{number}", "RS256"))
    for number in range(50):
        with pytest.raises(IssuerAwayError, match="too often"):
            await watched.issuer.key(Header(f"made-up-more-{number}", "RS256"))

    assert issuer.asked[KEYS] == LOOKS_AT_ONCE
    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
    watched.clock.advance(10.0)
    issuer.keys.append(ec_key("ec-2"))
    assert (await watched.issuer.key(NEW)).key_id == "ec-2"


async def test_a_key_that_was_taken_back_does_not_count_for_long(
    watched: Watched, issuer: OidcIssuer
) -> None:
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


async def test_keys_without_ids_are_not_asked_for_again_and_again(
    watched: Watched, issuer: OidcIssuer
) -> None:
    keys = [
        {name: value for name, value in key.public.items() if name != "kid"} for key in (rsa_key(), ec_key())
    ]
    issuer.broken[KEYS] = json.dumps({"keys": keys}).encode()
    for algorithm in 3 * ("RS256", "ES256"):
        assert (await watched.issuer.key(Header(None, algorithm))).algorithm_name == algorithm

    assert issuer.asked[KEYS] == 1


async def test_known_keys_count_while_it_is_away_but_not_for_ever(
    watched: Watched, issuer: OidcIssuer
) -> None:
    await watched.issuer.key(KNOWN)
    issuer.broken[DISCOVERY] = b"gone"
    watched.clock.advance(FRESH)

    with capture_logs() as logged:
        assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
        with pytest.raises(IssuerAwayError, match="no JSON"):
            await watched.issuer.key(NEW)
    assert [each["event"] for each in logged].count(
        "the OIDC issuer cannot be asked; NeNa's own tokens count"
    ) == 1
    watched.clock.advance(KEPT - FRESH)
    with pytest.raises(IssuerAwayError, match="no JSON"):
        await watched.issuer.key(KNOWN)

    issuer.broken.clear()
    watched.clock.advance(10.0)
    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"


async def test_while_it_is_silent_known_keys_are_not_waited_for(watched: Watched, issuer: OidcIssuer) -> None:
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
    with pytest.raises(IssuerAwayError):
        await too_late


@pytest.mark.parametrize("path", [DISCOVERY, KEYS])
async def test_an_issuer_that_was_never_there_is_told(
    watched: Watched, issuer: OidcIssuer, path: str
) -> None:
    issuer.broken[path] = b"{}"
    with pytest.raises(IssuerAwayError):
        await watched.issuer.key(KNOWN)
    issuer.broken.clear()

    assert (await watched.issuer.key(KNOWN)).key_id == "rsa-1"
