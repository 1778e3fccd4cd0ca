"""What fails beside others is tried again, and told."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.waiting import PATIENCE

TESTS = """
from pathlib import Path
import pytest

def test_good():
    Path("good").open("a").write("x")

@pytest.mark.parametrize("passes_at", {passes_at})
def test_shaky(passes_at):
    tries = Path(f"tries-{{passes_at}}")
    tries.open("a").write("x")
    assert len(tries.read_text()) >= passes_at
"""


def again(folder: Path, *passes_at: int) -> subprocess.CompletedProcess[str]:
    """Run tests, each of which passes at the try with its number, until no further try is left."""
    return run(folder, TESTS.format(passes_at=passes_at))


def run(folder: Path, tests: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run tests until none fails, or no further try is left."""
    (folder / "test_it.py").write_text(tests)
    (folder / "pytest.ini").touch()
    return subprocess.run(
        [sys.executable, "-m", "support.again", "-q", *options],
        cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": str(Path(__file__).parents[2]),
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",  # which makes it quick
        },
        capture_output=True,
        text=True,
        timeout=4 * PATIENCE,
        check=False,
    )


@pytest.mark.parametrize(
    ("passes_at", "flaky", "status"), [((1,), [], 0), ((1, 2, 3), [2, 3], 0), ((2, 4), [2], 1)]
)
def test_only_what_still_fails_is_tried_again_and_it_is_named_in_the_end(
    tmp_path: Path, passes_at: tuple[int, ...], flaky: list[int], status: int
) -> None:
    done = again(tmp_path, *passes_at)

    assert done.returncode == status, done.stdout + done.stderr
    last = [line for line in done.stdout.splitlines() if line.startswith(("flaky: ", "failed: "))]
    named = [f"flaky: test_it.py::test_shaky[{each}]" for each in flaky]
    assert [line.split(" (")[0] for line in last[: len(flaky)]] == named
    assert last[len(flaky) :] == [f"failed: test_it.py::test_shaky[{each}]" for each in passes_at if each > 3]
    assert len((tmp_path / "good").read_text()) == 1
    for each in passes_at:
        assert len((tmp_path / f"tries-{each}").read_text()) == min(each, 3)


def test_where_nearly_everything_fails_nothing_is_tried_again(tmp_path: Path) -> None:
    done = again(tmp_path, *range(100, 130))

    assert done.returncode == 1
    assert len((tmp_path / "tries-100").read_text()) == 1


def test_workers_that_have_collected_other_tests_are_no_reason_to_run_all_again(tmp_path: Path) -> None:
    tests = (
        "import os\nimport pytest\n\n@pytest.mark.parametrize('pid', [os.getpid()])\ndef test_it(pid): pass\n"
    )

    done = run(tmp_path, tests, "-p", "xdist.plugin", "-n", "2")

    assert "Different tests were collected" in done.stdout
    assert "== try" not in done.stdout
    assert done.returncode != 0
