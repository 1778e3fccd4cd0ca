"""Reads plant models in openTCS's XML, format versions 0.0.2 to 7.0.0, and writes 7.0.0."""

from nena_plant_formats.exchange import ExportReport, ImportReport
from nena_plant_formats.opentcs_xml.document import Limits
from nena_plant_formats.opentcs_xml.reader import read
from nena_plant_formats.opentcs_xml.writer import write

__all__ = ["ExportReport", "ImportReport", "Limits", "read", "write"]
