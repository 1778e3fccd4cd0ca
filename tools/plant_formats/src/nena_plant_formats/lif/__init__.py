"""Reads and writes LIF 1.0.0 and 2.0.0, VDMA's layout interchange format."""

from nena_plant_formats.lif.document import LifVersion
from nena_plant_formats.lif.reader import read
from nena_plant_formats.lif.writer import write

__all__ = ["LifVersion", "read", "write"]
