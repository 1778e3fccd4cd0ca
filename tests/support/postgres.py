"""A real PostgreSQL for tests, with a separate data folder, reached by a socket in that folder."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import NullPool, create_engine, text

READY_SECONDS = 30


class Postgres:
    """A PostgreSQL server; it refuses to run as root, so as root it is given to the user `postgres`.

    ``fsync``: write each commit to the disk; tests do without.
    """

    def __init__(self, superuser: str = "nena", *, fsync: bool = False) -> None:
        self._superuser = superuser
        self._unsafe = () if fsync else ("-F",)
        self._programs = _programs()
        self._folder = Path(tempfile.mkdtemp(prefix="nena-test-postgres-"))
        self._user: dict[str, Any] = {}
        if os.geteuid() == 0:
            shutil.chown(self._folder, "postgres")
            self._user = {"user": "postgres"}
        self._run("initdb", "-A", "trust", "-U", superuser, "--no-sync", "-D", str(self._data))
        self.start()

    @property
    def url(self) -> str:
        """Where SQLAlchemy finds it."""
        return self.url_of(self._superuser, "postgres")

    def url_of(self, user: str, database: str) -> str:
        """Return where SQLAlchemy finds a database of it."""
        return f"postgresql+psycopg://{user}@/{database}?host={self._folder}"

    @property
    def environment(self) -> dict[str, str]:
        """What its own programs need to find it."""
        return {"PATH": f"{self._programs}:{os.environ['PATH']}", "PGHOST": str(self._folder)}

    @property
    def _data(self) -> Path:
        return self._folder / "data"

    def start(self) -> None:
        """Start the server and wait until it accepts connections."""
        options = " ".join((f"-k {self._folder} -h ''", *self._unsafe))
        log = str(self._folder / "log")
        self._run(
            "pg_ctl", "start", "-w", "-t", str(READY_SECONDS), "-D", str(self._data), "-l", log, "-o", options
        )

    def stop(self) -> None:
        """Stop the server at once."""
        self._run("pg_ctl", "stop", "-w", "-m", "immediate", "-D", str(self._data))

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Freeze the server, as on a stalled disk, while its connections stay open."""
        first = (self._data / "postmaster.pid").read_text().split()[0]
        children = Path(f"/proc/{first}/task/{first}/children").read_text().split()
        for each in (first, *children):
            os.kill(int(each), signal.SIGSTOP)
        try:
            yield
        finally:
            for each in (first, *children):
                os.kill(int(each), signal.SIGCONT)

    def empty(self) -> None:
        """Forget all tables."""
        with create_engine(self.url, poolclass=NullPool).begin() as connection:
            connection.execute(text("DROP SCHEMA public CASCADE"))
            connection.execute(text("CREATE SCHEMA public"))

    def close(self) -> None:
        """Stop the server and remove its files."""
        self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _run(self, program: str, *arguments: str) -> None:
        done = subprocess.run(
            [str(self._programs / program), *arguments],
            **self._user,
            cwd=self._folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE if program == "initdb" else subprocess.DEVNULL,
            timeout=60,
            check=False,
        )
        assert done.returncode == 0, f"{program}: {done.stderr!r}"


def _programs() -> Path:
    pytest.importorskip(
        "psycopg", reason="the driver is not there: pip install nena-status-aggregator[postgresql]"
    )
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    path = shutil.which("initdb") or (str(found[-1]) if found else None)
    if path is None:
        pytest.skip("PostgreSQL is not there: apt-get install postgresql")
    return Path(path).resolve().parent
