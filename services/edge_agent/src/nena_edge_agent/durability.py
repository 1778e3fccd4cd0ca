"""What a file system needs to be told before a file outlives a power cut."""

from __future__ import annotations

import os
from pathlib import Path


def sync_folder(folder: Path) -> None:
    """Have the names in ``folder`` outlive a power cut: a new file has none on the disk before.

    Raises:
        OSError: the folder is not there, or the disk fails.

    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
