"""Writing files so that they survive a power failure."""

from __future__ import annotations

import os
from pathlib import Path


def sync_folder(folder: Path) -> None:
    """Flush the names in ``folder`` to the disk, so that a new file survives a power failure.

    Raises:
        OSError: the folder does not exist, or the disk fails.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
