"""Stores that are backed up, destroyed and restored by the commands of `docs/operations.md`."""

from __future__ import annotations

import os
import subprocess
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from sqlalchemy import NullPool, create_engine, text

from support.guides import DOCS, commands
from support.postgres import Postgres
from support.waiting import PATIENCE


class Keeper(ABC):
    """A store that can be backed up, destroyed and restored."""

    url: str

    @abstractmethod
    def back_up(self) -> None: ...

    @abstractmethod
    def destroy(self) -> None: ...

    @abstractmethod
    def restore(self) -> None: ...


class SqliteKeeper(Keeper):
    """A SQLite file; the guide's steps for orders apply to the history as well."""

    def __init__(self, folder: Path, file: str = "orders.db") -> None:
        self._folder, copies = folder / "store", folder / "backup"
        for each in (self._folder, copies):
            each.mkdir()
        # the order counts: the name of the file stands behind each folder
        self._places = {
            "/var/lib/nena/order-service": self._folder,
            "/backup/": f"{copies}/",
            "orders.db": file,
        }
        self.url = f"sqlite:///{self._folder / file}"

    def back_up(self) -> None:
        carry_out("deploy/backup /var", self._places)

    def destroy(self) -> None:
        """Make the files unreadable, also those beside the store."""
        for each in self._folder.iterdir():
            each.write_bytes(b"no database at all" * 100)

    def restore(self) -> None:
        carry_out("cp /backup/", self._places)


class PostgresKeeper(Keeper):
    """A database of a server."""

    def __init__(self, server: Postgres, copies: Path) -> None:
        self._server, self._places = server, {"/backup": copies}
        self._where = {"PGHOST": server.url.rpartition("host=")[2], "PGUSER": "nena"}
        self.destroy()
        self._sql("CREATE DATABASE nena")
        self.url = server.url.replace("/postgres?", "/nena?")

    def back_up(self) -> None:
        carry_out("pg_dump --format=custom --file", self._places, self._where)

    def destroy(self) -> None:
        self._sql("DROP DATABASE IF EXISTS nena WITH (FORCE)")

    def restore(self) -> None:
        carry_out("createdb nena &&", self._places, self._where)

    def _sql(self, statement: str) -> None:
        engine = create_engine(self._server.url, poolclass=NullPool, isolation_level="AUTOCOMMIT")
        with engine.connect() as connection:
            connection.execute(text(statement))


def carry_out(
    holding: str, places: Mapping[str, object], environment: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Run the block of commands that holds a text, with ``places`` of a test for those of a site."""
    script = commands("operations.md", holding)
    for place, here in places.items():
        assert place in script, f"{place} is not in the commands of the guide:\n{script}"
        script = script.replace(place, str(here))
    done = subprocess.run(
        ["bash", "-euc", script],
        cwd=DOCS.parent,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, f"{script}\n{done.stderr}"
