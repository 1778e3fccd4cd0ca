from __future__ import annotations

import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.fleet_api.base import Role
from nena_shared.settings import ConfigurationError
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import (
    User,
    UsersFile,
    hash_of,
    make_first_user,
    new_token,
    read_users,
    users_of,
    write_users,
)

names = st.from_regex(r"[A-Za-z0-9_.@-]{1,64}", fullmatch=True)
users = st.builds(User, name=names, role=st.sampled_from(Role), token_sha256=st.text().map(hash_of))


def someone(name: str, token: str, role: Role = Role.VIEWER) -> User:
    return User(name=name, role=role, token_sha256=hash_of(token))


@given(st.lists(users, unique_by=lambda user: user.name, max_size=5))
def test_written_users_are_read_unchanged(found: list[User]) -> None:
    import tempfile  # noqa: PLC0415 - a folder for each example

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "users.toml"
        write_users(file, found)

        assert read_users(file) == tuple(found)


def test_file_is_private_and_contains_no_token(tmp_path: Path) -> None:
    file, token = tmp_path / "users.toml", new_token()
    write_users(file, [someone("ann", token)])

    assert stat.S_IMODE(file.stat().st_mode) & 0o007 == 0
    assert token not in file.read_text()
    assert list(tmp_path.iterdir()) == [file]


def test_file_permissions_are_preserved(tmp_path: Path) -> None:
    file = tmp_path / "users.toml"
    write_users(file, [])
    file.chmod(0o604)
    write_users(file, [someone("ann", "a")])

    assert stat.S_IMODE(file.stat().st_mode) == 0o604


def test_tokens_are_long_and_unique() -> None:
    found = {new_token() for _ in range(1000)}

    assert len(found) == 1000
    assert all(len(token) > 40 and token.startswith("nena_") for token in found)


def test_user_is_found_by_token(tmp_path: Path) -> None:
    write_users(tmp_path / "u", [someone("ann", "a", Role.ADMIN), someone("bob", "b")])
    users = UsersFile(tmp_path / "u")

    assert users.user_of("b") == someone("bob", "b")
    assert users.user_of("a") == someone("ann", "a", Role.ADMIN)
    assert [users.user_of(each) for each in ("", "c", "ann", hash_of("a"))] == [None] * 4


def test_user_removed_from_the_file_is_locked_out_immediately(tmp_path: Path) -> None:
    write_users(tmp_path / "u", [someone("ann", "a"), someone("bob", "b")])
    users = UsersFile(tmp_path / "u")
    write_users(tmp_path / "u", [someone("bob", "b"), someone("cid", "c")])

    assert users.user_of("a") is None
    assert users.user_of("c") == someone("cid", "c")


def test_invalid_users_file_locks_everyone_out(tmp_path: Path) -> None:
    write_users(tmp_path / "u", [someone("ann", "a")])
    users = UsersFile(tmp_path / "u")
    (tmp_path / "u").unlink()
    with pytest.raises(ConfigurationError, match="No such file"):
        users.user_of("a")
    (tmp_path / "u").write_text("[[user]]\nname = 1")
    with pytest.raises(ConfigurationError):
        users.user_of("a")
    write_users(tmp_path / "u", [someone("ann", "a")])

    assert users.user_of("a") == someone("ann", "a")


def test_first_user_is_created_once_with_a_private_token_file(tmp_path: Path) -> None:
    file = tmp_path / "users.toml"
    secret = make_first_user(file)

    assert secret is not None
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    user = UsersFile(file).user_of(secret.read_text().strip())
    assert user is not None
    assert (user.name, user.role) == ("admin", Role.ADMIN)
    assert make_first_user(file) is None
    assert sorted(each.name for each in tmp_path.iterdir()) == ["users.toml", "users.toml.token"]


def test_programs_that_start_together_agree_on_the_first_user(tmp_path: Path) -> None:
    file = tmp_path / "users.toml"
    with ThreadPoolExecutor(8) as pool:
        made = [each for each in pool.map(lambda _: make_first_user(file), range(8)) if each]

    assert len(made) == 1
    assert UsersFile(file).user_of(made[0].read_text().strip()) is not None


def test_unwritable_path_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file or directory"):
        make_first_user(tmp_path / "none" / "users.toml")


def test_settings_decide_whether_login_is_required(tmp_path: Path) -> None:
    file = tmp_path / "users.toml"

    assert users_of(HttpSettings(port=0)) is None
    with pytest.raises(ConfigurationError, match="No such file"):
        users_of(HttpSettings(port=0, users=file))
    assert users_of(HttpSettings(port=0, users=file, first_user=True)) is not None


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[[user]\n", "is not valid TOML"),
        ("\udcff", "is not valid TOML"),
        ("user = " + "[" * 500, "is not valid TOML: lists or tables are nested too deeply"),
        ("user = " + "1" * 5000, "is not valid TOML"),
        ('[[user]]\nname = "a b"\nrole = "viewer"\ntoken_sha256 = "x"\n', r"user\.0\.name"),
        ('[[user]]\nname = "a"\nrole = "king"\n', r"user\.0\.role"),
        ("[[users]]\n", "users"),
        (
            '[[user]]\nname = "a"\nrole = "admin"\ntoken_sha256 = "%s"\n' % ("0" * 64) * 2,
            "a is defined twice",
        ),
    ],
)
def test_invalid_users_file_error_names_the_path(text: str, complaint: str, tmp_path: Path) -> None:
    (tmp_path / "u").write_text(text, errors="surrogateescape")

    with pytest.raises(ConfigurationError, match=complaint) as caught:
        read_users(tmp_path / "u")
    assert all(problem.startswith("http.users: ") for problem in caught.value.problems)
