"""Maps of Nav2 as fleet control brings them: an archive (zip or tar) of a YAML file and its image."""

from __future__ import annotations

import io
import re
import tarfile
import zipfile
from dataclasses import dataclass
from pathlib import PurePosixPath

FILES_LIMIT = 100
"""Files of an archive that are looked at."""
YAML_LIMIT = 64 * 1024
"""Largest YAML file, bytes."""
IMAGE_LIMIT = 512 * 1024 * 1024
"""Largest image, bytes, unpacked."""
IMAGES = (".pgm", ".png", ".bmp")
REQUIRED = ("image", "resolution", "origin")
_ENTRY = re.compile(r"^(?P<key>[a-z_]+)\s*:\s*(?P<value>.*?)\s*(#.*)?$", re.MULTILINE)
_IMAGE = re.compile(r"^image\s*:.*$", re.MULTILINE)


class BadBundleError(Exception):
    """The content is no map of Nav2; the text says why."""


@dataclass(frozen=True, slots=True)
class MapBundle:
    """A map as map_server reads it: ``description`` (YAML) names the image ``image_name``, beside it."""

    description: str
    image_name: str
    image: bytes

    @classmethod
    def of(cls, content: bytes) -> MapBundle:
        """Read an archive.

        Raises:
            BadBundleError: it is none, or holds no map.

        """
        archive = _opened(content)
        named = [each for each in archive.names if each.lower().endswith((".yaml", ".yml"))]
        if len(named) != 1:
            message = f"the map needs one YAML file in its archive, not {len(named)}"
            raise BadBundleError(message)
        try:
            text = archive.read(named[0], YAML_LIMIT).decode()
        except UnicodeDecodeError:
            message = f"{named[0]} is no text"
            raise BadBundleError(message) from None
        entries = {found["key"]: found["value"].strip("'\"") for found in _ENTRY.finditer(text)}
        if missing := [key for key in REQUIRED if not entries.get(key)]:
            message = f"{named[0]} has no '{missing[0]}'"
            raise BadBundleError(message)
        suffix = PurePosixPath(entries["image"]).suffix.lower()
        path = str(PurePosixPath(named[0]).parent / entries["image"])
        if suffix not in IMAGES or path not in archive.names:
            message = f"{named[0]} names the image '{entries['image']}', which is not in the archive"
            raise BadBundleError(message)
        name = f"image{suffix}"
        return cls(_IMAGE.sub(f"image: {name}", text, count=1), name, archive.read(path, IMAGE_LIMIT))


class _Zip:
    def __init__(self, file: zipfile.ZipFile) -> None:
        self._file = file
        entries = (each for each in file.infolist()[:FILES_LIMIT] if not each.is_dir())
        self._entries = {each.filename.removeprefix("./"): each for each in entries}
        self.names = list(self._entries)

    def read(self, name: str, limit: int) -> bytes:
        with self._file.open(self._entries[name]) as file:
            return _limited(file.read(limit + 1), name, limit)


class _Tar:
    def __init__(self, file: tarfile.TarFile) -> None:
        self._file = file
        self._members = {
            each.name.removeprefix("./"): each for each, _ in zip(file, range(FILES_LIMIT), strict=False)
        }
        self.names = [name for name, each in self._members.items() if each.isfile()]

    def read(self, name: str, limit: int) -> bytes:
        file = self._file.extractfile(self._members[name])
        return _limited(file.read(limit + 1) if file else b"", name, limit)


def _opened(content: bytes) -> _Zip | _Tar:
    try:
        if zipfile.is_zipfile(io.BytesIO(content)):
            return _Zip(zipfile.ZipFile(io.BytesIO(content)))
        return _Tar(tarfile.open(fileobj=io.BytesIO(content)))
    except (tarfile.TarError, zipfile.BadZipFile, EOFError, OSError) as error:
        message = f"the map is no zip or tar archive ({error})"
        raise BadBundleError(message) from error


def _limited(content: bytes, name: str, limit: int) -> bytes:
    if len(content) > limit:
        message = f"{name} has more than {limit} bytes"
        raise BadBundleError(message)
    return content
