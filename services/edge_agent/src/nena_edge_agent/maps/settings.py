"""Settings of the robot's maps."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from nena_shared.settings import SettingsGroup


class MapSettings(SettingsGroup):
    """Where the robot's maps are kept."""

    store: str = Field(
        "fixed",
        min_length=1,
        description="fixed: the one map of the settings; folder: what fleet control brings, in a folder; "
        "else the name of a plug-in of the entry points nena.maps.",
    )
    folder: Path = Field(
        Path("~/.local/state/nena/maps"), description="Folder of the maps, with one folder per robot in it."
    )
    maximum: int = Field(20, ge=1, le=1000, description="How many maps the folder holds.")
