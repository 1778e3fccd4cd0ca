from __future__ import annotations

import pytest

from nena_shared.web.addresses import is_loopback


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "localhost"])
def test_only_this_machine_reaches_it(host: str) -> None:
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "fleet.example", "", "localhost.example"])
def test_everything_else_is_beyond_it(host: str) -> None:
    assert not is_loopback(host)
