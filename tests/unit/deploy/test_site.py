from __future__ import annotations

from pathlib import Path

import pytest

from nena_deploy.site import BusyError, locked


def test_one_at_a_time(tmp_path: Path) -> None:
    file = tmp_path / "new" / "users.toml"
    with locked(file):
        with (
            pytest.raises(BusyError, match=r"Another nena-deploy is using .*users\.toml"),
            locked(file, timeout=0),
        ):
            pytest.fail("two have it")
        with locked(file.with_name("others.toml"), timeout=0):
            pass

    with locked(file, timeout=0):
        pass
