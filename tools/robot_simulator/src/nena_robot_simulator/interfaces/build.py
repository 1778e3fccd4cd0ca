"""Generate C and Python sources from interface definitions, and compile them."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""The type supports of rmw_fastrtps: one serialises messages, the other describes them."""
DEPENDENCIES = (
    "action_msgs",
    "builtin_interfaces",
    "geometry_msgs",
    "nav_msgs",
    "service_msgs",
    "std_msgs",
    "unique_identifier_msgs",
)
"""Packages of the wheels that definitions may use, including indirect dependencies."""
WITH_HEADER = ("rosidl_generator_c", "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""Generators whose sources include a header written by the build of a ROS workspace."""


@dataclass(frozen=True, slots=True)
class Sources:
    """Generated files of ``package``, in a folder for each generator below ``folder``."""

    package: str
    folder: Path

    def of(self, generator: str) -> Path:
        """Return the output folder of ``generator``."""
        return self.folder / generator


def generate(definitions: Path, folder: Path) -> Sources:
    """Generate the package named like the folder ``definitions``: messages, services and actions."""
    sources = Sources(definitions.name, folder)
    # The generators find each other by this variable, and print what they read.
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    with contextlib.redirect_stdout(io.StringIO()):
        _Generators(sources, _idl_of(definitions, folder / "idl" / definitions.name)).run()
    return sources


def _idl_of(definitions: Path, folder: Path) -> list[str]:
    """Write each definition as IDL; return the generators' names for them."""
    from rosidl_adapter.action import convert_action_to_idl  # noqa: PLC0415 - heavy, and only needed here
    from rosidl_adapter.msg import convert_msg_to_idl  # noqa: PLC0415
    from rosidl_adapter.srv import convert_srv_to_idl  # noqa: PLC0415

    converters = {"action": convert_action_to_idl, "msg": convert_msg_to_idl, "srv": convert_srv_to_idl}
    tuples = []
    for kind, convert in converters.items():
        for path in sorted(definitions.glob(f"{kind}/*.{kind}")):
            convert(definitions, definitions.name, path.relative_to(definitions), folder / kind)
            tuples.append(f"{folder}:{kind}/{path.stem}.idl")
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
        """Write the argument file of a generator; return its path."""
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
        """Define the visibility macros as empty; with gcc all symbols are visible anyway."""
        package = self._sources.package
        folder = self._sources.of(generator) / package / "msg"
        folder.mkdir(exist_ok=True)
        macros = (f"{generator.upper()}_{use}_{package}" for use in ("PUBLIC", "EXPORT", "IMPORT"))
        text = "".join(f"#define {macro}\n" for macro in macros)
        (folder / f"{generator}__visibility_control.h").write_text(text, encoding="utf-8")


LONGEST_COMPILATION = 1200.0
"""Timeout per library, seconds; it takes about five, and some minutes on an overloaded computer."""
_KINDS = {
    "rosidl_generator_c": ("generator_c",),
    "rosidl_typesupport_fastrtps_c": ("generator_c", "typesupport_fastrtps_c"),
    "rosidl_typesupport_introspection_c": ("generator_c", "typesupport_introspection_c"),
    "rosidl_typesupport_c": ("generator_c", "typesupport_c"),
    "rosidl_generator_py": ("generator_c", "typesupport_c", "generator_py"),
}
"""Libraries of other packages to link, by generator."""
_RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
    "rcutils",
    "rmw",
    "fastcdr",
)


class CompilationError(Exception):
    """The compiler failed; ``output`` is the end of its output."""

    def __init__(self, library: str, output: str) -> None:
        super().__init__(f"{library} cannot be compiled: {output}")
        self.library = library
        self.output = output


def missing_tool() -> str | None:
    """Return the missing build tool, or None."""
    for tool in ("gcc", "g++"):
        if shutil.which(tool) is None:
            return f"{tool} is missing (apt-get install g++)"
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        return f"{header} is missing (apt-get install python3-dev)"
    return None


