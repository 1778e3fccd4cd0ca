"""Turns interface definitions into C and Python sources, by the generators that the ROS wheels bring."""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""What rmw_fastrtps asks for: the one writes messages, the other describes them."""
DEPENDENCIES = (
    "action_msgs",
    "builtin_interfaces",
    "geometry_msgs",
    "service_msgs",
    "std_msgs",
    "unique_identifier_msgs",
)
"""Packages of the wheels that definitions may build on, with those that these build on."""
WITH_HEADER = ("rosidl_generator_c", "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""Generators whose sources include a header that a build of a ROS workspace writes."""


@dataclass(frozen=True, slots=True)
class Sources:
    """Generated files of ``package``, in a folder for each generator below ``folder``."""

    package: str
    folder: Path

    def of(self, generator: str) -> Path:
        """Give the folder of what ``generator`` has made."""
        return self.folder / generator


def generate(definitions: Path, folder: Path) -> Sources:
    """Generate the package that the folder ``definitions`` is named for, with its actions."""
    sources = Sources(definitions.name, folder)
    # The generators find each other's parts by this variable, and tell what they read on the output.
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    with contextlib.redirect_stdout(io.StringIO()):
        _Generators(sources, _idl_of(definitions, folder / "idl" / definitions.name)).run()
    return sources


def _idl_of(definitions: Path, folder: Path) -> list[str]:
    """Write each definition as IDL; give what generators take them by."""
    from rosidl_adapter.action import convert_action_to_idl  # noqa: PLC0415 - heavy, and only needed here

    tuples = []
    for path in sorted(definitions.glob("action/*.action")):
        convert_action_to_idl(definitions, definitions.name, path.relative_to(definitions), folder / "action")
        tuples.append(f"{folder}:action/{path.stem}.idl")
    return tuples


class _Generators:
    """Runs each generator with a file of arguments, as the build of a ROS workspace does."""

    def __init__(self, sources: Sources, idl: list[str]) -> None:
        self._sources = sources
        self._idl = idl
        self._share = Path(sys.prefix) / "share"

    def run(self) -> None:
        from rosidl_generator_c import generate_c  # noqa: PLC0415 - heavy, and only needed here
        from rosidl_generator_py.generate_py_impl import generate_py  # noqa: PLC0415
        from rosidl_generator_type_description import generate_type_hash  # noqa: PLC0415
        from rosidl_typesupport_c import generate_c as generate_dispatch  # noqa: PLC0415
        from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c  # noqa: PLC0415
        from rosidl_typesupport_introspection_c import generate_c as generate_introspection  # noqa: PLC0415

        generate_type_hash(self._arguments("rosidl_generator_type_description"))
        generate_c(self._arguments("rosidl_generator_c"))
        generate_typesupport_fastrtps_c(self._arguments("rosidl_typesupport_fastrtps_c"))
        generate_introspection(self._arguments("rosidl_typesupport_introspection_c"))
        generate_dispatch(self._arguments("rosidl_typesupport_c"), list(TYPE_SUPPORTS))
        generate_py(self._arguments("rosidl_generator_py"), ["rosidl_typesupport_c"])
        for generator in WITH_HEADER:
            self._write_header(generator)

    def _arguments(self, generator: str) -> str:
        """Write the file of arguments for a generator and give its path."""
        package, output = self._sources.package, self._sources.of(generator) / self._sources.package
        output.mkdir(parents=True)
        hashes = self._sources.of("rosidl_generator_type_description") / package
        relative = [each.rsplit(":", 1)[1] for each in self._idl]
        arguments = {
            "package_name": package,
            "output_dir": str(output),
            "template_dir": str(self._share / generator / "resource"),
            "idl_tuples": self._idl,
            "target_dependencies": [],
            "ros_interface_files": [],
            "include_paths": [f"{each}:{self._share / each}" for each in DEPENDENCIES],
        }
        if generator != "rosidl_generator_type_description":
            arguments["type_description_tuples"] = [
                f"{each}:{(hashes / each).with_suffix('.json')}" for each in relative
            ]
        path = self._sources.folder / f"{generator}.json"
        path.write_text(json.dumps(arguments), encoding="utf-8")
        return str(path)

    def _write_header(self, generator: str) -> None:
        """Define what is put before each symbol as nothing: with gcc all of them are visible anyway."""
        package = self._sources.package
        folder = self._sources.of(generator) / package / "msg"
        folder.mkdir()
        macros = (f"{generator.upper()}_{use}_{package}" for use in ("PUBLIC", "EXPORT", "IMPORT"))
        text = "".join(f"#define {macro}\n" for macro in macros)
        (folder / f"{generator}__visibility_control.h").write_text(text, encoding="utf-8")
