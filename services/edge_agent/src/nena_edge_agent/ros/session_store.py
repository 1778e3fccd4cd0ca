"""Keeps the address in the ROS graph that somebody has given a robot at run time, over restarts."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_edge_agent.durability import sync_folder
from nena_edge_agent.ros.address import RosAddress
from nena_edge_agent.ros.settings import RosSettings
from nena_shared.log import get_logger
from nena_shared.misfits import shortened
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)


class _Record(BaseModel):
    """What was given, and what it was given in place of."""

    model_config = ConfigDict(frozen=True)

    address: RosAddress
    instead_of: RosAddress


class SessionStore:
    """One robot's file. It counts for as long as the settings are those that it was written against."""

    def __init__(self, folder: Path, robot: RobotKey) -> None:
        """Prepare; the folder need not be there yet."""
        self._file = folder.expanduser() / f"{quote(str(robot), safe='')}.ros.json"

    def read(self, settings: RosSettings) -> RosAddress:
        """Give the address that was kept, or that of the settings where none was, or none that counts."""
        own = RosAddress.of(settings)
        try:
            record = _Record.model_validate_json(self._file.read_bytes())
        except FileNotFoundError:
            return own
        except (OSError, ValidationError) as error:
            log.warning(
                "the kept ROS address cannot be read", file=str(self._file), reason=shortened(str(error))
            )
            return own
        if record.instead_of != own:
            log.warning("the kept ROS address counts no more: the settings have changed", settings=str(own))
            return own
        log.info("ROS address as it was kept", file=str(self._file), address=str(record.address))
        return record.address

    def write(self, address: RosAddress, settings: RosSettings) -> None:
        """Keep ``address`` in place of that of ``settings``; it survives a power cut when this returns.

        Raises:
            OSError: it could not be written; what was kept before stands.

        """
        record = _Record(address=address, instead_of=RosAddress.of(settings))
        self._file.parent.mkdir(parents=True, exist_ok=True)
        new = self._file.with_suffix(".new")
        with new.open("wb") as file:
            file.write(record.model_dump_json().encode())
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._file)
        sync_folder(self._file.parent)
