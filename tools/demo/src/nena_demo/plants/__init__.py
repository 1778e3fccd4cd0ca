"""The sample plant: a small warehouse hall that the demo, the guide and the tests use."""

from importlib.resources import files
from pathlib import Path


def sample_plant_path() -> Path:
    """Return where the sample plant lies, as openTCS XML 7.0.0."""
    return Path(str(files(__name__).joinpath("sample-plant.xml")))
