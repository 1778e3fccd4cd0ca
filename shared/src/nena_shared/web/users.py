"""Users: names, roles and token hashes in a file.

Tokens have 256 random bits, so a single round of SHA-256 protects them; passwords are not supported. The file
is TOML with a table for each user::

    [[user]]
    name = "ann"
    role = "operator"
    token_sha256 = "9f86d0..."
"""

from __future__ import annotations

import hashlib
import hmac
import os
import re
import secrets
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from nena_shared import settings
from nena_shared.findings import in_words
from nena_shared.fleet_api.base import Role
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError
from nena_shared.web.settings import HttpSettings

log = get_logger(__name__)

NAME = re.compile(r"[A-Za-z0-9_.@-]{1,64}")
"""Allowed user names."""

TOKEN_PREFIX = "nena_"  # noqa: S105 - what secret scanners know our tokens by
TOKEN_BYTES = 32


def _read_role(value: object) -> object:
    return Role[value.upper()] if isinstance(value, str) and value.upper() in Role.__members__ else value


class User(BaseModel):
    """A user."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(pattern=f"^{NAME.pattern}$")
    role: Annotated[Role, BeforeValidator(_read_role)]
    token_sha256: str = Field(pattern=r"^[0-9a-f]{64}$")

    @property
    def known_as(self) -> str:
        """Unique identity."""
        return self.name


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    user: list[User] = []


def new_token() -> str:
    """Return a new random token."""
    return TOKEN_PREFIX + secrets.token_urlsafe(TOKEN_BYTES)


def hash_of(token: str) -> str:
    """Return the stored hash of a token."""
    return hashlib.sha256(token.encode()).hexdigest()


def users_of(settings: HttpSettings) -> UsersFile | None:
    """Return the users of a service; None: no login required.

    Raises:
        ConfigurationError: the users file is unusable.
    """
    if settings.users is None:
        return None
    if settings.first_user and (secret := make_first_user(settings.users)):
        log.warning("first user created: admin", token_file=str(secret))
    return UsersFile(settings.users)


def read_users(path: Path) -> tuple[User, ...]:
    """Read a users file; raises ConfigurationError if the file cannot be read or is invalid."""
    try:
        users = _File.model_validate(settings.parse_toml(path.read_bytes())).user
    except OSError as error:
        raise ConfigurationError([f"http.users: {path}: {error.strerror}"]) from error
    except settings.TomlError as error:
        raise ConfigurationError([f"http.users: {path} is not valid TOML: {error}"]) from error
    except ValidationError as error:
        problems = in_words(error.errors(), whole="the file")
        raise ConfigurationError([f"http.users: {path}: {problem}" for problem in problems]) from error
    names = [user.name for user in users]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ConfigurationError([f"http.users: {path}: {', '.join(sorted(twice))} is defined twice"])
    return tuple(users)


def write_users(path: Path, users: Iterable[User]) -> None:
    """Write a users file atomically, readable by its owner and group only."""
    lines = ["# Users of NeNa, written by `nena-deploy user`.\n"]
    for user in users:
        lines += ["\n[[user]]\n", f'name = "{user.name}"\n', f'role = "{user.role.name.lower()}"\n']
        lines += [f'token_sha256 = "{user.token_sha256}"\n']
    draft = path.with_name(f".{path.name}.new")
    # the group: services that run as dynamic users read the file through it
    _write_file(draft, "".join(lines), 0o640)
    if path.exists():  # a service that can read the old file must be able to read the new one
        kept = path.stat()
        os.chown(draft, kept.st_uid, kept.st_gid)
        draft.chmod(stat.S_IMODE(kept.st_mode))
    draft.replace(path)


def make_first_user(path: Path) -> Path | None:
    """Create the users file with one admin if it is missing; return the file with the token, else None.

    Programs that start at the same time create it only once.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    if path.exists():
        return None
    token, draft = new_token(), path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    token_file, secret = draft.with_name(f"{draft.name}.token"), path.with_name(f"{path.name}.token")
    try:
        write_users(draft, [User(name="admin", role=Role.ADMIN, token_sha256=hash_of(token))])
        _write_file(token_file, f"{token}\n", 0o600)
        # a link fails where the file exists; a rename would replace that of another program
        os.link(draft, path)
        token_file.replace(secret)
    except FileExistsError:
        return None
    except OSError as error:
        raise ConfigurationError([f"http.users: {path}: {error.strerror}"]) from error
    finally:
        draft.unlink(missing_ok=True)
        token_file.unlink(missing_ok=True)
    return secret


class UsersFile:
    """Users by token. Changes of the file apply at once, so a removed user is locked out immediately."""

    def __init__(self, path: Path) -> None:
        """Read the file.

        Raises:
            ConfigurationError: as in :func:`read_users`.
        """
        self._path = path
        self._seen = self._file_version()
        self._users = read_users(path)

    def user_of(self, token: str) -> User | None:
        """Return the user of a token, or None.

        Raises:
            ConfigurationError: the file has changed and is no longer valid.
        """
        if (stamp := self._file_version()) != self._seen:
            self._users = read_users(self._path)
            # only now: an invalid file is refused at each request, not only at the first
            self._seen = stamp
        wanted = hash_of(token)
        found = None
        for user in self._users:  # compare with all, in constant time
            if hmac.compare_digest(user.token_sha256, wanted):
                found = user
        return found

    def _file_version(self) -> tuple[int, int, int]:
        try:
            status = self._path.stat()
        except OSError:
            return (0, 0, 0)
        return (status.st_ino, status.st_mtime_ns, status.st_size)


def _write_file(path: Path, text: str, mode: int) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    with os.fdopen(os.open(path, flags, mode), "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        # before it takes the place of the old file: a crash must not leave an empty one
        os.fsync(file.fileno())
