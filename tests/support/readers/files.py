"""Readers of files: those that programs keep for themselves, and those from users."""

from __future__ import annotations

import asyncio
import json
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any
from unittest.mock import patch
from zlib import crc32

import httpx
import typer
from typer.testing import CliRunner

from nena_cli import orders, zones
from nena_client import Client, RefusedError
from nena_conversations.broker import FreshHeaders, paced
from nena_conversations.recording import RecordingError, read_file
from nena_deploy.identities import SiteTopics
from nena_deploy.site import Site, SiteError
from nena_edge_agent.actions import builtin
from nena_edge_agent.actions.builtin import ZoneSetDownload
from nena_edge_agent.actions.plugin import WorkFailedError
from nena_edge_agent.doctor.broker import map_ids
from nena_edge_agent.download import DownloadSettings
from nena_edge_agent.extensions.maps.store import FolderMapStore
from nena_edge_agent.journal import Journal, UnreadableJournalError, record_of
from nena_edge_agent.nav2.session_control import SessionStore
from nena_edge_agent.nav2.settings import RosAddress, RosSettings
from nena_shared.fleet_api.base import Role
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.state import Map, MapStatus
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v3_0 import CODEC
from nena_shared.web.users import User, hash_of, read_users, write_users
from support.conversations import FOLDER
from support.damage import damaged_text
from support.plants import path, plant
from support.readers.reader import Make, NotTakenError, Place, Reader, of_file
from support.robot_core import Bench, action, order
from support.zones import transfer, zone

ROBOT = RobotKey("ACME", "1")
ZONES = CODEC.encode(
    transfer(zone("wall", "BLOCKED", 4, 6), zone("slow", "SPEED_LIMIT", 7, 9, maximum_speed=1))
)
ORDER = {
    "name": "T-1",
    "destinations": [{"locationName": "A", "operation": "Load"}],
    "deadline": "2030-01-01T00:00:00Z",
}


def users(place: Place) -> Reader:
    file = place.new() / "users.toml"
    write_users(
        file, [User(name=each, role=Role.ADMIN, token_sha256=hash_of(each)) for each in ("ann", "bob")]
    )
    read = of_file(file, lambda: read_users(file))
    return Reader(read, (file.read_bytes(),), (ConfigurationError,), damaged_text)


def _site(place: Place, name: str) -> tuple[Path, Path]:
    folder = place.new() / "site"
    topics, data = SiteTopics(), PurePosixPath("/var/lib/mosquitto")
    Site.new(folder, hosts=("broker.example",), port=8883, topics=topics, days=30, data_folder=data)
    return folder, folder / name


def site(place: Place) -> Reader:
    folder, file = _site(place, "site.json")
    return Reader(of_file(file, lambda: list(Site.open(folder))), (file.read_bytes(),), (SiteError,))


def certificate_of_a_site(place: Place) -> Reader:
    folder, file = _site(place, "authority/ca.pem")
    return Reader(of_file(file, lambda: Site.open(folder)), (file.read_bytes(),), (SiteError,), damaged_text)


def key_of_a_site(place: Place) -> Reader:
    folder, file = _site(place, "authority/ca-key.pem")
    return Reader(of_file(file, lambda: Site.open(folder)), (file.read_bytes(),), (SiteError,), damaged_text)


def _journal(place: Place) -> tuple[Path, Path]:
    folder, bench = place.new(), Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD")]}))
    journal = Journal(folder, ROBOT)
    journal.write(record_of(bench.core.memory()))
    (file,) = folder.iterdir()
    return folder, file


def journal_file(place: Place) -> Reader:
    folder, file = _journal(place)
    read = of_file(file, lambda: Journal(folder, ROBOT).read())
    return Reader(read, (file.read_bytes(),), (UnreadableJournalError,), damaged_text)


def journal_record(place: Place) -> Reader:
    """Read a record with a correct checksum and any content."""
    folder, file = _journal(place)

    def read(record: bytes) -> object:
        rest = b"1\n" + record
        half = b"%08x " % crc32(rest) + rest
        file.write_bytes(b" " * len(half) + half)
        return Journal(folder, ROBOT).read()

    memory = Journal(folder, ROBOT).read()
    assert memory is not None
    record = memory.model_dump_json(exclude_defaults=True).encode()
    return Reader(read, (record,), (UnreadableJournalError,))


