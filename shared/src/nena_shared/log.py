"""Structured logging to standard error: keys and values, for people or as JSON lines."""

from __future__ import annotations

import logging
import sys
from collections import deque
from contextlib import suppress
from typing import TextIO, cast

import structlog
from structlog.typing import EventDict, FilteringBoundLogger, Processor, WrappedLogger

from nena_shared.settings import LogSettings

COMMON: tuple[Processor, ...] = (
    structlog.contextvars.merge_contextvars,
    structlog.processors.add_log_level,
    structlog.processors.TimeStamper(fmt="iso", utc=True),
    structlog.processors.StackInfoRenderer(),
    structlog.processors.format_exc_info,
)
"""What is done with each line before it is written out."""
_FIRST = ("timestamp", "level", "event")


CONTROLS = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\t\n"}
"""What steers a terminal, and how it is written instead; the renderer sees to ends of lines in values."""

KEPT = 2000
"""Lines of the log that a process remembers."""
_recent: deque[str] = deque(maxlen=KEPT)


def recent_lines() -> list[str]:
    """Return the newest lines that were logged, oldest first, as plain text."""
    return list(_recent)


class _Patient:
    """A stream that loses a line where the disk is full, and does not end the program for it."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError):
            return self._stream.write(text)
        return 0

    def flush(self) -> None:
        with suppress(OSError):
            self._stream.flush()


def get_logger(name: str) -> FilteringBoundLogger:
    """Return the logger of a module; bind ids to it with ``.bind(robot=..., order=...)``."""
    return cast("FilteringBoundLogger", structlog.get_logger(module=name))


def configure(settings: LogSettings, stream: TextIO | None = None) -> None:
    """Set up logging of this process, once, before the first line is logged."""
    out = stream or sys.stderr
    level = logging.getLevelNamesMapping()[settings.level.upper()]
    rendering = _rendering(settings, colours=out.isatty())
    structlog.configure(
        processors=[*COMMON, _remember, *rendering],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.PrintLoggerFactory(cast("TextIO", _Patient(out))),
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(out)
    handler.setFormatter(_formatter_for_libraries(rendering))
    logging.basicConfig(level=level, handlers=[handler], force=True)


def _rendering(settings: LogSettings, *, colours: bool) -> tuple[Processor, ...]:
    if settings.form == "json":
        return (structlog.processors.JSONRenderer(),)
    renderer = structlog.dev.ConsoleRenderer(
        colors=colours, exception_formatter=structlog.dev.plain_traceback
    )
    return _without_controls, renderer


def _formatter_for_libraries(rendering: tuple[Processor, ...]) -> logging.Formatter:
    """Return a formatter that writes the standard library's log lines in the form of our own."""
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[_name_module, *COMMON],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, _remember, *rendering],
    )


def _remember(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    """Keep the line for a log report, before it is rendered."""
    rest = " ".join(f"{key}={value}" for key, value in event.items() if key not in _FIRST)
    _recent.append(" ".join((*(str(event.get(key, "")) for key in _FIRST), rest)).strip())
    return event


def _without_controls(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    """Remove control characters from texts of robots and hosts: they could affect a terminal."""
    for key, value in event.items():
        if isinstance(value, str):
            event[key] = value.translate(CONTROLS)
    return event


def _name_module(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    event["module"] = event["_record"].name
    return event
