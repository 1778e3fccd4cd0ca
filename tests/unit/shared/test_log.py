from __future__ import annotations

import errno
import io
import json
import logging
import os
import re

import pytest
import structlog

from nena_shared import log
from nena_shared.settings import LogSettings


def lines(out: io.StringIO) -> list[dict[str, str]]:
    return [json.loads(line) for line in out.getvalue().splitlines()]


def test_json_lines_hold_event_level_module_time_and_keys() -> None:
    out = io.StringIO()
    log.configure(LogSettings(form="json"), out)

    log.get_logger("nena.example").bind(robot="r1").warning("stopped", order="o1")

    (line,) = lines(out)
    assert line.pop("timestamp").endswith("Z")
    assert line == {
        "event": "stopped",
        "level": "warning",
        "module": "nena.example",
        "robot": "r1",
        "order": "o1",
    }


def test_urls_of_requests_are_not_logged() -> None:
    out = io.StringIO()
    log.configure(LogSettings(level="info"), out)

    logging.getLogger("httpx").info("HTTP Request: POST http://user:secret@host/")

    assert out.getvalue() == ""


def test_libraries_log_in_the_same_form() -> None:
    out = io.StringIO()
    log.configure(LogSettings(form="json"), out)

    logging.getLogger("library").warning("%d pending", 3)
    logging.getLogger("library").debug("not this")

    (line,) = lines(out)
    assert (line["event"], line["level"], line["module"]) == ("3 pending", "warning", "library")


@pytest.mark.parametrize("source", ["own", "library"])
@pytest.mark.parametrize("form", ["json", "text"])
def test_failures_are_logged_with_their_trace(form: str, source: str) -> None:
    out = io.StringIO()
    log.configure(LogSettings.model_validate({"form": form}), out)
    logger = log.get_logger("example") if source == "own" else logging.getLogger("library")
    try:
        int("why")
    except ValueError:
        logger.exception("failed")

    assert "failed" in out.getvalue()
    assert "ValueError: " in out.getvalue()
    if form == "json":
        assert "ValueError: " in lines(out)[0]["exception"]


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"robot": "NeNa/r1", "n": 3, "empty": "", "none": None, "list": ["a b"]},
        {"reason": "two words", "quotes": "it's", "equals": "a=b", "lines": "one\ntwo"},
        {"exception": "Traceback\n  ValueError: why"},
    ],
)
@pytest.mark.parametrize("event", ["short", "an event whose text is longer than its column is wide"])
def test_plain_text_is_that_of_structlog(event: str, values: dict[str, object]) -> None:
    line = {"timestamp": "2026-11-23T12:00:00Z", "level": "info", "event": event, **values}
    renderer = structlog.dev.ConsoleRenderer(colors=False)

    assert log.in_plain_text(None, "info", dict(line)) == renderer(None, "info", dict(line))


@pytest.mark.parametrize("source", ["own", "library"])
def test_control_characters_are_escaped(source: str) -> None:
    out = io.StringIO()
    log.configure(LogSettings(), out)
    if source == "own":
        log.get_logger("example").info("refused", robot="r1\x1b[2J", reason="\x9b31mgone\nnow")
    else:
        logging.getLogger("library").warning("refused %s", "r1\x1b[2J\x9b31mgone\nnow")

    assert r"r1\x1b[2J" in out.getvalue()
    assert r"\x9b31mgone" in out.getvalue()
    assert not {"\x1b", "\x9b"} & set(out.getvalue())
    assert out.getvalue().count("\n") == (1 if source == "own" else 2)


def test_recent_lines_are_kept() -> None:
    log.configure(LogSettings(form="json"), io.StringIO())

    log.get_logger("example").info("one", robot="r1")
    logging.getLogger("library").warning("two")

    one, two = log.recent_lines()[-2:]
    assert re.fullmatch(r"\S+Z \[info     \] one +module=example robot=r1", one)
    assert re.fullmatch(r"\S+Z \[warning  \] two +module=library", two)
    for number in range(log.KEPT + 1):
        log.get_logger("example").info(str(number))
    assert len(log.recent_lines()) == log.KEPT
    assert re.search(r"\] 1 +module=example$", log.recent_lines()[0])


def test_a_log_on_a_full_disk_does_not_end_the_program() -> None:
    class Full(io.StringIO):
        def write(self, _: str) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        def flush(self) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    log.configure(LogSettings(), Full())
    log.get_logger("a").info("lost", robot="r1")

    assert "lost" in log.recent_lines()[-1]
