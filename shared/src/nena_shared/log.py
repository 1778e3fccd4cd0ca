"""Structured logging to standard error, as text or JSON lines."""

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
"""Processors applied to each line before rendering."""

# 127 to 159, too: terminals take some of them for the beginning of an escape sequence
CONTROLS = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\t\n"}
"""Escape sequences that replace control characters; the renderer escapes line breaks in values."""

KEPT = 2000
"""Number of log lines kept in memory."""
_recent: deque[str] = deque(maxlen=KEPT)


def recent_lines() -> list[str]:
    """Return the most recent log lines as plain text, oldest first."""
    return list(_recent)


class _Output:
    """Writes lines to a stream, and drops them when the disk is full, instead of ending the program."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, line: str) -> None:
        """Write a line."""
        with suppress(OSError):
            self._stream.write(f"{line}\n")
            self._stream.flush()

    debug = info = warning = error = critical = write


def get_logger(name: str) -> FilteringBoundLogger:
    """Return the logger of a module; bind context with ``.bind(robot=..., order=...)``."""
    return cast("FilteringBoundLogger", structlog.get_logger(module=name))


def configure(settings: LogSettings, stream: TextIO | None = None) -> None:
    """Configure logging of this process. Call it once, before anything is logged."""
    out = stream or sys.stderr
    level = logging.getLevelNamesMapping()[settings.level.upper()]
    rendering, output = _make_renderer(settings, colours=out.isatty()), _Output(out)
    structlog.configure(
        processors=[*COMMON, *rendering],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=lambda: output,
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(out)
    handler.setFormatter(_formatter_for_libraries(rendering))
    logging.basicConfig(level=level, handlers=[handler], force=True)
    logging.getLogger("httpx").setLevel(logging.WARNING)  # it logs each URL, which may contain a secret


def _make_renderer(settings: LogSettings, *, colours: bool) -> tuple[Processor, ...]:
    if settings.form == "json":
        return _remember_event, structlog.processors.JSONRenderer()
    if not colours:
        return (_remembered_line,)
    renderer = structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)
    return _remember_event, _without_controls, renderer


def _formatter_for_libraries(rendering: tuple[Processor, ...]) -> logging.Formatter:
    """Return a formatter that formats the standard library's log records like our own."""
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[_name_module, *COMMON],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *rendering],
    )


def _remembered_line(logger: WrappedLogger, method: str, event: EventDict) -> str:
    """Write a line as plain text, and store it for :func:`recent_lines`."""
    line = in_plain_text(logger, method, event)
    _recent.append(line)
    return line


def _remember_event(logger: WrappedLogger, method: str, event: EventDict) -> EventDict:
    """Store the line of an event that is written in another form."""
    # a copy: writing it as plain text empties it
    _remembered_line(logger, method, dict(event))
    return event


def _without_controls(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    """Escape control characters in texts of robots and hosts, which could manipulate a terminal."""
    for key, value in event.items():
        if isinstance(value, str):
            event[key] = _escape_controls(value)
    return event


def _escape_controls(text: str) -> str:
    return text if text.isprintable() else text.translate(CONTROLS)


QUOTED = frozenset(" \t\r\n='\"")
"""Characters for which a value is written in quotes."""


def in_plain_text(_logger: WrappedLogger, _method: str, event: EventDict) -> str:
    """Write a line as structlog's ConsoleRenderer does without colours, at a third of its cost.

    Control characters in texts of robots and hosts, which could manipulate a terminal, are escaped.
    """
    time, level, text = event.pop("timestamp", ""), event.pop("level", ""), str(event.pop("event", ""))
    traces = [_escape_controls(trace) for key in ("stack", "exception") if (trace := event.pop(key, None))]
    values = [f"{key}={_quote_value(event[key])}" for key in sorted(event)]
    line = " ".join((time, f"[{level:<9}]", f"{_escape_controls(text):<30}", *values))
    return "\n".join((line.rstrip(" "), *traces))


def _quote_value(value: object) -> str:
    plain = isinstance(value, str) and value.isprintable() and QUOTED.isdisjoint(value)
    return str(value) if plain else repr(value)


def _name_module(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    event["module"] = event["_record"].name
    return event
