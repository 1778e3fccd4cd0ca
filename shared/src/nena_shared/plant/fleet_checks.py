"""Find content that is valid in a plant model, but that the order service cannot run with."""

from collections.abc import Iterator
from typing import Final

from pydantic import TypeAdapter, ValidationError

from nena_shared.plant import property_keys as keys
from nena_shared.plant.driver_properties import TOPIC_PREFIX
from nena_shared.plant.errors import ObjectKind, PlantProblem
from nena_shared.plant.model import PlantModel, Vehicle
from nena_shared.settings import TopicPrefix
from nena_shared.vda5050.versions import UnknownVersionError, codec_named

KEY_LENGTH: Final = 400
"""Maximum length of manufacturer and serial number with a separator, characters, in the store."""

_TOPIC_PREFIX: Final[TypeAdapter[str | None]] = TypeAdapter(TopicPrefix | None)


def find_fleet_errors(model: PlantModel) -> tuple[PlantProblem, ...]:
    """Return the errors for which the order service refuses to start with this plant model."""
    problems: list[PlantProblem] = []
    if not model.points:
        problems.append(PlantProblem("NO_POINTS", ObjectKind.MODEL, model.name, "has no points"))
    owners: dict[str, str] = {}
    users: dict[str, str] = {}
    for vehicle in model.vehicles:
        serial = vehicle.serial_number or vehicle.name
        problems += _topic_errors(vehicle, serial)
        # VDA 5050 3.0, 4.2 tells robots apart by manufacturer and serial number, NeNa's topics by the latter
        owner = owners.setdefault(serial, vehicle.name)
        if owner != vehicle.name:
            text = (
                f"{owner!r} and {vehicle.name!r} have the same serial number {serial!r}; "
                f"change one by the property {keys.VDA5050_SERIAL_NUMBER}"
            )
            problems.append(PlantProblem("SAME_SERIAL_NUMBER", ObjectKind.VEHICLE, vehicle.name, text))
        prefix = vehicle.topic_prefix
        if prefix and (owner := users.setdefault(prefix, vehicle.name)) != vehicle.name:
            text = f"{owner!r} has the same {TOPIC_PREFIX} {prefix!r}; each vehicle needs topics of its own"
            problems.append(PlantProblem("NOT_IN_TOPICS", ObjectKind.VEHICLE, vehicle.name, text))
    return tuple(problems)


def _topic_errors(vehicle: Vehicle, serial: str) -> Iterator[PlantProblem]:
    """Yield the errors that prevent VDA 5050 topics for a vehicle (VDA 5050 3.0 section 4.2)."""
    kind, name = ObjectKind.VEHICLE, vehicle.name
    length = len(vehicle.manufacturer or "") + len(serial)
    if length >= KEY_LENGTH:
        text = f"manufacturer and serial number have {length} characters; shorten them to {KEY_LENGTH - 1}"
        yield PlantProblem("NOT_IN_TOPICS", kind, name, text)
    # MQTT's separator and wildcards (3.1.1, 4.7.1)
    if any(sign in f"{vehicle.manufacturer}{serial}" for sign in "/+#"):
        names = f"manufacturer {vehicle.manufacturer!r} and serial number {serial!r}"
        text = f"{names} must not contain '/', '+' or '#'"
        yield PlantProblem("NOT_IN_TOPICS", kind, name, text)
    try:
        codec_named(vehicle.properties.get(keys.VDA5050_VERSION) or "2.1.0")
    except UnknownVersionError as error:
        yield PlantProblem("UNKNOWN_VDA5050_VERSION", kind, name, f"{keys.VDA5050_VERSION}: {error}")
    for key in (keys.VDA5050_INTERFACE_NAME, TOPIC_PREFIX):
        try:
            _TOPIC_PREFIX.validate_python(vehicle.properties.get(key) or None)
        except ValidationError as error:
            problem = error.errors()[0]["msg"].removeprefix("Value error, ")
            text = f"{key} is {vehicle.properties[key]!r}: {problem}"
            yield PlantProblem("NOT_IN_TOPICS", kind, name, text)