def build(sources: Sources, folder: Path) -> None:
    """Compile all libraries of ``sources`` into ``folder``.

    Raises:
        CompilationError: the compiler failed.
    """
    folder.mkdir()
    base = _compile(sources, "rosidl_generator_c", folder, ())
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        others = [
            pool.submit(_compile, sources, generator, folder, (base,))
            for generator in _KINDS
            if generator.startswith("rosidl_typesupport")
        ]
        libraries = [each.result() for each in others]
    _compile(sources, "rosidl_generator_py", folder, (base, *libraries))


def _library_name(package: str, generator: str) -> str:
    if generator == "rosidl_generator_py":
        return f"{package}_s__rosidl_typesupport_c.so"
    return f"lib{package}__{generator}.so"


def _compile(sources: Sources, generator: str, folder: Path, own: tuple[Path, ...]) -> Path:
    """Compile one library; ``own`` are those of the same package that it needs."""
    target = folder / _library_name(sources.package, generator)
    files = sorted(sources.of(generator).rglob("*.c")) + sorted(sources.of(generator).rglob("*.cpp"))
    language = "g++" if files[0].suffix == ".cpp" else "gcc"
    command = [
        language,
        *("-shared", "-fPIC", "-O1", "-w", "-o", str(target), f"-Wl,-soname,{target.name}"),
        *(f"-I{path}" for path in _includes(sources)),
        *map(str, files),
        *map(str, own),
        *_linked(generator),
    ]
    try:
        done = subprocess.run(  # noqa: S603 - the compiler, and paths that this program has made
            command, capture_output=True, text=True, timeout=LONGEST_COMPILATION, check=False
        )
    except subprocess.TimeoutExpired as error:
        text = f"not compiled within {LONGEST_COMPILATION:g} s; try again when the computer is less busy"
        raise CompilationError(target.name, text) from error
    if done.returncode:
        raise CompilationError(target.name, done.stderr[-2000:])
    return target


def _includes(sources: Sources) -> Iterator[Path]:
    import numpy as np  # noqa: PLC0415 - comes with the ROS wheels, and is only needed here

    yield from (sources.of(generator) for generator in _KINDS)
    include = Path(sys.prefix) / "include"
    yield from (include, *(path for path in sorted(include.iterdir()) if path.is_dir()))
    yield from (Path(sysconfig.get_path("include")), Path(np.get_include()))


def _linked(generator: str) -> Iterator[str]:
    folder = Path(sys.prefix) / "lib"
    yield f"-L{folder}"
    names = [f"{package}__rosidl_{kind}" for kind in _KINDS[generator] for package in DEPENDENCIES]
    yield from (f"-l{name}" for name in (*names, *_RUNTIME) if (folder / f"lib{name}.so").exists())


def install(sources: Sources, built: Path, mark: str) -> Path:
    """Install libraries and Python package beside those of the wheels; return the package's folder.

    ``mark`` is stored in the package. Running programs keep what they have loaded.
    """
    package = Path(sysconfig.get_path("purelib")) / sources.package
    for library in built.glob("lib*.so"):
        _put(library, Path(sys.prefix) / "lib" / library.name)
    python = sources.of("rosidl_generator_py") / sources.package
    _put(built / _library_name(sources.package, "rosidl_generator_py"), package)
    for path in sorted(python.rglob("*.py")):
        _put(path, package / path.relative_to(python))
    fresh = package / "__init__.py.new"
    fresh.write_text(f'"""{mark}"""\n', encoding="utf-8")
    fresh.replace(package / "__init__.py")
    return package


def _put(path: Path, target: Path) -> None:
    """Copy a file atomically; a folder as target keeps the file's name."""
    place = target / path.name if target.suffix not in {".so", ".py"} else target
    place.parent.mkdir(parents=True, exist_ok=True)
    fresh = place.with_name(place.name + ".new")
    shutil.copyfile(path, fresh)
    fresh.replace(place)
