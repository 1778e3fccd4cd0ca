"""Settings of every NeNa program: command line over environment over TOML file over defaults.

Each program has one settings model, a subclass of :class:`ProgramSettings`. Environment variables are
called ``NENA_<FIELD>``, with two underscores between the levels (``NENA_MQTT__HOST``); options are called
like the fields (``--mqtt.host``). A setting that nobody knows is an error, so that a spelling mistake is
found at the start and not at night; only in the environment, which programs share, the first level is open.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, SecretStr, ValidationError
from pydantic_core import ErrorDetails
from pydantic_settings import (
    BaseSettings,
    CliSettingsSource,
    EnvSettingsSource,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    SettingsError,
)

from nena_shared import toml_text
from nena_shared.misfits import path_of, words_of

S = TypeVar("S", bound="ProgramSettings")

_FIELD = re.compile(r'(?:field "|encountered for )([\w.]+)')
"""The name in what the library says of a text that it cannot read."""


class ConfigurationError(Exception):
    """The settings do not make a program; ``problems`` says what to change, a line each."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("; ".join(problems))
        self.problems = tuple(problems)


def _no_separator(prefix: str) -> str:
    if prefix.startswith("/") or prefix.endswith("/") or any(sign in prefix for sign in "+#"):
        message = "a topic prefix neither starts nor ends with '/', and holds no '+' or '#'"
        raise ValueError(message)
    return prefix


TopicPrefix = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_no_separator)]


class SettingsGroup(BaseModel):
    """A table of settings; unknown names are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def secret_in(file: Path, setting: str) -> str:
    """Read the secret that a file holds alone; ``setting`` is what names the file.

    Raises:
        ConfigurationError: the file cannot be read, or is empty.

    """
    try:
        secret = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError([f"{setting}: {error}"]) from error
    if not secret:
        raise ConfigurationError([f"{setting}: {file} is empty"])
    return secret


class MqttTlsSettings(SettingsGroup):
    """How the connection to the broker is protected."""

    enabled: bool = Field(
        default=False, description="Encrypt, and believe the broker by the system's certificates."
    )
    ca: Path | None = Field(
        None, description="PEM file with the certificates of who may vouch for the broker; encrypts."
    )
    certificate: Path | None = Field(None, description="PEM file with our own certificate, where asked for.")
    key: Path | None = Field(None, description="PEM file with the key of our own certificate.")

    @property
    def wanted(self) -> bool:
        """Whether the connection is encrypted."""
        return self.enabled or self.ca is not None or self.certificate is not None


class MqttSettings(SettingsGroup):
    """Where the broker is, and how much may wait on the way to it."""

    host: str = Field("127.0.0.1", min_length=1, description="Name or address of the MQTT broker.")
    port: int = Field(1883, ge=1, le=65535, description="TCP port of the MQTT broker.")
    username: str | None = Field(None, description="User name for the broker; none: anonymous.")
    password: SecretStr | None = Field(None, description="Password for the broker.")
    password_file: Path | None = Field(None, description="File that holds the password for the broker.")
    tls: MqttTlsSettings = Field(default_factory=MqttTlsSettings, description="Protection of the connection.")
    client_id: str | None = Field(None, description="MQTT client id; none: made from the program's role.")
    keep_alive: int = Field(15, ge=2, le=600, description="Seconds between signs of life to the broker.")
    reconnect_min: float = Field(
        0.2, gt=0, le=600, description="Seconds before the first new try to connect."
    )
    reconnect_max: float = Field(
        10.0, gt=0, le=600, description="Longest pause between tries to connect, seconds."
    )
    outgoing_limit: int = Field(
        1000,
        ge=1,
        description="Messages that may wait for the broker; above that the oldest is dropped. Retained ones "
        "do not count: the last one of each topic always waits.",
    )
    incoming_limit: int = Field(
        10_000,
        ge=1,
        description="Messages that may wait while a connection is made; above that new ones are dropped.",
    )

    def secret(self) -> str | None:
        """Give the password, from the file where one is named.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.

        """
        if self.password_file is None:
            return self.password.get_secret_value() if self.password else None
        return secret_in(self.password_file, "mqtt.password_file")


class LogSettings(SettingsGroup):
    """What is logged, and in which form."""

    level: Literal["debug", "info", "warning", "error"] = Field("info", description="Least level logged.")
    form: Literal["text", "json"] = Field("text", description="Lines for people, or JSON for machines.")


class ProgramSettings(BaseSettings):
    """What every program can be told."""

    model_config = SettingsConfigDict(
        env_prefix="NENA_",
        env_nested_delimiter="__",
        extra="forbid",
        frozen=True,
        validate_default=True,
    )

    log: LogSettings = Field(default_factory=LogSettings, description="Logging.")

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],  # noqa: ARG003 - the name is the library's
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,  # noqa: ARG003
        dotenv_settings: PydanticBaseSettingsSource,  # noqa: ARG003
        file_secret_settings: PydanticBaseSettingsSource,  # noqa: ARG003
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Take only what is given: :func:`load` alone looks at the command line and the environment."""
        return (init_settings,)


