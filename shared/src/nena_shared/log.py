"""Structured logging: key and value, for people or as JSON lines, to standard error."""

from __future__ import annotations

import logging
import sys
from typing import TextIO, cast

import structlog
from structlog.typing import FilteringBoundLogger, Processor

from nena_shared.settings import LogSettings


def get_logger(name: str) -> FilteringBoundLogger:
    """Give the logger of a module; bind ids to it with ``.bind(robot=..., order=...)``."""
    return cast("FilteringBoundLogger", structlog.get_logger(module=name))


def configure(settings: LogSettings, stream: TextIO | None = None) -> None:
    """Set up logging of this process, once, before the first line is logged."""
    out = stream or sys.stderr
    level = logging.getLevelNamesMapping()[settings.level.upper()]
    renderer: Processor = (
        structlog.processors.JSONRenderer()
        if settings.form == "json"
        else structlog.dev.ConsoleRenderer(colors=out.isatty())
    )
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.StackInfoRenderer(),
            structlog.processors.format_exc_info,
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.PrintLoggerFactory(out),
        cache_logger_on_first_use=False,
    )
    logging.basicConfig(
        level=level, stream=out, format="%(asctime)s [%(levelname)s] %(name)s: %(message)s", force=True
    )
