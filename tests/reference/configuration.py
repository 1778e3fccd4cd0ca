"""Writes docs/configuration.md: every setting of every program, from the settings models themselves."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, Final, get_args

from pydantic import BaseModel, SecretStr
from pydantic.fields import FieldInfo

from nena_edge_agent.extension import settings_model
from nena_order_service import extension as order_service
from nena_order_service.settings import OrderServiceSettings
from nena_robot_simulator.settings import SimulatorSettings
from nena_shared.settings import ProgramSettings, SettingsGroup, settings_with
from nena_status_aggregator import extension as aggregator
from nena_status_aggregator.settings import AggregatorSettings
from support.markdown import row

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "configuration.md"

PROGRAMS: Final[dict[str, type[ProgramSettings]]] = {
    "nena-order-service": settings_with(OrderServiceSettings, order_service.installed()),
    "nena-status-aggregator": settings_with(AggregatorSettings, aggregator.installed()),
    "nena-edge-agent": settings_model(),
    "nena-robot-simulator": SimulatorSettings,
}
BY_FILE: Final = "_file"
"""What a setting's name ends with that names the file with the value of another one."""
GIVEN: Final = "required"
WITH_ITS_TABLE: Final = "required with the others of its table"
_REQUIRED: Final = object()


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting of a program."""

    path: tuple[str, ...]
    """Its name, a part for each table that it is in."""
    default: str
    description: str
    secret: bool
    """Whether it is never shown."""
    from_file: bool
    """Whether another setting names a file that holds it."""

    @property
    def name(self) -> str:
        """As in a TOML file, with dots between tables."""
        return ".".join(self.path)

    @property
    def option(self) -> str:
        """On the command line."""
        return f"--{self.name}"

    @property
    def variable(self) -> str:
        """In the environment."""
        return f"NENA_{'__'.join(self.path).upper()}"


def settings_of(model: type[BaseModel]) -> list[Setting]:
    """Return all settings of a model; raise ``ValueError`` if one has no description."""
    return list(_walk(model, {}, ()))


def _walk(model: type[BaseModel], given: dict[str, Any], path: tuple[str, ...]) -> Iterator[Setting]:
    for name, field in model.model_fields.items():
        default = given[name] if name in given else _default(field)
        place = (*path, name)
        if isinstance(default, SettingsGroup):
            yield from _walk(type(default), dict(default), place)
        elif group := _optional_group(field):
            yield from (
                replace(each, default=WITH_ITS_TABLE) if each.default == GIVEN else each
                for each in _walk(group, {}, place)
            )
        else:
            yield _setting(place, field, default, from_file=name + BY_FILE in model.model_fields)


def _default(field: FieldInfo) -> Any:
    if field.is_required():
        return _REQUIRED
    return field.get_default(call_default_factory=True, validated_data={})


def _optional_group(field: FieldInfo) -> type[SettingsGroup] | None:
    """Return the optional table, if the setting is one."""
    kinds = [each for each in get_args(field.annotation) if each is not NoneType]
    only = kinds[0] if len(kinds) == 1 and NoneType in get_args(field.annotation) else None
    return only if isinstance(only, type) and issubclass(only, SettingsGroup) else None


def _setting(path: tuple[str, ...], field: FieldInfo, default: object, *, from_file: bool) -> Setting:
    if not field.description:
        message = f"{'.'.join(path)} has no description"
        raise ValueError(message)
    secret = SecretStr in (field.annotation, *get_args(field.annotation))
    return Setting(path, _shown(default), field.description, secret, from_file)


def _shown(default: object) -> str:
    if default is _REQUIRED:
        return GIVEN
    if default is None:
        return "unset"
    text = _text(default)
    return f"`{text}`" if text else "empty"


def _plain(part: object) -> object:
    """Return what JSON has for a part of a default: settings as objects, networks as text."""
    return part.model_dump(mode="json", exclude_unset=True) if isinstance(part, BaseModel) else str(part)


def _text(default: object) -> str:
    match default:
        case Enum():
            return str(default.value)
        case SecretStr():
            return default.get_secret_value()
        case bool():
            return str(default).lower()
        case tuple() | list() | dict() if default:
            return json.dumps(default, default=_plain)
        case tuple() | list() | dict():
            return ""
    return str(default)


def document() -> str:
    """Return the whole text."""
    parts = [(_HERE / "introduction.md").read_text(), _secrets()]
    parts += [_program(program, settings_of(model)) for program, model in PROGRAMS.items()]
    return "\n".join(parts)


def _secrets() -> str:
    by_name = {each.name: each for model in PROGRAMS.values() for each in settings_of(model) if each.secret}
    rows = (
        (f"`{each.name}`", f"`{each.name}{BY_FILE}`", f"`{each.variable}{BY_FILE.upper()}`")
        for each in by_name.values()
    )
    return "\n".join([*_table(("secret", "setting for its file", "in the environment"), rows), ""])


def _program(program: str, settings: Iterable[Setting]) -> str:
    rows = ((f"`{each.option}`", f"`{each.variable}`", each.default, _meaning(each)) for each in settings)
    head = ("on the command line", "in the environment", "default", "meaning")
    return "\n".join([f"## {program}", "", *_table(head, rows), ""])


def _meaning(setting: Setting) -> str:
    more = f" Secret: prefer `{setting.name}{BY_FILE}`." if setting.secret and setting.from_file else ""
    return setting.description + more


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [row(head), row("---" for _ in head), *map(row, rows)]


if __name__ == "__main__":
    DOCUMENT.write_text(document())
