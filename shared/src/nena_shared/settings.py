"""Settings of NeNa's programs. Precedence: command line, environment, TOML file, defaults.

Each program has a settings model, a subclass of :class:`ProgramSettings`. Environment variables are named
``NENA_<FIELD>`` with two underscores between levels (``NENA_MQTT__HOST``), options like the fields
(``--mqtt.host``). Unknown settings are errors, except for first-level environment variables, which programs
share.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tomllib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Protocol, TypeVar, cast

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SecretStr,
    ValidationError,
    create_model,
)
from pydantic_core import ErrorDetails
from pydantic_settings import (
    BaseSettings,
    CliSettingsSource,
    EnvSettingsSource,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    SettingsError,
)

from nena_shared.findings import path_of, shortened, words_of

S = TypeVar("S", bound="ProgramSettings")

_FIELD = re.compile(r'(?:field "|encountered for )([\w.]+)')
"""Field name in pydantic-settings' error about an invalid text."""


class ConfigurationError(Exception):
    """The settings are invalid; ``problems`` has a line for each with what to change."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("; ".join(problems))
        self.problems = tuple(problems)


def _no_separator(prefix: str) -> str:
    if prefix.startswith("/") or prefix.endswith("/") or any(sign in prefix for sign in "+#"):
        raise ValueError("a topic prefix must not start or end with '/' or contain '+' or '#'")
    return prefix


def _no_port(host: str) -> str:
    if "/" in host or host.count(":") == 1:  # an address of IPv6 has more
        raise ValueError("must be a host name or an address alone; the port has a setting of its own")
    return host


TopicPrefix = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_no_separator)]


class SettingsGroup(BaseModel):
    """A group of settings; unknown names are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class NoSettings(SettingsGroup):
    """The settings of an extension that has none."""


class TopLevelSettings(BaseModel):
    """Settings of an extension beside those of its service, instead of in a group."""


class HasSettings(Protocol):
    """A class of extensions."""

    Settings: ClassVar[type[BaseModel]]


def secret_in(file: Path, setting: str) -> str:
    """Read a file that contains only a secret; ``setting`` is the setting that names the file.

    Raises:
        ConfigurationError: the file cannot be read, or is empty.
    """
    try:
        # without the line break with which editors end a file
        secret = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError([f"{setting}: {error}"]) from error
    if not secret:
        raise ConfigurationError([f"{setting}: {file} is empty"])
    return secret


class MqttTlsSettings(SettingsGroup):
    """TLS of the broker connection."""

    enabled: bool = Field(
        default=False, description="Use TLS and verify the broker against the system CA store."
    )
    ca: Path | None = Field(None, description="CA bundle (PEM) for the broker; enables TLS.")
    certificate: Path | None = Field(
        None, description="Client certificate (PEM), if the broker requires one; enables TLS."
    )
    key: Path | None = Field(None, description="Private key (PEM) of the client certificate.")

    @property
    def wanted(self) -> bool:
        """Whether the connection uses TLS."""
        return self.enabled or self.ca is not None or self.certificate is not None


class MqttSettings(SettingsGroup):
    """Address of the broker, and limits of the connection."""

    host: Annotated[str, AfterValidator(_no_port)] = Field(
        "127.0.0.1", min_length=1, description="Host name or address of the MQTT broker."
    )
    port: int = Field(1883, ge=1, le=65535, description="TCP port of the MQTT broker.")
    username: str | None = Field(None, description="User name at the broker. Unset: anonymous.")
    password: SecretStr | None = Field(None, description="Password at the broker.")
    password_file: Path | None = Field(None, description="File that contains the password at the broker.")
    tls: MqttTlsSettings = Field(default_factory=MqttTlsSettings, description="TLS of the connection.")
    client_id: str | None = Field(None, description="MQTT client ID. Unset: derived from the program's role.")
    # brokers publish the last will after 1.5 times this (MQTT 3.1.1, 3.1.2.10);
    # measured: RabbitMQ 3.10 after up to 3 times, ActiveMQ 5.17 after 2.5 times
    keep_alive: int = Field(15, ge=2, le=600, description="MQTT keep-alive interval, seconds.")
    reconnect_min: float = Field(
        0.2, gt=0, le=600, description="Delay before the first reconnection attempt, seconds."
    )
    # a robot stands until its link is back: a longer pause would outlast most outages of a network
    reconnect_max: float = Field(
        1.0, gt=0, le=600, description="Maximum delay between connection attempts, seconds."
    )
    outgoing_limit: int = Field(
        1000,
        ge=1,
        description="Maximum queued outgoing messages; beyond it, the oldest is dropped. Retained messages "
        "do not count: the last one of each topic is always queued.",
    )
    incoming_limit: int = Field(
        10_000,
        ge=1,
        description="Maximum queued incoming messages while connecting; beyond it, new ones are dropped.",
    )

    def secret(self) -> str | None:
        """Return the password, from the file if one is set.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.
        """
        if self.password_file is None:
            return self.password.get_secret_value() if self.password else None
        return secret_in(self.password_file, "mqtt.password_file")


