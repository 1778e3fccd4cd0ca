"""Archives with Nav2 maps, as fleet control has robots download them."""

from __future__ import annotations

import io
import tarfile
import zipfile

RESOLUTION = 0.5


def image(width: int = 40, height: int = 20) -> bytes:
    """Return a PGM of an empty room with walls around it."""
    inside = b"\x00" + b"\xfe" * (width - 2) + b"\x00"
    rows = b"\x00" * width + inside * (height - 2) + b"\x00" * width
    return f"P5\n{width} {height}\n255\n".encode() + rows


def description(name: str = "attic.pgm", *, x: float = -5.0, y: float = -5.0) -> bytes:
    """Return the YAML file of a map."""
    text = f"image: {name}\nresolution: {RESOLUTION}\norigin: [{x}, {y}, 0.0]\nnegate: 0\n"
    return (text + "occupied_thresh: 0.65\nfree_thresh: 0.25\n").encode()


def zipped(files: dict[str, bytes]) -> bytes:
    """Return a zip of the files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in files.items():
            archive.writestr(name, part)
    return content.getvalue()


def tarred(files: dict[str, bytes], mode: str = "w:gz") -> bytes:
    """Return a tar of the files."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode=mode) as archive:  # type: ignore[call-overload]
        for name, part in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(part)
            archive.addfile(entry, io.BytesIO(part))
    return content.getvalue()


def attic() -> bytes:
    """Return the archive of a map."""
    return zipped({"attic.yaml": description(), "attic.pgm": image()})
