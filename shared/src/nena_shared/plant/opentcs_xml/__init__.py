"""Reads plant models in openTCS's XML, format versions 0.0.2 to 7.0.0."""

from nena_shared.plant.opentcs_xml.document import Limits
from nena_shared.plant.opentcs_xml.reader import ImportReport, read

__all__ = ["ImportReport", "Limits", "read"]
