"""A site's folder: the authority, the broker's files, and a folder for each identity."""

from __future__ import annotations

import fcntl
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Self

from cryptography.exceptions import UnsupportedAlgorithm
from pydantic import BaseModel, ConfigDict, ValidationError

from nena_deploy.authority import Authority, Pair, utc_now, write_secret
from nena_deploy.identities import Identity, IdentityError, Kind, SiteTopics, access_list
from nena_shared.misfits import in_words, shortened

PATIENCE = 30.0
"""Seconds that another run may take."""
LOOK_EVERY = 0.05


class BusyError(Exception):
    """Another run does not come to its end; the text says what to do."""


@contextmanager
def alone(path: Path, *, patience: float = PATIENCE) -> Iterator[None]:
    """Keep other runs away from ``path``, a file or a folder, until the block ends.

    Raises:
        BusyError: another one has it for longer than ``patience`` seconds.

    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = path.with_name(f".{path.name}.lock")
    with lock.open("a") as file:
        _take(file.fileno(), path, time.monotonic() + patience)
        yield


def _take(descriptor: int, path: Path, end: float) -> None:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                message = f"another nena-deploy works on {path}: wait for it, or end it."
                raise BusyError(message) from None
            time.sleep(LOOK_EVERY)
        else:
            return


TEMPLATE = """\
# Made by nena-deploy. Clients are known by their certificates; what each may do is in access.list.
listener {port}
cafile {folder}/ca.pem
certfile {folder}/broker.pem
keyfile {folder}/broker-key.pem
crlfile {folder}/revoked.pem
tls_version tlsv1.2
require_certificate true
use_identity_as_username true
allow_anonymous false
acl_file {folder}/access.list

# What one client may cost the others. The longest message is the model of a large plant.
max_packet_size 67108864
max_inflight_messages 200
max_queued_messages 10000
max_connections 5000
max_keepalive 120
set_tcp_nodelay true

persistence true
persistence_location {data}/
autosave_interval 30
log_dest stdout
"""


def broker_configuration(folder: PurePosixPath, data: PurePosixPath, port: int) -> str:
    """Write the configuration; ``folder``: where the broker finds its files, ``data``: where it writes."""
    return TEMPLATE.format(folder=folder, data=data, port=port)


SERVICES = (Kind.ORDER_SERVICE, Kind.STATUS_AGGREGATOR)

SETTINGS = """\
# Settings of {name} for the broker: add them to its own, or name this file with --config.
[mqtt]
host = "{host}"
port = {port}

