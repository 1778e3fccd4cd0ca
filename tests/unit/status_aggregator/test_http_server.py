from __future__ import annotations

import socket

import pytest

from nena_shared.program import StartError
from nena_shared.settings import HttpSettings
from nena_status_aggregator.http_server import listen


def test_a_free_port_is_found() -> None:
    with listen(HttpSettings(host="127.0.0.1", port=0)) as door:
        assert door.getsockname()[1] > 0


def test_a_port_in_use_is_told_in_one_line_that_says_what_to_do() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(
            StartError, match=rf"^port {port} of 127.0.0.1 is in use; .*--http.port"
        ) as caught:
            listen(HttpSettings(host="127.0.0.1", port=port))
    assert "\n" not in str(caught.value)


def test_an_address_of_somebody_else_is_told() -> None:
    with pytest.raises(StartError, match=r"cannot listen on 192\.0\.2\.1 .*--http.host"):
        listen(HttpSettings(host="192.0.2.1", port=0))
