from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from nena_edge_agent.ros.environment import prepare_environment


def test_what_the_user_has_set_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, value in (
        ("FASTDDS_BUILTIN_TRANSPORTS", "DEFAULT"),
        ("ROS_PYTHON_CHECK_FIELDS", "0"),
        ("ROS_LOG_DIR", str(tmp_path)),
    ):
        monkeypatch.setenv(name, value)
    before = dict(os.environ)
    prepare_environment()
    assert dict(os.environ) == before


def test_bare_environment_is_set_up_and_the_log_directory_goes_with_the_program(tmp_path: Path) -> None:
    program = (
        "import os\n"
        "from nena_edge_agent.ros.environment import prepare_environment\n"
        "prepare_environment()\n"
        "print(os.environ['FASTDDS_BUILTIN_TRANSPORTS'], os.environ['ROS_PYTHON_CHECK_FIELDS'],\n"
        "      os.environ['ROS_LOG_DIR'], os.path.isdir(os.environ['ROS_LOG_DIR']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={"TMPDIR": str(tmp_path), "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
        capture_output=True,
        text=True,
        check=True,
        timeout=90,
    )
    transports, check, directory, existed = done.stdout.split()
    assert (transports, check, existed) == ("UDPv4", "1", "True")
    assert Path(directory).parent == tmp_path
    assert not Path(directory).exists()


@pytest.mark.parametrize("module", ["driver", "settings", "goal_tracker", "session_state"])
def test_rclpy_is_not_loaded_before_the_driver_is_started(module: str) -> None:
    program = f"import sys, nena_edge_agent.ros.{module}\nassert 'rclpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=90)


def test_threads_share_memory_pools(tmp_path: Path) -> None:
    program = (
        "import ctypes, threading\n"
        "from nena_edge_agent.ros.environment import POOLS, prepare_environment\n"
        "prepare_environment()\n"
        "libc, together = ctypes.CDLL(None), threading.Barrier(8)\n"
        "def allocate():\n"
        "    together.wait()\n"
        "    libc.malloc(10_000)\n"
        "    together.wait()\n"
        "threads = [threading.Thread(target=allocate) for _ in range(8)]\n"
        "[each.start() for each in threads], [each.join() for each in threads]\n"
        "libc.fopen.restype = ctypes.c_void_p\n"
        f"file = ctypes.c_void_p(libc.fopen({str(tmp_path / 'pools').encode()!r}, b'w'))\n"
        "libc.malloc_info(0, file), libc.fclose(file)\n"
        f"assert open({str(tmp_path / 'pools')!r}).read().count('<heap nr=') <= POOLS\n"
    )
    environment = {name: value for name, value in os.environ.items() if name != "MALLOC_ARENA_MAX"}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=90)
