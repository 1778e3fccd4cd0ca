"""A site's folder: the CA, the broker's files, and a folder for each identity."""

from __future__ import annotations

import asyncio
import fcntl
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path, PurePosixPath
from secrets import token_hex
from tempfile import TemporaryDirectory
from typing import Self

from cryptography.exceptions import UnsupportedAlgorithm
from pydantic import BaseModel, ConfigDict, ValidationError

from nena_deploy.authority import Authority, Pair, serial_number, utc_now, write_secret
from nena_deploy.identities import (
    Identity,
    IdentityError,
    Kind,
    SiteTopics,
    access_list,
    topics_of_robot,
)
from nena_shared.findings import in_words, shortened
from nena_shared.mqtt import Outbound
from nena_shared.mqtt.client import Client, MqttError
from nena_shared.settings import MqttSettings, MqttTlsSettings
from nena_shared.vda5050.topics import RobotKey

LOCK_TIMEOUT = 30.0
"""Maximum wait for another run, seconds."""
LOCK_RETRY = 0.05


class BusyError(Exception):
    """Another run does not end; the message says what to do."""


@contextmanager
def locked(path: Path, *, timeout: float = LOCK_TIMEOUT) -> Iterator[None]:
    """Lock ``path``, a file or a folder, against other runs until the block ends.

    Raises:
        BusyError: another run holds the lock for longer than ``timeout`` seconds.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Beside `path`, which may not exist yet, and which a change may replace together with its lock.
    lock = path.with_name(f".{path.name}.lock")
    with lock.open("a") as file:
        _take_lock(file.fileno(), path, time.monotonic() + timeout)
        yield


def _take_lock(descriptor: int, path: Path, end: float) -> None:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                raise BusyError(f"Another nena-deploy is using {path}. Wait for it or stop it.") from None
            time.sleep(LOCK_RETRY)
        else:
            return


TEMPLATE = """\
# Created by nena-deploy. Clients authenticate by certificate; access.list holds their rights.
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

# Limits for each client. The longest message is the model of a large plant.
max_packet_size {longest}
max_inflight_messages 200
# A service that starts receives at once what is retained of 10,000 robots and 10,000 orders.
max_queued_messages 50000
max_queued_bytes 134217728
max_connections 11000
max_keepalive 120
set_tcp_nodelay true

# Retained messages of clients without rights, such as removed robots, are not delivered.
check_retain_source true
# Bytes of all clients together: beyond them the broker refuses messages instead of ending for lack of memory.
memory_limit 1073741824

persistence true
persistence_location {data}/
autosave_interval 30
log_dest stdout
"""


LONGEST_MESSAGE = 16
"""Default maximum message size, MiB; a plant model of 10,000 points has 15 MB."""


def broker_configuration(folder: PurePosixPath, data: PurePosixPath, port: int, longest: int) -> str:
    """Return the broker's configuration file.

    Args:
        folder: folder of the broker's files.
        data: folder of the broker's data.
        port: TCP port of the broker.
        longest: maximum message size, MiB.
    """
    return TEMPLATE.format(folder=folder, data=data, port=port, longest=longest * 1024 * 1024)


BROKER_TIMEOUT = 5.0
"""Timeout for the broker, seconds."""
SERVICES = (Kind.ORDER_SERVICE, Kind.STATUS_AGGREGATOR)

SETTINGS = """\
# Broker settings of {name}: add them to its settings file, or pass this file with --config.
[mqtt]
host = "{host}"
port = {port}

