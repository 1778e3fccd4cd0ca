"""Compiles generated sources into libraries for rclpy, and puts them beside those of the wheels."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from nena_robot_simulator.interfaces.sources import DEPENDENCIES, Sources

LONGEST_COMPILATION = 300.0
"""Seconds for one library; it takes about five."""
_KINDS = {
    "rosidl_generator_c": ("generator_c",),
    "rosidl_typesupport_fastrtps_c": ("generator_c", "typesupport_fastrtps_c"),
    "rosidl_typesupport_introspection_c": ("generator_c", "typesupport_introspection_c"),
    "rosidl_typesupport_c": ("generator_c", "typesupport_c"),
    "rosidl_generator_py": ("generator_c", "typesupport_c", "generator_py"),
}
"""For each generator, which libraries of other packages what it makes is linked with."""
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
    """The compiler refuses; ``output`` is what it said last."""

    def __init__(self, library: str, output: str) -> None:
        super().__init__(f"{library} cannot be compiled: {output}")
        self.library = library
        self.output = output


def missing_tool() -> str | None:
    """Say what a compilation lacks on this machine; None: nothing."""
    for tool in ("gcc", "g++"):
        if shutil.which(tool) is None:
            return f"there is no {tool} (apt-get install g++)"
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        return f"there is no {header} (apt-get install python3-dev)"
    return None


def build(sources: Sources, folder: Path) -> None:
    """Compile all libraries into ``folder``; the package of ``sources`` can be installed from there.

    Raises:
        CompilationError: the compiler refuses.

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
    done = subprocess.run(  # noqa: S603 - the compiler, and paths that this program has made
        command, capture_output=True, text=True, timeout=LONGEST_COMPILATION, check=False
    )
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
    """Put libraries and Python package where the wheels have theirs; give the package's folder.

    ``mark`` is left in the package. A program that runs keeps what it has loaded.
    """
    package = Path(sysconfig.get_path("purelib")) / sources.package
    for library in built.glob("lib*.so"):
        _put(library, Path(sys.prefix) / "lib" / library.name)
    python = sources.of("rosidl_generator_py") / sources.package
    _put(built / _library_name(sources.package, "rosidl_generator_py"), package)
    for path in sorted(python.rglob("*.py")):
        _put(path, package / path.relative_to(python))
    (package / "__init__.py").write_text(f'"""{mark}"""\n', encoding="utf-8")
    return package


def _put(path: Path, target: Path) -> None:
    """Copy a file into its place at once, a folder as target gives it its name."""
    place = target / path.name if target.suffix not in {".so", ".py"} else target
    place.parent.mkdir(parents=True, exist_ok=True)
    fresh = place.with_name(place.name + ".new")
    shutil.copyfile(path, fresh)
    fresh.replace(place)
