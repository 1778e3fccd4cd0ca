"""Who somebody is by a token of a real issuer on loopback, which stands in for Keycloak and its like."""

from __future__ import annotations

import pytest

from nena_shared.web.oidc.access_tokens import AccessTokens
from nena_shared.web.oidc.errors import NoRoleError, TokenRefusedError
from nena_shared.web.oidc.issuer import Issuer
from nena_shared.web.oidc.settings import OidcSettings
from nena_shared.web.users import Role
from support.oidc_issuer import OidcIssuer, ec_key


@pytest.fixture
def tokens(settings: OidcSettings) -> AccessTokens:
    return AccessTokens(Issuer(settings))


async def test_somebody_is_known_by_a_token(tokens: AccessTokens, issuer: OidcIssuer) -> None:
    ann = await tokens.who(issuer.token("ann"))

    assert (ann.name, ann.role, ann.subject) == ("ann", Role.OPERATOR, "id-of-ann")


async def test_keys_change_while_tokens_are_shown(tokens: AccessTokens, issuer: OidcIssuer) -> None:
    old = issuer.token("ann")
    await tokens.who(old)
    issuer.keys.insert(0, ec_key("ec-2"))

    assert (await tokens.who(issuer.token("vic"))).role is Role.VIEWER
    assert (await tokens.who(old)).name == "ann"


async def test_a_key_that_nobody_knows_is_refused(tokens: AccessTokens, issuer: OidcIssuer) -> None:
    with pytest.raises(TokenRefusedError, match="no such key"):
        await tokens.who(issuer.token("ann", ec_key("made-up")))


async def test_who_has_no_role_is_told(tokens: AccessTokens, issuer: OidcIssuer) -> None:
    with pytest.raises(NoRoleError, match="bob"):
        await tokens.who(issuer.token("bob"))


async def test_a_kind_of_signature_that_is_not_allowed_asks_nobody(
    settings: OidcSettings, issuer: OidcIssuer
) -> None:
    tokens = AccessTokens(Issuer(settings.model_copy(update={"algorithms": ("ES256",)})))
    with pytest.raises(TokenRefusedError, match="only ES256"):
        await tokens.who(issuer.token("ann"))
    assert not issuer.asked
