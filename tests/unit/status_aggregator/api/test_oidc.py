from __future__ import annotations

import base64
import hashlib
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st
from structlog.testing import capture_logs

from nena_shared.extensions.oidc.issuer import IssuerTokens
from nena_shared.web.access import access_tokens_of
from nena_status_aggregator.api.oidc import Attempt, SignIn, SignInError, sign_in_of
from nena_status_aggregator.settings import AggregatorHttpSettings, PanelOidcSettings
from support.oidc_issuer import AUDIENCE, CLIENT, DISCOVERY, TOKEN, OidcIssuer

PANEL = "https://fleet.example/panel/"
SECRET = "s3cr3t&:%/+"


@pytest.fixture
def issuer(issuer: OidcIssuer) -> OidcIssuer:
    """Return an issuer on loopback in place of Keycloak and the like."""
    issuer.register(PANEL)
    return issuer


def tokens(issuer: OidcIssuer, **more: Any) -> IssuerTokens:
    chosen = PanelOidcSettings.model_validate({**issuer.settings_of(PANEL), **more})
    http = AggregatorHttpSettings(oidc=chosen)
    reader = access_tokens_of(http)
    assert isinstance(reader, IssuerTokens)
    return reader


def sign_in(issuer: OidcIssuer, **more: Any) -> SignIn:
    made = sign_in_of(tokens(issuer, **more))
    assert made is not None
    return made


async def came_back(
    issuer: OidcIssuer, signing: SignIn, attempt: Attempt, name: str = "ann"
) -> dict[str, str]:
    """Sign in at the issuer as ``name``; return the parameters of its redirect."""
    query = dict(parse_qsl(urlsplit(await signing.begin(attempt)).query))
    status, where, _ = issuer.authorize({**query, "person": name})
    assert status == 302
    return dict(parse_qsl(urlsplit(where).query))


async def test_redirect_to_the_issuer_has_all_protections(issuer: OidcIssuer) -> None:
    attempt = Attempt.new()
    place = urlsplit(await sign_in(issuer).begin(attempt))
    asked = dict(parse_qsl(place.query))

    assert f"{place.scheme}://{place.netloc}{place.path}" == f"{issuer.address}/authorize"
    digest = hashlib.sha256(attempt.verifier.encode()).digest()
    assert base64.urlsafe_b64decode(asked["code_challenge"] + "=") == digest
    assert asked == {
        "response_type": "code",
        "client_id": CLIENT,
        "redirect_uri": f"{PANEL}api/v1/session/oidc/callback",
        "scope": "openid profile",
        "state": attempt.state,
        "nonce": attempt.nonce,
        "code_challenge": asked["code_challenge"],
        "code_challenge_method": "S256",
    }


async def test_query_of_an_endpoint_is_preserved(issuer: OidcIssuer) -> None:
    issuer.metadata["authorization_endpoint"] = f"{issuer.address}/authorize?policy=site"
    place = await sign_in(issuer).begin(Attempt.new())

    assert place.startswith(f"{issuer.address}/authorize?policy=site&response_type=code&")


@pytest.mark.parametrize(
    ("secret", "methods"),
    [(None, None), (SECRET, None), (SECRET, ["client_secret_post"]), (SECRET, ["client_secret_basic"])],
)
async def test_user_signs_in(issuer: OidcIssuer, secret: str | None, methods: list[str] | None) -> None:
    issuer.client_secret = secret
    if methods:
        issuer.metadata["token_endpoint_auth_methods_supported"] = methods
    signing, attempt = sign_in(issuer, client_secret=secret), Attempt.new()

    done = await signing.finish(attempt, await came_back(issuer, signing, attempt))

    assert (done.user.name, done.user.role.name) == ("ann", "OPERATOR")


async def refusal(issuer: OidcIssuer, **settings: Any) -> SignInError:
    """Sign in until it fails; return the error."""
    signing, attempt = sign_in(issuer, **settings), Attempt.new()
    query = await came_back(issuer, signing, attempt)
    with pytest.raises(SignInError) as caught:
        await signing.finish(attempt, query)
    return caught.value


@pytest.mark.parametrize(
    ("id_claims", "reason"),
    [
        ({"nonce": "of another sign-in"}, "nonce"),
        ({"nonce": None}, "nonce"),
        ({"nonce": "\ud800"}, "nonce"),
        ({"aud": "another-client"}, "another audience"),
        ({"aud": [CLIENT, "other"], "azp": "other"}, "azp"),
        ({"aud": [CLIENT, "other"], "azp": None}, "azp"),
        ({"aud": [CLIENT, "other"]}, "azp"),
        ({"iss": "https://evil.example"}, "another issuer"),
        ({"exp": 1}, "expired"),
        ({"sub": "id-of-vic"}, "different users"),
    ],
)
async def test_an_id_token_that_is_not_of_this_sign_in_is_refused(
    issuer: OidcIssuer, id_claims: dict[str, Any], reason: str
) -> None:
    issuer.id_claims = id_claims

    error = await refusal(issuer)
    assert (error.why, reason in str(error)) == ("unfit", True), str(error)


