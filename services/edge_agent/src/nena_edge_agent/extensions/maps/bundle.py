"""Nav2 maps from fleet control: an archive (zip or tar) of a YAML file and its image."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import re
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Final

from nena_shared.fleet_api.plant import png_size

FILES_LIMIT = 100
"""Maximum number of files that are read from an archive."""
ENTRIES_LIMIT = 1000
"""Maximum number of files in a zip; the header of each takes memory, even if few are read."""
YAML_LIMIT = 64 * 1024
"""Largest YAML file, bytes."""
IMAGE_LIMIT = 256 * 1024 * 1024
"""Largest image, bytes, unpacked."""
UNPACKED_LIMIT = 320 * 1024 * 1024
"""Largest compressed tar, bytes, unpacked."""
PIXELS_LIMIT = 64 * 1024 * 1024
"""Maximum number of pixels: map_server unpacks the image, and a PNG of a few kB may exceed the memory."""
DICTIONARY_LIMIT = 128 * 1024 * 1024
"""Memory limit of the reader of an xz file, bytes."""
IMAGES = (".pgm", ".png", ".bmp")
REQUIRED = ("image", "resolution", "origin")

_NUMBER: Final = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_KEPT: Final = {
    "mode": re.compile("trinary|scale|raw"),
    "resolution": re.compile(_NUMBER),
    "negate": re.compile("0|1|true|false|yes|no|on|off", re.IGNORECASE),
    "occupied_thresh": re.compile(_NUMBER),
    "free_thresh": re.compile(_NUMBER),
}
"""Keys that map_server reads besides image and origin, and their valid values. The file is rewritten with
these only: map_server would follow a second `image` to any file of the robot, or to another machine."""
_ENTRY: Final = re.compile(r"^(?P<key>[a-z_]+)[ \t]*:(?P<value>.*)$", re.MULTILINE)
_ORIGIN: Final = re.compile(
    rf"^origin[ \t]*:\s*(?:\[\s*({_NUMBER})\s*,\s*({_NUMBER})\s*,\s*({_NUMBER})\s*\]"
    rf"|-[ \t]+({_NUMBER})\s+-[ \t]+({_NUMBER})\s+-[ \t]+({_NUMBER})[ \t]*$)",
    re.MULTILINE,
)
_PGM: Final = re.compile(rb"P[25](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s")
_BMP: Final = struct.Struct("<18xii")
"""Width and height in the header of a BMP."""
_ZIP_ENTRY: Final = b"PK\x01\x02"
_PGM_HEAD: Final = 4096
"""Bytes of a PGM searched for its size, including comments."""

_UNPACKERS: Final[Mapping[bytes, Callable[[bytes, int], bytes]]] = {
    b"\x1f\x8b": lambda content, limit: gzip.GzipFile(fileobj=io.BytesIO(content)).read(limit),
    b"BZh": lambda content, limit: bz2.BZ2File(io.BytesIO(content)).read(limit),
    b"\xfd7zXZ": lambda content, limit: lzma.LZMADecompressor(memlimit=DICTIONARY_LIMIT).decompress(
        content, limit
    ),
}
"""Decompressors by the first bytes of a compressed tar; their second argument limits the output, bytes."""

_UNREADABLE: Final = (
    tarfile.TarError,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    OSError,
    ValueError,
    ArithmeticError,
    LookupError,
    RuntimeError,  # passwords, compression methods, nested headers
)
"""Exceptions of the archive readers for damaged or forged archives."""


class BadBundleError(Exception):
    """The content is not a Nav2 map; the text says why."""


@dataclass(frozen=True, slots=True)
class MapBundle:
    """A map as map_server reads it: ``description`` (YAML) names the image ``image_name``."""

    description: str
    image_name: str
    image: bytes

    @classmethod
    def of(cls, content: bytes) -> MapBundle:
        """Read an archive; raises BadBundleError if it is not an archive, or contains no map."""
        try:
            return cls._read_archive(_open_archive(content))
        except _UNREADABLE as error:
            raise BadBundleError(f"the map is not a readable zip or tar archive ({error})") from error

    @classmethod
    def _read_archive(cls, archive: _Zip | _Tar) -> MapBundle:
        named = [each for each in archive.names if each.lower().endswith((".yaml", ".yml"))]
        if len(named) != 1:
            raise BadBundleError(f"the map needs one YAML file in its archive, not {len(named)}")
        try:
            text = archive.read(named[0], YAML_LIMIT).decode().replace("\r\n", "\n")
        except UnicodeDecodeError:
            raise BadBundleError(f"{named[0]} is not text") from None
        entries = _read_entries(named[0], text)
        suffix = PurePosixPath(entries["image"]).suffix.lower()
        path = str(PurePosixPath(named[0]).parent / entries["image"])
        if suffix not in IMAGES or path not in archive.names:
            raise BadBundleError(
                f"{named[0]} names the image '{entries['image']}', which is not in the archive"
            )
        image = archive.read(path, IMAGE_LIMIT)
        _check_size(path, suffix, image)
        name = f"image{suffix}"
        lines = (f"{key}: {value}\n" for key, value in {**entries, "image": name}.items())
        return cls("".join(lines), name, image)


def _read_entries(name: str, text: str) -> dict[str, str]:
    """Return the entries of a YAML file that map_server may read.

    Raises:
        BadBundleError: a key is missing or duplicate, or a value is invalid.
    """
    lines = [(found["key"], _read_value(found["value"])) for found in _ENTRY.finditer(text)]
    entries = dict(lines)
    for key in REQUIRED:
        if key not in entries or (key == "image" and not entries[key]):
            raise BadBundleError(f"{name} has no '{key}'")
    for key, value in lines:
        if key in _KEPT and not _KEPT[key].fullmatch(value):
            raise BadBundleError(f"{name}: '{key}' cannot be '{value[:100]}'")
    origin = _ORIGIN.search(text)
    if origin is None:
        raise BadBundleError(f"{name}: 'origin' needs three numbers")
    numbers = ", ".join(group for group in origin.groups() if group)
    return {
        key: f"[{numbers}]" if key == "origin" else value
        for key, value in entries.items()
        if key in _KEPT or key in REQUIRED
    }


def _read_value(text: str) -> str:
    return text.partition("#")[0].strip().strip("'\"")


def _check_size(name: str, suffix: str, image: bytes) -> None:
    """Check the number of pixels of an image before map_server allocates memory for them.

    Raises:
        BadBundleError: it is not such an image, or has too many pixels.
    """
    size = _image_size(suffix, image)
    if size is None:
        raise BadBundleError(f"{name} is not a {suffix[1:].upper()} image")
    width, height = size
    if width * height > PIXELS_LIMIT:
        raise BadBundleError(f"{name} has {width} x {height} pixels; the maximum is {PIXELS_LIMIT}")


def _image_size(suffix: str, image: bytes) -> tuple[int, int] | None:
    if suffix == ".png":
        return png_size(image)
    if suffix == ".pgm":
        found = _PGM.match(image[:_PGM_HEAD])
        return (int(found[1]), int(found[2])) if found else None
    if not image.startswith(b"BM") or len(image) < _BMP.size:
        return None
    width, height = _BMP.unpack_from(image)
    # A negative height means rows from the top.
    return abs(width), abs(height)


class _Zip:
    def __init__(self, file: zipfile.ZipFile) -> None:
        self._file = file
        entries = (each for each in file.infolist()[:FILES_LIMIT] if not each.is_dir())
        self._read_entries = {entry.filename.removeprefix("./"): entry for entry in entries}
        self.names = list(self._read_entries)

    def read(self, name: str, limit: int) -> bytes:
        entry = self._read_entries[name]
        # zipfile limits the output of deflate only; a block of bzip2 or LZMA is unpacked whole.
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BadBundleError(f"{name} has an unsupported compression; use deflate")
        with self._file.open(entry) as file:
            return _limit_content(file.read(limit + 1), name, limit)


class _Tar:
    def __init__(self, file: tarfile.TarFile) -> None:
        self._file = file
        self._members = {
            each.name.removeprefix("./"): each for each, _ in zip(file, range(FILES_LIMIT), strict=False)
        }
        self.names = [name for name, each in self._members.items() if each.isfile()]

    def read(self, name: str, limit: int) -> bytes:
        file = self._file.extractfile(self._members[name])
        return _limit_content(file.read(limit + 1) if file else b"", name, limit)


def _open_archive(content: bytes) -> _Zip | _Tar:
    if zipfile.is_zipfile(io.BytesIO(content)):
        # Before ZipFile, which reads the headers of all files at once.
        if content.count(_ZIP_ENTRY) > ENTRIES_LIMIT:
            raise BadBundleError(f"the map's archive has more than {ENTRIES_LIMIT} files")
        return _Zip(zipfile.ZipFile(io.BytesIO(content)))
    for first, unpack in _UNPACKERS.items():
        if content.startswith(first):
            # Not by tarfile: to find the next file it unpacks all before it, without a limit.
            content = _limit_content(unpack(content, UNPACKED_LIMIT + 1), "the map's archive", UNPACKED_LIMIT)
    return _Tar(tarfile.open(fileobj=io.BytesIO(content), mode="r:"))


def _limit_content(content: bytes, name: str, limit: int) -> bytes:
    if len(content) > limit:
        raise BadBundleError(f"{name} has more than {limit} bytes")
    return content
