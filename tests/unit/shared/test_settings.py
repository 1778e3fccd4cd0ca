from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import pytest
from pydantic import BaseModel, Field, ValidationError

from nena_shared.settings import (
    ConfigurationError,
    MqttSettings,
    ServiceSettings,
    SettingsGroup,
    TopicPrefix,
    TopLevelSettings,
    load,
    settings_of,
    settings_with,
)
from nena_shared.web.settings import HttpSettings


class Robot(SettingsGroup):
    name: str = Field("r1", description="What the robot is called.")


class Example(ServiceSettings):
    """A program's settings."""

    colour: str = Field("default", description="Any colour.")
    loud: bool = Field(default=False, description="Whether it beeps.")
    robot: Robot = Field(default_factory=Robot, description="The robot.")
    http: HttpSettings = Field(default_factory=lambda: HttpSettings(port=8080), description="The door.")


class Lamps(TopLevelSettings):
    """The lamps."""

    lamps: tuple[Robot, ...] = Field((), max_length=2, description="Lamps.")


class Lighting:
    """An extension with settings beside those of its program."""

    Settings: ClassVar[type[BaseModel]] = Lamps


class Horn:
    """An extension with a group of settings."""

    Settings: ClassVar[type[BaseModel]] = Robot


UNREADABLE = (
    b"colour =\n",
    b"\xff\xfe",
    b"a = " + b"[" * 500,
    b"a = " + b"{a = " * 500,
    b"a = " + b"1" * 5000,
    b"a = {%b = 1, %b = 2}" % (b"x" * 10_000, b"x" * 10_000),
)
"""No TOML; more than one of them is refused by Python and not by its TOML library."""


@pytest.fixture
def toml(tmp_path: Path) -> Path:
    return tmp_path / "settings.toml"


def read(*argv: str) -> Example:
    return load(Example, argv, program="example", description="Shows settings.")


def problems(*argv: str) -> tuple[str, ...]:
    with pytest.raises(ConfigurationError) as caught:
        read(*argv)
    return caught.value.problems