[mqtt.tls]
ca = "{folder}/ca.pem"
certificate = "{folder}/certificate.pem"
key = "{folder}/key.pem"
"""


class SiteError(Exception):
    """A folder is not a site, or is already in use; the message says what to do."""


class BrokerError(Exception):
    """The broker cannot be reached, for the reason in the message."""


class _Register(BaseModel):
    """Contents of ``site.json``."""

    model_config = ConfigDict(extra="forbid")

    hosts: tuple[str, ...]
    port: int
    topics: SiteTopics
    identities: list[Identity] = []
    revoked: list[int] = []


class Site:
    """A site in its folder; each change is written immediately."""

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
        longest_message: int = LONGEST_MESSAGE,
    ) -> Self:
        """Create a site with its broker and its services.

        Args:
            folder: folder to create; keep the CA key in it secret.
            hosts: host names and IP addresses of the broker.
            port: the broker's TCP port.
            topics: first levels of the topics.
            days: validity of certificates.
            broker_folder: folder of the files on the broker's machine; None: where they are created.
            data_folder: folder for the broker's data.
            longest_message: maximum message size that the broker accepts, MiB.

        Raises:
            SiteError: the folder is not empty, or a host is neither a name nor an address.
        """
        if folder.exists() and any(folder.iterdir()):
            raise SiteError(f"{folder} is not empty. Choose a new folder.")
        broker = folder / "broker"
        authority, server = _create_authority(hosts, days)
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
        (broker / "mosquitto.conf").write_text(
            broker_configuration(shown, data_folder, port, longest_message)
        )
        site = cls(folder, _Register(hosts=hosts, port=port, topics=topics), authority)
        for kind in SERVICES:
            site.add(kind, kind, days=days)
        return site

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Open a site; raises SiteError if the folder is not a site."""
        try:
            register = _Register.model_validate_json((folder / "site.json").read_bytes())
            authority = Authority.load(folder / "authority" / "ca.pem", folder / "authority" / "ca-key.pem")
        except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
            reason = _reason_of(error)
            raise SiteError(
                f"{folder} is not a nena-deploy site ({reason}). Create one with `nena-deploy init`."
            ) from error
        return cls(folder, register, authority)

    def __iter__(self) -> Iterator[Identity]:
        """Iterate over all identities."""
        return iter(self._register.identities)

    def folder_of(self, identity: Identity) -> Path:
        """Return the folder of an identity's files."""
        return self.folder / identity.folder

    def add(self, kind: Kind, name: str, *, days: int) -> Path:
        """Create an identity, or replace its certificate and revoke the old one.

        Returns the folder to copy to that machine: certificate, key, CA certificate, settings.
        """
        pair = self._authority.for_client(name, utc_now(), days)
        identity = Identity(kind=kind, name=name, certificate=pair.serial_number)
        self._drop_identity(kind, name)
        self._register.identities.append(identity)
        folder = self.folder_of(identity)
        folder.mkdir(parents=True, exist_ok=True)
        self._fill_folder(folder, identity, pair)
        self._save_register()
        return folder

    def certify_https(self, service: Kind, hosts: tuple[str, ...], *, days: int) -> Path:
        """Create the certificate with which a service serves HTTPS; return its folder.

        An older one is replaced and revoked.

        Raises:
            SiteError: a host is neither a name nor an address.
        """
        try:
            pair = self._authority.for_server(hosts, utc_now(), days)
        except ValueError as error:
            raise SiteError(_no_host(hosts, error)) from error
        folder = self.folder / "https" / service
        folder.mkdir(parents=True, exist_ok=True)
        if (replaced := folder / "certificate.pem").exists():
            self._register.revoked.append(serial_number(replaced))
            self._save_register()
        self._write_pair(folder, pair)
        return folder

    async def clear(self, robot: RobotKey) -> None:
        """Clear the broker's retained messages of ``robot``, with a one-time certificate of the same name.

        Raises:
            BrokerError: the broker cannot be reached, or does not confirm.
        """
        # Of the robot's name: the access list lets nobody else write most of its topics.
        pair = self._authority.for_client(str(robot), utc_now(), 1)
        # Before its use: remove() then revokes it even if the broker does not confirm.
        self._register.revoked.append(pair.serial_number)
        with TemporaryDirectory() as draft:
            folder = Path(draft)
            (folder / "certificate.pem").write_bytes(pair.certificate)
            write_secret(folder / "key.pem", pair.key)
            tls = MqttTlsSettings(
                ca=self.folder / "broker" / "ca.pem",
                certificate=folder / "certificate.pem",
                key=folder / "key.pem",
            )
            broker = MqttSettings(host=self._register.hosts[0], port=self._register.port, tls=tls)
            await _clear_topics(broker, topics_of_robot(robot, self._register.topics))

    def remove(self, kind: Kind, name: str) -> None:
        """Remove an identity: revoke its certificate, delete its rights and files.

        Raises:
            IdentityError: unknown identity.
        """
        identity = self.require(kind, name)
        self._drop_identity(kind, name)
        shutil.rmtree(self.folder_of(identity), ignore_errors=True)
        self._save_register()

    def require(self, kind: Kind, name: str) -> Identity:
        """Return an identity.

        Raises:
            IdentityError: unknown identity.
        """
        identity = self._find_identity(kind, name)
        if identity is None:
            raise IdentityError(f"No {kind} {name}. `nena-deploy list` shows all identities.")
        return identity

    def _find_identity(self, kind: Kind, name: str) -> Identity | None:
        return next((each for each in self if (each.kind, each.name) == (kind, name)), None)

    def _drop_identity(self, kind: Kind, name: str) -> None:
        if found := self._find_identity(kind, name):
            self._register.identities.remove(found)
            self._register.revoked.append(found.certificate)

    def _fill_folder(self, folder: Path, identity: Identity, pair: Pair) -> None:
        self._write_pair(folder, pair)
        host, port = self._register.hosts[0], self._register.port
        text = SETTINGS.format(name=identity.name, host=host, port=port, folder="/etc/nena")
        (folder / "mqtt.toml").write_text(text)

    def _write_pair(self, folder: Path, pair: Pair) -> None:
        (folder / "ca.pem").write_bytes(self._authority.pem)
        (folder / "certificate.pem").write_bytes(pair.certificate)
        write_secret(folder / "key.pem", pair.key)

    def _save_register(self) -> None:
        """Write the broker's files before our own, so that an interrupted change can be repeated."""
        broker = self.folder / "broker"
        revoked = self._authority.revocations(self._register.revoked, utc_now())
        _replace_file(broker / "access.list", access_list(self, self._register.topics).encode())
        _replace_file(broker / "revoked.pem", revoked)
        _replace_file(self.folder / "site.json", self._register.model_dump_json(indent=2).encode())


