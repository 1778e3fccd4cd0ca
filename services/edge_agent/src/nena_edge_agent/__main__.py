"""The start of the program; it imports the rest only when it knows what is needed."""

from __future__ import annotations

import gc
import sys
from collections.abc import Sequence

from nena_shared import model_building


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; return exit status 0 after a signal, 1 after a failure, 2 for invalid settings.

    Modules that the settings do not need are never imported, to save memory on the robot. Models of messages
    are built at their first use: a robot needs few of them, and building all took a sixth of its start.
    """
    model_building.deferred = True
    arguments = sys.argv[1:] if argv is None else list(argv)
    if arguments[:1] == ["doctor"]:
        from nena_edge_agent.doctor import program as doctor  # noqa: PLC0415 - see the docstring

        return doctor.main(arguments[1:])
    gc.disable()  # what is imported stays: to search it for garbage took a tenth of the start
    from nena_edge_agent import program  # noqa: PLC0415

    return program.main(arguments)


if __name__ == "__main__":
    sys.exit(main())