def test_environment_is_over_file_and_command_line_over_both(
    toml: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    toml.write_text('colour = "file"\n[mqtt]\nhost = "file"\nport = 2000\nkeep_alive = 30\n')
    monkeypatch.setenv("NENA_MQTT__HOST", "environment")
    monkeypatch.setenv("NENA_MQTT__PORT", "3000")

    mqtt = read(f"--config={toml}", "--mqtt.port", "4000").mqtt

    assert (mqtt.keep_alive, mqtt.host, mqtt.port) == (30, "environment", 4000)


def test_help_names_every_setting(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        read("--help")
    text = capsys.readouterr().out

    assert caught.value.code == 0
    for option in _options(Example):
        assert f"--{option}" in text
    for words in ("--config FILE", "Any colour.", "What the robot is called.", "NENA_MQTT__HOST"):
        assert words in text


def _options(model: type[BaseModel], prefix: str = "") -> list[str]:
    options = []
    for name, field in model.model_fields.items():
        assert field.description, f"{prefix}{name} needs a description"
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            options += _options(kind, f"{prefix}{name}.")
        else:
            options.append(prefix + name)
    return options


def test_a_setting_named_version_needs_a_value(capsys: pytest.CaptureFixture[str]) -> None:
    class OfRobot(ServiceSettings):
        version: str = "2.1.0"

    assert load(OfRobot, ["--version", "3.0.0"], program="nena-shared", description="").version == "3.0.0"
    for options in (["-V"], ["--version"], ["--version", "--log.level", "info"]):
        with pytest.raises(SystemExit):
            load(OfRobot, options, program="nena-shared", description="")
        assert capsys.readouterr().out.startswith("nena-shared ")


@pytest.mark.parametrize("option", [["--color", "red"], ["--mqtt.hots", "x"], ["--col", "red"], ["red"]])
def test_unknown_option_is_refused_with_its_name(
    option: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        read(*option)

    assert caught.value.code == 2
    assert capsys.readouterr().err.endswith(f"example: error: unrecognized arguments: {' '.join(option)}\n")


def test_unknown_name_in_the_file_is_refused(toml: Path) -> None:
    toml.write_text('color = "red"\n[mqtt]\nhots = "x"\n')

    assert sorted(problems("--config", str(toml))) == [
        "color: unknown setting; --help lists all settings",
        "mqtt.hots: unknown setting; --help lists all settings",
    ]


def test_setting_without_a_default_is_required() -> None:
    class Needy(ServiceSettings):
        plant: Path

    with pytest.raises(ConfigurationError) as caught:
        load(Needy, [], program="needy", description="Needs a plant.")

    assert caught.value.problems == ("plant: required; --help lists all settings",)


@pytest.mark.parametrize("host", ["tcp://broker", "mqtt://broker:1883", "broker:1883", "broker/"])
def test_a_host_is_no_url(host: str) -> None:
    (problem,) = problems("--mqtt.host", host)
    assert problem.startswith("mqtt.host: must be a host name or an address alone")


@pytest.mark.parametrize("host", ["broker", "10.0.0.7", "::1", "fe80::1%eth0", "broker.example.org"])
def test_names_and_addresses_are_hosts(host: str) -> None:
    assert read("--mqtt.host", host).mqtt.host == host


def test_invalid_value_is_named_but_not_shown() -> None:
    found = problems("--mqtt.port", "seventy thousand", "--log.level", "loud")

    assert sorted(problem.split(":")[0] for problem in found) == ["log.level", "mqtt.port"]
    assert "seventy" not in str(found)


def test_file_that_is_not_there(toml: Path) -> None:
    assert problems("--config", str(toml)) == (f"config: cannot read {toml}: No such file or directory",)


@pytest.mark.parametrize("content", UNREADABLE)
def test_file_that_is_no_toml(toml: Path, content: bytes) -> None:
    toml.write_bytes(content)

    (problem,) = problems("--config", str(toml))
    assert problem.startswith(f"config: {toml} is not valid TOML: ")
    assert len(problem) < 1000


def test_bad_json_in_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NENA_MQTT", "{")

    assert problems()[0].startswith("NENA_MQTT: invalid")


def test_json_in_the_environment_that_is_nested_deep(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NENA_MQTT", '{"a":' * 20_000)

    assert problems() == ("settings: a list or table in the environment or an option is nested too deeply",)


def test_password_file_is_read_without_the_line_break(tmp_path: Path) -> None:
    file = tmp_path / "password"
    file.write_text("open sesame\n")

    assert MqttSettings(password_file=file).secret() == "open sesame"


def test_password_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NENA_MQTT__PASSWORD", "open sesame")
    settings = read()

    assert settings.mqtt.secret() == "open sesame"
    assert "sesame" not in f"{settings} {settings!r} {settings.model_dump_json()}"


def test_password_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"mqtt\.password_file: .*No such file"):
        MqttSettings(password_file=tmp_path / "none").secret()


def test_password_file_that_is_empty(tmp_path: Path) -> None:
    file = tmp_path / "password"
    file.write_text("\n")

    with pytest.raises(ConfigurationError, match=r"mqtt\.password_file: .* is empty"):
        MqttSettings(password_file=file).secret()


class Prefixed(SettingsGroup):
    prefix: TopicPrefix


@pytest.mark.parametrize("prefix", ["", "/uagv", "uagv/", "a/+/b", "a/#", "x" * 201])
def test_bad_topic_prefix(prefix: str) -> None:
    with pytest.raises(ValidationError):
        Prefixed(prefix=prefix)


class Tour(ServiceSettings):
    """Settings with a list of tables."""

    stops: tuple[Robot, ...] = Field((), description="Where it stops.")
    robot: Robot = Field(default_factory=Robot, description="The robot.")


@pytest.mark.parametrize("text", ["nan", "[", '{"name": '])
def test_unreadable_list_is_reported_by_name(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    with pytest.raises(ConfigurationError) as by_option:
        load(Tour, ["--stops", text], program="tour", description="")
    monkeypatch.setenv("NENA_STOPS", text)
    with pytest.raises(ConfigurationError) as by_variable:
        load(Tour, [], program="tour", description="")

    for caught, name in ((by_option, "stops"), (by_variable, "NENA_STOPS")):
        (problem,) = caught.value.problems
        assert problem.startswith((f"{name}: invalid", f"{name}.0: "))


def test_extensions_have_a_group_or_stand_beside_the_settings_of_the_program(toml: Path) -> None:
    toml.write_text('[horn]\nname = "h"\n[[lamps]]\nname = "a"\n[[lamps]]\nname = "b"\n')
    model = settings_with(Example, {"light": Lighting, "horn": Horn})
    settings = load(model, ("--config", str(toml)), program="example", description="Shows settings.")
    (lamps, horn) = (settings_of(settings, "light", Lighting), settings_of(settings, "horn", Horn))
    assert isinstance(lamps, Lamps)
    assert [lamp.name for lamp in lamps.lamps] == ["a", "b"]
    assert horn == Robot(name="h")
    assert settings_of(read(), "horn", Horn) == Robot()
    toml.write_text("[[lamps]]\n" * 3)
    with pytest.raises(ConfigurationError, match="lamps"):
        load(model, ("--config", str(toml)), program="example", description="Shows settings.")
