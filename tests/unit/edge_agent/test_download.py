"""Fetching files from a real web server."""

from __future__ import annotations

import socket
from collections.abc import Callable
from email.message import Message
from hashlib import sha256
from http.client import HTTPSConnection
from typing import Any
from urllib.request import Request

import pytest

from nena_edge_agent.download import (
    DownloadError,
    DownloadSettings,
    _checked_connection,
    _Connections,
    _NetworkRange,
    _Redirects,
    download,
)
from support.http_files import Files
from support.waiting import until

SETTINGS = DownloadSettings(maximum_bytes=2000, timeout=10, silence=5)


async def test_a_file_is_downloaded_completely(files: Files) -> None:
    link = files.put("/map.pgm", bytes(range(256)) * 7)

    assert await download(link, None, SETTINGS) == bytes(range(256)) * 7


async def test_the_hash_is_checked(files: Files) -> None:
    link = files.put("/map.pgm", b"map")

    assert await download(link, sha256(b"map").hexdigest().upper(), SETTINGS) == b"map"
    with pytest.raises(DownloadError, match="does not match"):
        await download(link, sha256(b"other").hexdigest(), SETTINGS)
    with pytest.raises(DownloadError, match="must be a SHA-256"):
        await download(link, "d41d8cd98f00b204e9800998ecf8427e", SETTINGS)


async def test_a_file_that_is_too_large_is_not_kept(files: Files) -> None:
    link = files.put("/map.pgm", bytes(2001))

    with pytest.raises(DownloadError, match="larger than 2000"):
        await download(link, None, SETTINGS)


async def test_a_missing_file_is_an_error(files: Files) -> None:
    with pytest.raises(DownloadError, match="404"):
        await download(f"{files.address}/none", None, SETTINGS)


async def test_a_silent_server_is_a_timeout(files: Files) -> None:
    link = files.put("/map.pgm", b"map")
    files.slow.add("/map.pgm")

    with pytest.raises(DownloadError, match=r"no data for 0\.2 s"):
        await download(link, None, SETTINGS.model_copy(update={"silence": 0.2}))
    with pytest.raises(DownloadError, match=r"not downloaded within 0\.1 s"):
        await download(link, None, SETTINGS.model_copy(update={"timeout": 0.1, "silence": 0.4}))


@pytest.mark.parametrize(
    "link", ["file:///etc/passwd", "ftp://127.0.0.1/x", "map.pgm", "http://127.0.0.1:1/x", "http://["]
)
async def test_other_schemes_are_refused(link: str) -> None:
    with pytest.raises(DownloadError):
        await download(link, None, SETTINGS)


async def test_a_truncated_file_is_not_accepted(files: Files) -> None:
    link = files.put("/map.pgm", bytes(1000))
    files.cut.add("/map.pgm")

    with pytest.raises(DownloadError, match="ended 500 bytes early"):
        await download(link, None, SETTINGS)


async def test_a_server_that_trickles_does_not_occupy_a_thread_beyond_the_timeout(
    files: Files,
) -> None:
    link = files.put("/map.pgm", bytes(1900))
    files.trickling.add("/map.pgm")

    with pytest.raises(DownloadError, match=r"not downloaded within 0\.2 s"):
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
async def test_a_redirect_to_other_schemes_is_refused(files: Files, target: str, why: str) -> None:
    files.moved["/map.pgm"] = target

    with pytest.raises(DownloadError, match=why):
        await download(f"{files.address}/map.pgm", None, SETTINGS)


async def test_a_redirected_file_is_downloaded(files: Files) -> None:
    files.moved["/old"] = files.put("/new", b"map")

    assert await download(f"{files.address}/old", None, SETTINGS) == b"map"


@pytest.mark.parametrize(
    ("address", "what"),
    [
        ("127.0.0.1", "the robot itself"),
        ("127.8.9.1", "the robot itself"),
        ("0.0.0.0", "the robot itself"),
        ("::1", "the robot itself"),
        ("::", "the robot itself"),
        ("::ffff:127.0.0.1", "the robot itself"),
        ("169.254.169.254", "a link-local address"),
        ("::ffff:169.254.169.254", "a link-local address"),
        ("fe80::1%eth0", "a link-local address"),
        ("224.0.0.1", "a multicast address"),
        ("192.168.1.7", "the network"),
        ("2001:db8::1", "the network"),
    ],
)
def test_the_network_range_of_an_address_is_known(address: str, what: str) -> None:
    assert _NetworkRange.of_address(address) == what


