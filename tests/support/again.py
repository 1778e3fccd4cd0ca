"""Runs pytest; what fails has two further tries, alone, and what passes only then is named in the end.

``python -m support.again [options of pytest]``: see docs/decisions/0015. Ends with 0 where in the end each
test has passed and, where coverage was asked for, that is enough.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

TRIES = 2
"""Further ones, each of only what still fails."""
MOST = 25
"""Failures: where more fail, the machine's load is not the reason, and nothing is tried again."""
FAILED = Path(".pytest_cache/v/cache/lastfailed")
ALONE = ("--last-failed", "--last-failed-no-failures", "none")
COVERED = "--cov-fail-under"


def main(options: Sequence[str]) -> int:
    """Run all; give the exit status."""
    FAILED.unlink(missing_ok=True)  # what an earlier run has found is none of this one's
    status = _pytest(*options)
    failed = still = _failed() if status else frozenset[str]()
    for number in range(1, TRIES + 1):
        if not still or len(failed) > MOST or not all(map(_can_be_tried, still)):
            break
        _say(f"== try {number} of {TRIES} once more, alone: {len(still)} that failed above")
        status = _pytest(*ALONE)
        still = _failed() if status else frozenset()
    for each in sorted(failed - still):
        _say(f"flaky: {each} (failed beside the others, passed alone)")
    for each in sorted(still):
        _say(f"failed: {each}")
    if failed and not status:
        return _enough_covered(options)
    return status


def _pytest(*options: str) -> int:
    return subprocess.run([sys.executable, "-m", "pytest", *options], check=False).returncode


def _failed() -> frozenset[str]:
    """Return the tests that have failed and not passed since."""
    return frozenset(json.loads(FAILED.read_text())) if FAILED.exists() else frozenset()


def _can_be_tried(failed: str) -> bool:
    """Return whether this is a test or a module, and not the name of a worker that has collected others."""
    return Path(failed.partition("::")[0]).exists()


def _enough_covered(options: Sequence[str]) -> int:
    """Judge the coverage of the first run, which pytest does not do where a test fails."""
    wanted = next((each.partition("=")[2] for each in options if each.startswith(COVERED)), "0")
    command = [sys.executable, "-m", "coverage", "report", "--format=total", f"--fail-under={wanted}"]
    return subprocess.run(command, check=False).returncode if float(wanted) else 0


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