@pytest.mark.parametrize(
    ("access_claims", "why"),
    [({"aud": "other"}, "unfit"), ({"exp": 1}, "unfit"), ({"roles": ["cook"]}, "role")],
)
async def test_invalid_access_token_fails_the_sign_in(
    issuer: OidcIssuer, access_claims: dict[str, Any], why: str
) -> None:
    issuer.access_claims = access_claims

    assert (await refusal(issuer)).why == why


async def test_wrong_client_secret_is_reported(issuer: OidcIssuer) -> None:
    issuer.client_secret = SECRET
    error = await refusal(issuer, client_secret="wrong")

    assert (error.why, "invalid_client" in str(error)) == ("refused", True)
    assert "wrong" not in str(error)


@pytest.mark.parametrize("answer", [b"{}", b'{"access_token": 5, "id_token": "x"}', b'{"access_token": "x"}'])
async def test_response_without_tokens_fails_the_sign_in(issuer: OidcIssuer, answer: bytes) -> None:
    issuer.broken[TOKEN] = answer

    assert (await refusal(issuer)).why == "unfit"


async def test_a_code_counts_once(issuer: OidcIssuer) -> None:
    signing, attempt = sign_in(issuer), Attempt.new()
    query = await came_back(issuer, signing, attempt)
    await signing.finish(attempt, query)

    with pytest.raises(SignInError, match="invalid_grant") as caught:
        await signing.finish(attempt, query)
    assert caught.value.why == "refused"


async def test_code_of_another_sign_in_is_refused(issuer: OidcIssuer) -> None:
    """Check that a stolen code alone has neither the state nor the verifier that belong to it."""
    signing, own = sign_in(issuer), Attempt.new()
    stolen = await came_back(issuer, signing, Attempt.new(), "vic")

    with pytest.raises(SignInError) as caught:
        await signing.finish(own, stolen)
    assert caught.value.why == "expired"
    with pytest.raises(SignInError, match="invalid_grant"):
        await signing.finish(own, {**stolen, "state": own.state})


@pytest.mark.parametrize("state", [None, "", "wrong", "ä", "\ud800"])
async def test_wrong_state_causes_no_request_to_the_issuer(issuer: OidcIssuer, state: str | None) -> None:
    query = {"code": "x"} if state is None else {"code": "x", "state": state}
    for attempt in (Attempt.new(), None):
        with pytest.raises(SignInError, match="state"):
            await sign_in(issuer).finish(attempt, query)
    assert not issuer.asked


async def test_refusal_by_the_issuer_is_reported(issuer: OidcIssuer) -> None:
    signing, attempt = sign_in(issuer), Attempt.new()
    query = await came_back(issuer, signing, attempt, "nobody")

    with pytest.raises(SignInError, match="access_denied") as caught:
        await signing.finish(attempt, query)
    assert caught.value.why == "refused"


async def test_unavailable_issuer_is_reported(issuer: OidcIssuer) -> None:
    issuer.broken[DISCOVERY] = b"gone"

    with pytest.raises(SignInError) as caught:
        await sign_in(issuer).begin(Attempt.new())
    assert caught.value.why == "away"


@pytest.mark.parametrize("name", ["authorization_endpoint", "token_endpoint"])
async def test_unprotected_endpoint_is_not_used(issuer: OidcIssuer, name: str) -> None:
    signing, attempt = sign_in(issuer), Attempt.new()
    query = dict(parse_qsl(urlsplit(await signing.begin(attempt)).query))
    _, where, _ = issuer.authorize({**query, "person": "ann"})
    issuer.metadata[name] = "http://evil.example/"
    again, query = sign_in(issuer), dict(parse_qsl(urlsplit(where).query))
    step = again.begin(attempt) if name == "authorization_endpoint" else again.finish(attempt, query)

    with pytest.raises(SignInError, match="https"):
        await step


@given(st.text(max_size=40))
def test_attempt_round_trip_and_rejection_of_other_texts(text: str) -> None:
    made = Attempt.new()
    assert Attempt.read(made.text()) == made
    read = Attempt.read(text)
    assert read is None or read.text() == text


@pytest.mark.parametrize(("audience", "warnings"), [(AUDIENCE, 0), (CLIENT, 1)])
def test_an_audience_for_which_id_tokens_count_is_warned_of(
    issuer: OidcIssuer, audience: str, warnings: int
) -> None:
    with capture_logs() as logged:
        sign_in(issuer, audience=audience)

    assert [each["audience"] for each in logged if each["log_level"] == "warning"] == warnings * [CLIENT]


def test_without_a_client_the_panel_has_no_oidc_sign_in(issuer: OidcIssuer) -> None:
    assert sign_in_of(tokens(issuer, client_id=None, panel_url=None)) is None
    assert sign_in_of(None) is None