class Elsewhere:
    """Makes names resolve to the file server here, whose address then counts as another one."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, addresses: dict[str, str]) -> None:
        self._addresses = addresses
        self._resolve = socket.getaddrinfo
        self._kinds: list[str] = []
        monkeypatch.setattr(socket, "getaddrinfo", self._look_up)
        monkeypatch.setattr(_Connections, "check_address", self._check(_Connections.check_address))

    def _look_up(self, host: str, *more: Any, **options: Any) -> Any:
        self._kinds.append(self._addresses.get(host, host))
        return self._resolve("127.0.0.1" if host in self._addresses else host, *more, **options)

    def _check(self, check: Callable[[_Connections, str], None]) -> Callable[[_Connections, str], None]:
        return lambda connections, _: check(connections, self._kinds[-1])


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ("127.0.0.1", r"redirects to 127\.0\.0\.1, which is the robot itself"),
        ("127.1", "which is the robot itself"),
        (
            "metadata.internal",
            r"downloads from 169\.254\.169\.254 are not allowed: it is a link-local address",
        ),
    ],
)
async def test_a_redirect_to_the_robot_itself_is_refused(
    files: Files, monkeypatch: pytest.MonkeyPatch, target: str, why: str
) -> None:
    """Loopback services and the metadata of clouds answer all local clients."""
    Elsewhere(
        monkeypatch,
        {"maps.site": "192.168.1.7", "127.1": "127.0.0.1", "metadata.internal": "169.254.169.254"},
    )
    port = files.put("/secret", b"secret").rpartition(":")[2].partition("/")[0]
    files.moved["/map.pgm"] = f"http://{target}:{port}/secret"

    with pytest.raises(DownloadError, match=why):
        await download(f"http://maps.site:{port}/map.pgm", None, SETTINGS)
    assert files.asked == ["/map.pgm"]


async def test_a_link_local_address_is_refused(files: Files, monkeypatch: pytest.MonkeyPatch) -> None:
    Elsewhere(monkeypatch, {"metadata.internal": "169.254.169.254"})
    link = files.put("/latest", b"secret").replace("127.0.0.1", "metadata.internal")

    with pytest.raises(DownloadError, match="link-local"):
        await download(link, None, SETTINGS)
    assert files.asked == []


async def test_redirects_between_servers_are_followed(files: Files, monkeypatch: pytest.MonkeyPatch) -> None:
    Elsewhere(monkeypatch, {"maps.site": "192.168.1.7", "other.site": "192.168.1.8"})
    files.moved["/old"] = files.put("/new", b"map").replace("127.0.0.1", "other.site")

    link = f"{files.address}/old".replace("127.0.0.1", "maps.site")
    assert await download(link, None, SETTINGS) == b"map"


async def test_circular_redirects_are_abandoned(files: Files) -> None:
    files.moved["/a"], files.moved["/b"] = f"{files.address}/b", f"{files.address}/a"

    with pytest.raises(DownloadError, match="redirect"):
        await download(f"{files.address}/a", None, SETTINGS)
    assert len(files.asked) < 20


def test_a_redirect_from_https_to_http_is_refused() -> None:
    """Content fetched without TLS can be changed by anyone on the way."""
    request = Request("https://maps.site/map.zip")

    with pytest.raises(DownloadError, match=r"from https to http://maps\.site/map\.zip"):
        _Redirects().redirect_request(request, None, 302, "Found", Message(), "http://maps.site/map.zip")


async def test_a_redirect_to_the_robot_itself_is_refused_behind_a_proxy(
    files: Files, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("http_proxy", files.address)
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    link = "http://maps.site/map.pgm"
    files.moved[link] = files.put("/secret", b"secret")

    with pytest.raises(DownloadError, match=r"redirects to 127\.0\.0\.1, which is the robot itself"):
        await download(link, None, SETTINGS)
    assert files.asked == [link]


def test_a_tunnel_through_a_proxy_leads_to_the_network() -> None:
    """The proxy may run on the robot: its address was chosen by the site."""
    request, connections = Request("https://maps.site/map.pgm"), _Connections()
    request.set_proxy("127.0.0.1:3128", "http")

    assert _checked_connection(HTTPSConnection, connections, request) is HTTPSConnection
    with pytest.raises(DownloadError, match="which is the robot itself"):
        connections.check_address("127.0.0.1")