[mqtt.tls]
ca = "{folder}/ca.pem"
certificate = "{folder}/certificate.pem"
key = "{folder}/key.pem"
"""


class SiteError(Exception):
    """A folder is no site, or is one already; the text says what to do."""


class _Register(BaseModel):
    """What a site knows of itself; in ``site.json``."""

    model_config = ConfigDict(extra="forbid")

    hosts: tuple[str, ...]
    port: int
    topics: SiteTopics
    identities: list[Identity] = []
    revoked: list[int] = []


class Site:
    """What has been made for a site; each change is written at once."""

    def __init__(self, folder: Path, register: _Register, authority: Authority) -> None:
        self.folder = folder
        self._register = register
        self._authority = authority

    @classmethod
    def new(
        cls,
        folder: Path,
        *,
        hosts: tuple[str, ...],
        port: int,
        topics: SiteTopics,
        days: int,
        broker_folder: PurePosixPath | None = None,
        data_folder: PurePosixPath,
    ) -> Self:
        """Make a site with its broker and its services.

        Args:
            folder: is made; its key of the authority has to be kept safe.
            hosts: names and addresses under which clients reach the broker.
            port: the broker's TCP port.
            topics: first levels of the topics.
            days: how long certificates are good.
            broker_folder: where the broker will find its files; None: where they are made.
            data_folder: where the broker keeps retained messages.

        Raises:
            SiteError: there is something at that place, or a host is neither a name nor an address.

        """
        if folder.exists() and any(folder.iterdir()):
            message = f"{folder} is not empty: name a new folder."
            raise SiteError(message)
        broker = folder / "broker"
        authority, server = _certify(hosts, days)
        for each in (folder, broker, folder / "authority"):
            each.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o750)
        (folder / "authority").chmod(0o700)
        (folder / "authority" / "ca.pem").write_bytes(authority.pem)
        write_secret(folder / "authority" / "ca-key.pem", authority.key_pem())
        (broker / "ca.pem").write_bytes(authority.pem)
        (broker / "broker.pem").write_bytes(server.certificate)
        write_secret(broker / "broker-key.pem", server.key)
        shown = broker_folder or PurePosixPath(broker.absolute())
        (broker / "mosquitto.conf").write_text(broker_configuration(shown, data_folder, port))
        site = cls(folder, _Register(hosts=hosts, port=port, topics=topics), authority)
        for kind in SERVICES:
            site.add(kind, kind, days=days)
        return site

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Read a site.

        Raises:
            SiteError: the folder is none.

        """
        try:
            register = _Register.model_validate_json((folder / "site.json").read_bytes())
            authority = Authority.load(folder / "authority" / "ca.pem", folder / "authority" / "ca-key.pem")
        except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
            message = (
                f"{folder} is no site of nena-deploy ({_reason(error)}). Make one with `nena-deploy init`."
            )
            raise SiteError(message) from error
        return cls(folder, register, authority)

    def __iter__(self) -> Iterator[Identity]:
        """Give all identities."""
        return iter(self._register.identities)

    def folder_of(self, identity: Identity) -> Path:
        """Tell where an identity's files are."""
        return self.folder / identity.folder

    def add(self, kind: Kind, name: str, *, days: int) -> Path:
        """Give somebody an identity; who has one gets a new certificate, and the old one counts no more.

        Gives the folder to bring there: certificate, key, the authority's certificate, settings.
        """
        pair = self._authority.for_client(name, utc_now(), days)
        identity = Identity(kind=kind, name=name, certificate=pair.serial_number)
        self._drop(kind, name)
        self._register.identities.append(identity)
        folder = self.folder_of(identity)
        folder.mkdir(parents=True, exist_ok=True)
        self._fill(folder, identity, pair)
        self._save()
        return folder

    def remove(self, kind: Kind, name: str) -> None:
        """Take an identity back: its certificate, its rights and its files.

        Raises:
            IdentityError: there is none of this name.

        """
        identity = self._drop(kind, name)
        if identity is None:
            message = f"There is no {kind} {name}. `nena-deploy list` shows who there is."
            raise IdentityError(message)
        shutil.rmtree(self.folder_of(identity), ignore_errors=True)
        self._save()

    def _drop(self, kind: Kind, name: str) -> Identity | None:
        found = next((each for each in self if (each.kind, each.name) == (kind, name)), None)
        if found:
            self._register.identities.remove(found)
            self._register.revoked.append(found.certificate)
        return found

    def _fill(self, folder: Path, identity: Identity, pair: Pair) -> None:
        (folder / "ca.pem").write_bytes(self._authority.pem)
        (folder / "certificate.pem").write_bytes(pair.certificate)
        write_secret(folder / "key.pem", pair.key)
        host, port = self._register.hosts[0], self._register.port
        text = SETTINGS.format(name=identity.name, host=host, port=port, folder="/etc/nena")
        (folder / "mqtt.toml").write_text(text)

    def _save(self, now: datetime | None = None) -> None:
        """Write what the broker reads, then what we read: a change that was cut off is made again."""
        broker = self.folder / "broker"
        revoked = self._authority.revocations(self._register.revoked, now or utc_now())
        _replace(broker / "access.list", access_list(self, self._register.topics).encode())
        _replace(broker / "revoked.pem", revoked)
        _replace(self.folder / "site.json", self._register.model_dump_json(indent=2).encode())


def _reason(error: Exception) -> str:
    """Say in a line why a site cannot be read."""
    if isinstance(error, ValidationError):
        return f"site.json: {in_words(error.errors()[:1], whole='all of it')[0]}"
    return shortened(str(error))


def _replace(path: Path, content: bytes) -> None:
    draft = path.with_name(f".{path.name}.new")
    draft.write_bytes(content)
    draft.replace(path)


def _certify(hosts: tuple[str, ...], days: int) -> tuple[Authority, Pair]:
    """Make an authority, and have it vouch for the broker."""
    now = utc_now()
    try:
        authority = Authority.new(f"NeNa at {hosts[0]}", now)
        return authority, authority.for_server(hosts, now, days)
    except ValueError as error:
        message = f"--host {' --host '.join(hosts)}: {error}. Give names in ASCII (xn--...), or addresses."
        raise SiteError(message) from error
