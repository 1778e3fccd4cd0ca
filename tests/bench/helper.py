"""Helper processes of the benchmark beside the measured ones: they report when they are ready."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

WAIT_SECONDS = 30.0


@contextmanager
def helper(module: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run ``module`` of the benchmark until the block ends; it is ready when the block begins."""
    process = subprocess.Popen(
        [sys.executable, "-m", module, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        if process.stdout.readline() != "ready\n":
            message = f"{module} did not start"
            raise RuntimeError(message)
        yield process
    finally:
        process.communicate(timeout=WAIT_SECONDS)
