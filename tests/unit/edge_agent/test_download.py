"""Fetching files from a real web server."""

from __future__ import annotations

from hashlib import sha256

import pytest

from nena_edge_agent.download import DownloadError, DownloadSettings, download
from support.http_files import Files
from support.waiting import until

SETTINGS = DownloadSettings(maximum_bytes=2000, timeout=10, silence=5)


async def test_a_file_is_fetched_whole(files: Files) -> None:
    link = files.put("/map.pgm", bytes(range(256)) * 7)

    assert await download(link, None, SETTINGS) == bytes(range(256)) * 7


async def test_the_hash_is_compared(files: Files) -> None:
    link = files.put("/map.pgm", b"map")

    assert await download(link, sha256(b"map").hexdigest().upper(), SETTINGS) == b"map"
    with pytest.raises(DownloadError, match="another hash"):
        await download(link, sha256(b"other").hexdigest(), SETTINGS)
    with pytest.raises(DownloadError, match="must be a SHA-256"):
        await download(link, "d41d8cd98f00b204e9800998ecf8427e", SETTINGS)


async def test_a_file_that_is_too_large_is_not_kept(files: Files) -> None:
    link = files.put("/map.pgm", bytes(2001))

    with pytest.raises(DownloadError, match="larger than 2000"):
        await download(link, None, SETTINGS)


async def test_a_file_that_is_not_there_is_an_error(files: Files) -> None:
    with pytest.raises(DownloadError, match="404"):
        await download(f"{files.address}/none", None, SETTINGS)


async def test_a_server_that_goes_silent_is_given_up(files: Files) -> None:
    link = files.put("/map.pgm", b"map")
    files.slow.add("/map.pgm")

    with pytest.raises(DownloadError, match=r"silent for 0\.2 s"):
        await download(link, None, SETTINGS.model_copy(update={"silence": 0.2}))
    with pytest.raises(DownloadError, match=r"not fetched in 0\.1 s"):
        await download(link, None, SETTINGS.model_copy(update={"timeout": 0.1, "silence": 0.4}))


@pytest.mark.parametrize(
    "link", ["file:///etc/passwd", "ftp://127.0.0.1/x", "map.pgm", "http://127.0.0.1:1/x", "http://["]
)
async def test_other_links_are_not_followed(link: str) -> None:
    with pytest.raises(DownloadError):
        await download(link, None, SETTINGS)


async def test_a_file_whose_end_is_missing_is_not_taken_for_whole(files: Files) -> None:
    link = files.put("/map.pgm", bytes(1000))
    files.cut.add("/map.pgm")

    with pytest.raises(DownloadError, match="ended 500 bytes too early"):
        await download(link, None, SETTINGS)


async def test_a_server_that_trickles_does_not_hold_a_thread_for_longer_than_the_time_out(
    files: Files,
) -> None:
    link = files.put("/map.pgm", bytes(1900))
    files.trickling.add("/map.pgm")

    with pytest.raises(DownloadError, match=r"not fetched in 0\.2 s"):
        await download(link, None, SETTINGS.model_copy(update={"timeout": 0.2}))

    await until(lambda: files.open == 0)


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ("file:///etc/hostname", "not allowed"),
        ("ftp://127.0.0.1/x", "unknown url type"),
        ("data:,map", "not allowed"),
    ],
)
async def test_a_server_cannot_send_the_robot_to_other_links(files: Files, target: str, why: str) -> None:
    files.moved["/map.pgm"] = target

    with pytest.raises(DownloadError, match=why):
        await download(f"{files.address}/map.pgm", None, SETTINGS)


async def test_a_file_that_has_moved_is_fetched(files: Files) -> None:
    files.moved["/old"] = files.put("/new", b"map")

    assert await download(f"{files.address}/old", None, SETTINGS) == b"map"
