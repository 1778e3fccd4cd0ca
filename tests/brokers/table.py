"""Write docs/brokers.md: the figures of the last ``make brokers-test``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from brokers.figures import ROWS, Column, read_all
from support.markdown import row

DOCUMENT = Path(__file__).parents[2] / "docs" / "brokers.md"
TEXT = Path(__file__).with_name("page.md")
KNOWN = ("Mosquitto", "RabbitMQ", "NATS", "ejabberd", "ActiveMQ", "Aedes", "EMQX", "HiveMQ", "VerneMQ")
ABOUT = {"date": "date of the run", "load": "load of the machine at its end"}


def document(found: Mapping[str, Column]) -> str:
    """Return the text of the page."""
    return TEXT.read_text(encoding="utf-8").replace("{table}", "\n".join(_table(found)))


def _table(found: Mapping[str, Column]) -> Iterator[str]:
    names = [*KNOWN, *(each for each in found if each not in KNOWN)]
    yield row(["step", *names])
    yield row(["---"] * (len(names) + 1))
    for key, text in (ROWS | ABOUT).items():
        yield row([text, *(found.get(name, {}).get(key, "not run") for name in names)])


if __name__ == "__main__":
    DOCUMENT.write_text(document(read_all()), encoding="utf-8")