def ros_session(place: Place) -> Reader:
    settings, kept, folder = RosSettings(namespace="/r1", domain_id=7), RosAddress("/r2", 9), place.new()
    store = SessionStore(folder, ROBOT)
    store.write(kept, settings)
    (file,) = folder.iterdir()

    def read() -> None:
        found = store.read(settings)
        assert isinstance(found, RosAddress)
        if found == RosAddress.of(settings):
            message = "as in the settings"
            raise NotTakenError(message)

    return Reader(of_file(file, read), (file.read_bytes(),), (NotTakenError,))


def enabled_map(place: Place) -> Reader:
    folder, first = place.new(), Map(map_id="hall", map_version="1", map_status=MapStatus.ENABLED)
    FolderMapStore(folder, first, maximum=5)
    (file,) = folder.rglob("enabled")
    read = of_file(file, lambda: FolderMapStore(folder, first, maximum=5).maps)
    return Reader(read, (file.read_bytes(),), spoiled=damaged_text)


def recording(place: Place) -> Reader:
    file, now = place.new() / "recording.jsonl", datetime.now(UTC)

    def read() -> None:
        headers = FreshHeaders()
        for _, entry in paced(read_file(file), 1.0):
            headers.apply(entry, now)

    lines = min(FOLDER.glob("3*.jsonl")).read_bytes().splitlines()[:5]
    return Reader(of_file(file, read), tuple(lines), (RecordingError,))


def zone_set_by_link(_place: Place) -> Reader:
    plugin = ZoneSetDownload(CODEC, DownloadSettings())
    wanted = action(
        "a", "NONE", plugin.declaration.action_type, zoneSetId="s1", zoneSetDownloadLink="http://192.0.2.1/"
    )

    def read(data: bytes) -> object:
        async def fetched(*_: object) -> bytes:
            return data

        with patch.object(builtin, "download", fetched):
            return asyncio.run(plugin._download_zone_set(wanted))

    return Reader(read, (ZONES, json.dumps(json.loads(ZONES)["zoneSet"]).encode()), (WorkFailedError,))


def _by_command(place: Place, app: typer.Typer, before: list[str], sample: bytes) -> Reader:
    """Read a file by a command of ``nena``; the order service refuses all that comes to it."""
    file, sent = place.new() / "given.json", []

    def call(_: Client, operation: object, name: str = "", *, body: Any, **_more: object) -> None:
        sent.append(httpx.Request("POST", "http://127.0.0.1", json=body))
        raise RefusedError(Problem(title="Conflict", status=409, detail=f"{operation} {name} has come"))

    def read() -> None:
        sent.clear()
        with patch.object(Client, "call", call):
            done = CliRunner().invoke(app, [*before, str(file)])
        if done.exception and not isinstance(done.exception, SystemExit):
            raise done.exception
        if not sent:
            raise NotTakenError(done.stderr)

    return Reader(of_file(file, read), (sample,), (NotTakenError,))


def zone_set_of_a_command(place: Place) -> Reader:
    sample = json.dumps(json.loads(ZONES)["zoneSet"]).encode()
    return _by_command(place, zones.app, ["put"], sample)


def order_of_a_command(place: Place) -> Reader:
    return _by_command(place, orders.app, ["create", "--file"], json.dumps(ORDER).encode())


def plant_at_the_doctor(_place: Place) -> Reader:
    return Reader(map_ids, (plant(path("A B")).to_json().encode(),))


FILES: dict[str, Make] = {
    "users": users,
    "site": site,
    "certificate of a site": certificate_of_a_site,
    "key of a site": key_of_a_site,
    "journal": journal_file,
    "record of a journal": journal_record,
    "ROS session": ros_session,
    "enabled map": enabled_map,
    "recording": recording,
    "zone set by link": zone_set_by_link,
    "zone set of a command": zone_set_of_a_command,
    "order of a command": order_of_a_command,
    "plant at the doctor": plant_at_the_doctor,
}
