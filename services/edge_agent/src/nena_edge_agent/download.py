"""Files that fleet control has the robot fetch: maps and zone sets."""

from __future__ import annotations

import asyncio
from hashlib import sha256
from http.client import HTTPException
from typing import Final
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from pydantic import Field

from nena_shared.settings import SettingsGroup

CHUNK: Final = 64 * 1024
HASH_LENGTH: Final = 64
"""Hexadecimal digits of a SHA-256."""


class DownloadSettings(SettingsGroup):
    """Fetching maps and zone sets."""

    maximum_bytes: int = Field(
        64 * 1024 * 1024, ge=1024, le=4 * 1024**3, description="Largest file that is fetched."
    )
    timeout: float = Field(60.0, gt=0, le=3600, description="Seconds that a whole download may take.")
    silence: float = Field(10.0, gt=0, le=600, description="Seconds that the other side may be silent.")


class DownloadError(Exception):
    """A file was not fetched; the text says why."""


async def download(link: str, digest: str | None, settings: DownloadSettings) -> bytes:
    """Fetch the file at ``link``, whose SHA-256 is ``digest`` (hexadecimal, None: not checked).

    Raises:
        DownloadError: it is not there, too large, too slow, or another one.

    """
    if urlsplit(link).scheme not in ("http", "https"):
        message = f"only http and https links are fetched, not '{link}'"
        raise DownloadError(message)
    if digest is not None and len(digest) != HASH_LENGTH:
        message = f"the hash must be a SHA-256 in {HASH_LENGTH} hexadecimal digits"
        raise DownloadError(message)
    try:
        async with asyncio.timeout(settings.timeout):
            content = await asyncio.to_thread(_fetch, link, settings)
    except TimeoutError:
        message = f"{link} was not fetched in {settings.timeout:g} s"
        raise DownloadError(message) from None
    except (OSError, HTTPException, ValueError) as error:
        message = f"{link} was not fetched: {error}"
        raise DownloadError(message) from error
    if digest is not None and sha256(content).hexdigest() != digest.lower():
        message = f"{link} has another hash than was said"
        raise DownloadError(message)
    return content


def _fetch(link: str, settings: DownloadSettings) -> bytes:
    """Block until the file is there; a server that goes silent ends it, also when nobody waits any more."""
    request = Request(link, headers={"User-Agent": "nena-edge-agent"})  # noqa: S310 - the scheme was checked
    parts: list[bytes] = []
    size = 0
    try:
        with urlopen(request, timeout=settings.silence) as answer:  # noqa: S310 - the scheme was checked
            while part := answer.read(CHUNK):
                parts.append(part)
                size += len(part)
                if size > settings.maximum_bytes:
                    message = f"{link} is larger than {settings.maximum_bytes} bytes"
                    raise DownloadError(message)
    except TimeoutError as error:
        message = f"{link} was silent for {settings.silence:g} s"
        raise DownloadError(message) from error
    return b"".join(parts)
