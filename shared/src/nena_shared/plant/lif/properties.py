"""Keys of properties in which a plant model keeps what only LIF has, so that it can be written again."""

from typing import Final

CREATOR: Final = "lif:creator"
EXPORT_TIMESTAMP: Final = "lif:exportTimestamp"
ID: Final = "lif:id"
"""The id in the file, where the object of the model is called otherwise."""
NAME: Final = "lif:name"
DESCRIPTION: Final = "lif:description"
STATION_HEIGHT: Final = "lif:stationHeight"
STATION_POSITION: Final = "lif:stationPosition"
"""A station's position as the file has it, JSON; without it the station is drawn amid its nodes."""
LAYOUT: Final = "lif:layout"
"""Of the visual layout: `lif:layout.<layer>.id`, `.name`, `.version`, `.levelId`, `.description`."""
