from __future__ import annotations

from pathlib import Path

import pytest

from nena_deploy.site import BusyError, alone


def test_one_at_a_time(tmp_path: Path) -> None:
    file = tmp_path / "new" / "users.toml"
    with alone(file):
        with (
            pytest.raises(BusyError, match=r"another nena-deploy works on .*users\.toml"),
            alone(file, patience=0),
        ):
            pytest.fail("two have it")
        with alone(file.with_name("others.toml"), patience=0):
            pass

    with alone(file, patience=0):
        pass