class LogSettings(SettingsGroup):
    """Level and format of log lines."""

    level: Literal["debug", "info", "warning", "error"] = Field("info", description="Minimum log level.")
    form: Literal["text", "json"] = Field("text", description="Text lines, or JSON for machines.")


class ProgramSettings(BaseSettings):
    """Settings of every program."""

    model_config = SettingsConfigDict(
        env_prefix="NENA_",
        env_nested_delimiter="__",
        extra="forbid",
        frozen=True,
        validate_default=True,
        defer_build=True,  # only the form with the settings of the extensions is used
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
        """Use only passed values: :func:`load` reads the command line and the environment."""
        return (init_settings,)


class ServiceSettings(ProgramSettings):
    """Settings of every program that uses MQTT."""

    mqtt: MqttSettings = Field(default_factory=MqttSettings, description="The MQTT broker.")


class ShowVersion(argparse.Action):
    """Option that prints the version of the program's distribution, by default of its name, and exits."""

    def __init__(
        self, option_strings: Sequence[str], dest: str, *, program: str, distribution: str | None = None
    ) -> None:
        super().__init__(
            option_strings,
            argparse.SUPPRESS,
            nargs=0,
            default=argparse.SUPPRESS,
            help="show version and exit",
        )
        del dest
        self._program, self._distribution = program, distribution or program

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print the version and exit."""
        sys.stdout.write(f"{self._program} {version(self._distribution)}\n")
        parser.exit()


def settings_with(model: type[S], extensions: Mapping[str, type[HasSettings]]) -> type[S]:
    """Return the settings model of a service with those of its extensions, mostly a group for each."""
    bases: list[type[BaseModel]] = [model]
    groups: dict[str, Any] = {}
    for name, extension in extensions.items():
        group = extension.Settings
        if issubclass(group, TopLevelSettings):
            bases.append(group)
        elif group is not NoSettings:
            groups[name] = (group, Field(default_factory=group, description=str(group.__doc__)))
    made = create_model(model.__name__, __base__=tuple(bases), __doc__=model.__doc__, **groups)
    return cast("type[S]", made)


def settings_of(settings: ProgramSettings, name: str, extension: type[HasSettings]) -> BaseModel:
    """Return the settings of an extension; its defaults if those of the program have none of it."""
    if isinstance(settings, extension.Settings):
        return settings
    return getattr(settings, name, None) or extension.Settings()


def load(model: type[S], argv: Sequence[str], *, program: str, description: str) -> S:
    """Read the settings of ``program`` from the command line, the environment and its file.

    Exits for ``--help`` and unknown options, as argparse does.

    Raises:
        ConfigurationError: a file cannot be read or a value is invalid; names the setting and the reason.
    """
    parser = argparse.ArgumentParser(
        prog=program,
        usage="%(prog)s [--config FILE] [--SETTING VALUE]...",
        description=description,
        epilog="Every setting can also be set in the TOML file, or in the environment as NENA_<SETTING>, "
        "with two underscores for each dot: NENA_MQTT__HOST=broker.example",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--config", metavar="FILE", type=Path, help="TOML file with settings")
    names = ("-V",) if "version" in model.model_fields else ("-V", "--version")  # a robot's VDA 5050 version
    parser.add_argument(*names, action=ShowVersion, program=program)
    arguments = _with_short_version(argv)
    chosen, _ = _config_only_parser(program).parse_known_args(arguments)
    from_file = _read_file(chosen.config) if chosen.config else {}
    try:
        command_line = CliSettingsSource[argparse.ArgumentParser](
            model,
            root_parser=parser,
            cli_parse_args=arguments,
            cli_hide_none_type=True,
            cli_avoid_json=True,
            cli_implicit_flags=True,
        )
        return _build_settings(model, command_line, from_file)
    except SettingsError as error:
        raise ConfigurationError([_unreadable_text(error)]) from error
    except RecursionError as error:
        message = "settings: a list or table in the environment or an option is nested too deeply"
        raise ConfigurationError([message]) from error


def _with_short_version(argv: Sequence[str]) -> list[str]:
    """Return the arguments with ``-V`` for a ``--version`` without a value: that is not the setting."""
    after = (*argv[1:], "-")
    return [
        "-V" if each == "--version" and following.startswith("-") else each
        for each, following in zip(argv, after, strict=False)
    ]


def _config_only_parser(program: str) -> argparse.ArgumentParser:
    """Return a parser for ``--config`` only, to read the file before the other options."""
    parser = argparse.ArgumentParser(prog=program, add_help=False, allow_abbrev=False)
    parser.add_argument("--config", type=Path)
    return parser


def _read_file(path: Path) -> dict[str, Any]:
    try:
        # 0033: pydantic-settings' own TOML source starts with defaults if the file does not exist
        return parse_toml(path.read_bytes())
    except OSError as error:
        raise ConfigurationError([f"config: cannot read {path}: {error.strerror}"]) from error
    except TomlError as error:
        raise ConfigurationError([f"config: {path} is not valid TOML: {error}"]) from error


class TomlError(ValueError):
    """The text is not valid TOML; the message explains why."""


def parse_toml(text: bytes) -> dict[str, Any]:
    """Parse untrusted TOML, with a single exception type for all errors.

    Raises:
        TomlError: the text is invalid.
    """
    try:
        return tomllib.loads(text.decode())
    except RecursionError as error:
        raise TomlError("lists or tables are nested too deeply") from error
    except ValueError as error:  # includes too long numbers and invalid UTF-8
        raise TomlError(shortened(str(error))) from error


def _build_settings(model: type[S], command_line: PydanticBaseSettingsSource, from_file: dict[str, Any]) -> S:
    try:
        given = _merge_tables(_merge_tables(from_file, EnvSettingsSource(model)()), command_line())
        return model(**_merge_tables(_defaults_of_groups(model), given))
    except ValidationError as error:
        raise ConfigurationError(_problems_of(error)) from error


def _defaults_of_groups(model: type[S]) -> dict[str, Any]:
    """Return the program's defaults of setting groups, so that setting one value keeps the others."""
    defaults = {
        name: field.get_default(call_default_factory=True, validated_data={})
        for name, field in model.model_fields.items()
    }
    return {
        name: default.model_dump(exclude_unset=True)
        for name, default in defaults.items()
        if isinstance(default, SettingsGroup)
    }


def _merge_tables(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Merge ``above`` over ``below``, table by table."""
    result = dict(below)
    for name, value in above.items():
        old = result.get(name)
        result[name] = (
            _merge_tables(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
        )
    return result


def _unreadable_text(error: SettingsError) -> str:
    """Return an error that names the option or variable whose text is not the required list or table.

    pydantic-settings names only the outermost table of a variable; its cause contains the text.
    """
    text = getattr(error.__cause__, "doc", None)
    variables = [name for name, value in os.environ.items() if name.startswith("NENA_") and value == text]
    field = _FIELD.search(str(error))
    name = next(iter(variables), field[1] if field else "settings")
    return f'{name}: invalid; write a list as ["a", "b"], a table as {{"a": 1}}'


def _problems_of(error: ValidationError) -> list[str]:
    # without the value, which may be a password
    return [f"{path_of(item['loc'])}: {_problem_text(item)}" for item in error.errors()]


def _problem_text(problem: ErrorDetails) -> str:
    if problem["type"] == "extra_forbidden":
        return "unknown setting; --help lists all settings"
    if problem["type"] == "missing":
        return "required; --help lists all settings"
    return words_of(problem)
