"""Start ``nena simulate`` in a process whose sets have the same order each time."""

from __future__ import annotations

import gc
import os
import sys


def main(argv: list[str] | None = None) -> None:
    """Run the command and exit."""
    arguments = sys.argv[1:] if argv is None else argv
    if os.environ.get("PYTHONHASHSEED") != "0":  # Python reads it at its start only
        command = [sys.executable, "-m", "nena_simulate", *arguments]
        os.execve(sys.executable, command, {**os.environ, "PYTHONHASHSEED": "0"})  # noqa: S606 - this program
    gc.disable()  # what is imported stays: to search it for garbage took an eighth of that time
    from nena_simulate.command import app  # noqa: PLC0415 - it takes two seconds

    gc.enable()
    app(arguments, prog_name="nena simulate")


if __name__ == "__main__":
    main()
