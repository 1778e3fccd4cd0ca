from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.settings import ConfigurationError, load
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.settings import AggregatorSettings, Share


def loaded(*argv: str) -> AggregatorSettings:
    return load(AggregatorSettings, argv, program="nena-status-aggregator", description="")


OIDC = ("--http.oidc.issuer", "https://login.example", "--http.oidc.audience", "nena")


def test_a_table_of_roles_is_the_sites_own(tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text(
        '[http.oidc]\nissuer = "https://login.example"\naudience = "nena"\n'
        'roles_claim = "groups"\n[http.oidc.roles]\n"/fleet/lead" = "admin"\n'
    )
    oidc = loaded("--config", str(file)).http.oidc
    assert oidc is not None
    assert (oidc.roles_claim, oidc.roles) == ("groups", {"/fleet/lead": "admin"})


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (("--http.oidc.client_id", "panel"), "set together"),
        (("--http.oidc.panel_url", "https://fleet.example/"), "set together"),
        (("--http.oidc.panel_url", "http://fleet.example/"), "panel_url.*https"),
        (("--http.oidc.scopes", "profile"), "openid"),
        (("--http.oidc.algorithms", "HS256"), "algorithms"),
    ],
)
def test_insecure_issuer_is_refused(more: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=complaint):
        loaded(*OIDC, *more)


def test_client_secret_is_read_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "secret"
    file.write_text("quiet\n")
    panel = ("--http.oidc.client_id", "panel", "--http.oidc.panel_url", "https://fleet.example/")
    oidc = loaded(*OIDC, *panel, "--http.oidc.client_secret_file", str(file)).http.oidc
    assert oidc is not None
    assert (oidc.secret(), "quiet" in repr(oidc)) == ("quiet", False)
    public = loaded(*OIDC, *panel).http.oidc
    assert public is not None
    assert public.secret() is None


NAMES = st.builds(RobotKey, st.text(min_size=1), st.text(min_size=1))


@given(robot=NAMES, of=st.integers(1, 20))
def test_each_robot_is_in_exactly_one_share(robot: RobotKey, of: int) -> None:
    shares = [Share.read(f"{number}/{of}") for number in range(1, of + 1)]
    assert [share.has(robot) for share in shares].count(True) == 1


def test_shares_are_of_about_the_same_size() -> None:
    robots = [RobotKey("ACME", f"robot-{number:04d}") for number in range(900)]
    sizes = [sum(Share(number, 3).has(robot) for robot in robots) for number in (1, 2, 3)]
    assert min(sizes) > 250


def test_share_of_a_robot_never_changes() -> None:
    assert [str(share) for share in (Share(1, 2), Share(2, 2)) if share.has(RobotKey("ACME", "r1"))] == [
        "2/2"
    ]


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "1/0", "-1/2", "1/2/3", "a/b", "1/1000", "1/²"])
def test_invalid_share_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match="1/2 for the first of two"):
        Share.read(text)
