"""Reads a whole plant model and collects all that is wrong or odd about it."""

from xml.etree.ElementTree import Element

from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import ObjectKind, PlantModelError
from nena_shared.plant.model import PlantModel
from nena_shared.plant.opentcs_xml.document import DEFAULT_LIMITS, Limits, parse
from nena_shared.plant.opentcs_xml.drawing import read_drawing
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.notes import Notes
from nena_shared.plant.opentcs_xml.places import read_block, read_location, read_location_type
from nena_shared.plant.opentcs_xml.track import TrackReader
from nena_shared.plant.opentcs_xml.vehicles import read_vehicle
from nena_shared.plant.opentcs_xml.xml_object import XmlObject
from nena_shared.plant.paused_collector import paused_collector
from nena_shared.plant.reports import ImportReport


def read(data: bytes, *, limits: Limits = DEFAULT_LIMITS) -> ImportReport:
    """Read a plant model in openTCS's XML, formats 0.0.2 to 7.0.0.

    Raises PlantModelError with all problems if the file is no plant model, is of a version that cannot be
    read, breaks a limit, or if its objects contradict each other.
    """
    with paused_collector():
        return _read(parse(data, limits))


def _read(element: Element) -> ImportReport:
    name = element.get("name", "")
    # Taken out, because all that is left unread is reported.
    notes = Notes(FormatVersion.parse(element.attrib.pop("version", ""), name))
    root = XmlObject(element, ObjectKind.MODEL, name, notes)
    model = _read_model(root)
    root.finish()
    errors = (*notes.errors, *find_errors(model))
    if errors:
        raise PlantModelError(errors)
    return ImportReport(model, (*notes.warnings, *notes.ignored(), *find_warnings(model)))


def _read_model(root: XmlObject) -> PlantModel:
    drawing = read_drawing(root.objects("visualLayout", ObjectKind.VISUAL_LAYOUT))
    track = TrackReader(drawing)
    points = tuple(track.point(obj) for obj in root.objects("point", ObjectKind.POINT))
    paths = tuple(track.path(obj) for obj in root.objects("path", ObjectKind.PATH))
    types = root.objects("locationType", ObjectKind.LOCATION_TYPE)
    locations = root.objects("location", ObjectKind.LOCATION)
    track.warn_of_differences(root, paths)
    return PlantModel(
        name=root.text("name", root.if_old("")),
        points=points,
        paths=paths,
        location_types=tuple(read_location_type(obj, drawing) for obj in types),
        locations=tuple(read_location(obj, drawing, same_frame=not track.displaced) for obj in locations),
        blocks=tuple(read_block(obj, drawing) for obj in root.objects("block", ObjectKind.BLOCK)),
        vehicles=tuple(read_vehicle(obj, drawing) for obj in root.objects("vehicle", ObjectKind.VEHICLE)),
        visual_layout=drawing.visual_layout,
        properties=root.properties(),
    )
