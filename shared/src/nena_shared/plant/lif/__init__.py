"""Reads and writes LIF 1.0.0 and 2.0.0, VDMA's layout interchange format."""

from nena_shared.plant.lif.document import LifVersion
from nena_shared.plant.lif.reader import read
from nena_shared.plant.lif.writer import write

__all__ = ["LifVersion", "read", "write"]