async def _clear_topics(broker: MqttSettings, topics: Iterable[str]) -> None:
    confirmations: list[asyncio.Future[None]] = []
    try:
        async with (
            asyncio.timeout(BROKER_TIMEOUT),
            Client(broker, f"nena-deploy-{token_hex(8)}", timeout=BROKER_TIMEOUT) as client,
        ):
            for topic in topics:
                confirmed = asyncio.get_running_loop().create_future()
                client.send(Outbound(topic, b"", qos=1, retain=True), partial(confirmed.set_result, None))
                confirmations.append(confirmed)
            receiving = asyncio.ensure_future(client.receive(lambda _: None))
            confirming = asyncio.gather(*confirmations)
            try:
                await asyncio.wait((receiving, confirming), return_when=asyncio.FIRST_COMPLETED)
                if receiving.done():
                    await receiving
            finally:
                receiving.cancel()
                confirming.cancel()
    except (MqttError, OSError) as error:
        raise BrokerError(str(error) or "it does not answer") from error


def _reason_of(error: Exception) -> str:
    """Return in one line why a site cannot be read."""
    if isinstance(error, ValidationError):
        return f"site.json: {in_words(error.errors()[:1], whole='all of it')[0]}"
    return shortened(str(error))


def _replace_file(path: Path, content: bytes) -> None:
    # Renaming is atomic: a broker that reloads meanwhile never reads half a list.
    draft = path.with_name(f".{path.name}.new")
    draft.write_bytes(content)
    draft.replace(path)


def _create_authority(hosts: tuple[str, ...], days: int) -> tuple[Authority, Pair]:
    """Create a CA and the broker's certificate."""
    now = utc_now()
    try:
        authority = Authority.new(f"NeNa at {hosts[0]}", now)
        return authority, authority.for_server(hosts, now, days)
    except ValueError as error:
        raise SiteError(_no_host(hosts, error)) from error


def _no_host(hosts: tuple[str, ...], error: ValueError) -> str:
    return f"--host {' --host '.join(hosts)}: {error}. Use ASCII names (xn--...) or IP addresses."