class ServiceSettings(ProgramSettings):
    """What every program that talks over MQTT can be told."""

    mqtt: MqttSettings = Field(default_factory=MqttSettings, description="The MQTT broker.")


def load(model: type[S], argv: Sequence[str], *, program: str, description: str) -> S:
    """Read the settings of ``program`` from the command line, the environment and its file.

    Ends the process with the usual status and text for ``--help`` and an unknown option, as argparse does.

    Raises:
        ConfigurationError: a file cannot be read or a value does not fit; names the setting and the reason.

    """
    parser = argparse.ArgumentParser(
        prog=program,
        usage="%(prog)s [--config FILE] [--SETTING VALUE]...",
        description=description,
        epilog="Every setting can also stand in the TOML file, or in the environment as NENA_<SETTING>, "
        "with two underscores for each dot: NENA_MQTT__HOST=broker.example",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--config", metavar="FILE", type=Path, help="TOML file with settings")
    chosen, _ = _config_only_parser(program).parse_known_args(list(argv))
    from_file = _read_file(chosen.config) if chosen.config else {}
    try:
        command_line = CliSettingsSource[argparse.ArgumentParser](
            model,
            root_parser=parser,
            cli_parse_args=list(argv),
            cli_hide_none_type=True,
            cli_avoid_json=True,
            cli_implicit_flags=True,
        )
        return _build(model, command_line, from_file)
    except SettingsError as error:
        raise ConfigurationError([_unread(error)]) from error
    except RecursionError as error:
        message = "settings: a list or table in the environment or an option is nested too deep"
        raise ConfigurationError([message]) from error


def _config_only_parser(program: str) -> argparse.ArgumentParser:
    """Make a parser that sees nothing but ``--config``, so that the file can be read before the rest."""
    parser = argparse.ArgumentParser(prog=program, add_help=False, allow_abbrev=False)
    parser.add_argument("--config", type=Path)
    return parser


def _read_file(path: Path) -> dict[str, Any]:
    try:
        return toml_text.parse(path.read_bytes())
    except OSError as error:
        raise ConfigurationError([f"config: cannot read {path}: {error.strerror}"]) from error
    except toml_text.NoTomlError as error:
        raise ConfigurationError([f"config: {path} is no TOML: {error}"]) from error


def _build(model: type[S], command_line: PydanticBaseSettingsSource, from_file: dict[str, Any]) -> S:
    try:
        given = _merged(_merged(from_file, EnvSettingsSource(model)()), command_line())
        return model(**_merged(_defaults_of_groups(model), given))
    except ValidationError as error:
        raise ConfigurationError(_problems(error)) from error


def _defaults_of_groups(model: type[S]) -> dict[str, Any]:
    """Give what a program sets in its groups by default, so that naming one value keeps the others."""
    defaults = {
        name: field.get_default(call_default_factory=True, validated_data={})
        for name, field in model.model_fields.items()
    }
    return {
        name: default.model_dump(exclude_unset=True)
        for name, default in defaults.items()
        if isinstance(default, SettingsGroup)
    }


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Lay ``above`` over ``below``, table by table."""
    result = dict(below)
    for name, value in above.items():
        old = result.get(name)
        result[name] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return result


def _unread(error: SettingsError) -> str:
    """Name the option or variable whose text should be a list or a table, and is none.

    The library names the outermost table of a variable alone, but its cause has the text.
    """
    text = getattr(error.__cause__, "doc", None)
    variables = [name for name, value in os.environ.items() if name.startswith("NENA_") and value == text]
    field = _FIELD.search(str(error))
    name = next(iter(variables), field[1] if field else "settings")
    return f'{name}: cannot be read; a list is written as ["a", "b"], a table as {{"a": 1}}'


def _problems(error: ValidationError) -> list[str]:
    return [f"{path_of(item['loc'])}: {_words(item)}" for item in error.errors()]


def _words(problem: ErrorDetails) -> str:
    if problem["type"] == "extra_forbidden":
        return "there is no such setting"
    if problem["type"] == "missing":
        return "has to be given; --help lists all settings"
    return words_of(problem)
