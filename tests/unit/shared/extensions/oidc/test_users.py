from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.extensions.oidc.users import user_of, values_of
from nena_shared.fleet_api.base import Role
from nena_shared.web.issued_tokens import NoRoleError, TokenRefusedError
from nena_shared.web.settings import OidcSettings

END = 1_790_000_000
CLAIMS: dict[str, Any] = {"sub": "17", "exp": END, "preferred_username": "ann", "roles": ["nena-operator"]}


def settings(**more: Any) -> OidcSettings:
    return OidcSettings.model_validate({"issuer": "https://login.example", "audience": "nena", **more})


def test_user_is_derived_from_the_claims() -> None:
    ann = user_of(CLAIMS, settings())

    assert (ann.name, ann.role, ann.subject) == ("ann", Role.OPERATOR, "17")


def test_user_expires_with_the_token() -> None:
    ann = user_of(CLAIMS, settings(leeway=20))

    assert ann.expires == datetime.fromtimestamp(END + 20, UTC)


@pytest.mark.parametrize(
    ("path", "claims", "values"),
    [
        ("roles", {"roles": ["a", "b"]}, {"a", "b"}),
        ("groups", {"groups": "a"}, {"a"}),
        ("realm_access.roles", {"realm_access": {"roles": ["a"]}}, {"a"}),
        ("a.b.c", {"a": {"b": {"c": "x"}}}, {"x"}),
        ("https://site.example/roles", {"https://site.example/roles": ["a"]}, {"a"}),
        ("a.b", {"a.b": "whole", "a": {"b": "steps"}}, {"whole"}),
        ("roles", {}, set()),
        ("roles", {"roles": None}, set()),
        ("roles", {"roles": [1, None, ["a"], {"a": 1}, "b"]}, {"b"}),
        ("a.b", {"a": "text"}, set()),
        ("a.b", {"a": ["b"]}, set()),
    ],
)
def test_a_claim_is_found_by_its_path(path: str, claims: dict[str, Any], values: set[str]) -> None:
    assert values_of(claims, path) == values


@pytest.mark.parametrize(
    ("given_roles", "role"),
    [
        (["nena-viewer"], Role.VIEWER),
        (["nena-admin", "nena-viewer"], Role.ADMIN),
        (["other", "nena-operator"], Role.OPERATOR),
    ],
)
def test_the_highest_role_counts(given_roles: list[str], role: Role) -> None:
    assert user_of({**CLAIMS, "roles": given_roles}, settings()).role is role


def test_custom_role_table_is_used() -> None:
    table = settings(roles_claim="groups", roles={"/fleet/lead": "admin"})

    assert user_of({**CLAIMS, "groups": ["/fleet/lead"]}, table).role is Role.ADMIN
    with pytest.raises(NoRoleError):
        user_of({**CLAIMS, "groups": ["nena-admin"]}, table)


@pytest.mark.parametrize("given_roles", [[], ["cook"], "NENA-ADMIN", None, {"nena-admin": True}])
def test_missing_role_error_has_advice(given_roles: object) -> None:
    with pytest.raises(
        NoRoleError, match=r"ann has no role in NeNa.*nena-viewer, nena-operator, nena-admin.*claim roles"
    ):
        user_of({**CLAIMS, "roles": given_roles}, settings())


@pytest.mark.parametrize("name", [None, "", 5, "x" * 65, "two\nlines", "\x1b[31m"])
def test_unprintable_name_is_replaced_by_the_subject(name: object) -> None:
    assert user_of({**CLAIMS, "preferred_username": name}, settings()).name == "17"


@pytest.mark.parametrize("subject", [None, "", 5, "x" * 256, "two\nlines"])
def test_token_without_a_subject_is_refused(subject: object) -> None:
    with pytest.raises(TokenRefusedError, match="sub"):
        user_of({**CLAIMS, "sub": subject}, settings())


@pytest.mark.parametrize("end", [None, "soon", float("inf"), float("nan"), 10**30, []])
def test_invalid_expiry_is_refused(end: object) -> None:
    with pytest.raises(TokenRefusedError, match="exp"):
        user_of({**CLAIMS, "exp": end}, settings())


def test_users_with_the_same_name_are_distinguished() -> None:
    assert user_of(CLAIMS, settings()).known_as != user_of({**CLAIMS, "sub": "18"}, settings()).known_as


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from(["sub", "exp", "preferred_username", "roles"]), json_values))
def test_any_claims_yield_a_user_or_a_defined_error(claims: dict[str, Any]) -> None:
    try:
        user = user_of(claims, settings())
    except (TokenRefusedError, NoRoleError):
        return
    else:
        assert user.role in Role
