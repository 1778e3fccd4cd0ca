"""Archives of maps: what is taken, and why others are not."""

from __future__ import annotations

import io
import struct
import time
import zipfile
import zlib
from collections.abc import Callable
from functools import partial

import pytest

from nena_edge_agent.extensions.maps import bundle as map_bundle
from nena_edge_agent.extensions.maps.bundle import BadBundleError, MapBundle
from support.map_archives import description, image, tarred, zipped

FILES = {"attic.yaml": description(), "attic.pgm": image()}


PACKS = [zipped, tarred, *(partial(tarred, mode=each) for each in ("w", "w:bz2", "w:xz"))]


@pytest.mark.parametrize("pack", PACKS)
@pytest.mark.parametrize("folder", ["", "maps/", "./"])
def test_the_yaml_file_names_the_image_next_to_it(
    pack: Callable[[dict[str, bytes]], bytes], folder: str
) -> None:
    bundle = MapBundle.of(pack({f"{folder}{name}": part for name, part in FILES.items()}))
    assert (bundle.image_name, bundle.image) == ("image.pgm", image())
    assert bundle.description == description("image.pgm").decode()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"walls", "not a readable zip or tar"),
        (zipped({"attic.pgm": image()}), "one YAML file in its archive, not 0"),
        (zipped({**FILES, "other.yml": description()}), "one YAML file in its archive, not 2"),
        (zipped({"attic.yaml": description()}), "which is not in the archive"),
        (zipped({"attic.yaml": description("../../etc/x.pgm")}), "which is not in the archive"),
        (zipped({"attic.yaml": b"image: attic.pgm\norigin: [0, 0, 0]\n", "attic.pgm": b""}), "'resolution'"),
        (zipped({"attic.yaml": b"\xff\xfe"}), "not text"),
        (zipped({"attic.yaml": description("attic.sh"), "attic.sh": b""}), "not in the archive"),
    ],
)
def test_an_invalid_map_is_refused_with_the_reason(content: bytes, reason: str) -> None:
    with pytest.raises(BadBundleError, match=reason):
        MapBundle.of(content)


def test_a_small_archive_of_a_huge_image_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_bundle, "IMAGE_LIMIT", 1000)
    huge = zipped({**FILES, "attic.pgm": bytes(100_000)})
    assert len(huge) < 1000
    with pytest.raises(BadBundleError, match=r"attic\.pgm has more than 1000 bytes"):
        MapBundle.of(huge)


def attic(text: bytes = description(), picture: bytes = image(), suffix: str = "pgm") -> bytes:
    return zipped({"attic.yaml": text, f"attic.{suffix}": picture})


@pytest.mark.parametrize("mode", ["w:gz", "w:bz2", "w:xz"])
def test_a_small_tar_that_unpacks_to_a_huge_one_is_refused(
    mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever the map is: what comes before it is unpacked, too."""
    monkeypatch.setattr(map_bundle, "UNPACKED_LIMIT", 50_000)
    huge = tarred({"zeros": bytes(100_000), **FILES}, mode)
    assert len(huge) < 1000
    with pytest.raises(BadBundleError, match="the map's archive has more than 50000 bytes"):
        MapBundle.of(huge)


def test_a_zip_of_more_files_than_a_map_has_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_bundle, "ENTRIES_LIMIT", 3)
    with pytest.raises(BadBundleError, match="more than 3 files"):
        MapBundle.of(zipped({**FILES, **{f"{number}.txt": b"" for number in range(3)}}))


def png(width: int, height: int) -> bytes:
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))


def bmp(width: int, height: int) -> bytes:
    return b"BM" + bytes(12) + struct.pack("<Iii", 40, width, height)


@pytest.mark.parametrize(
    ("suffix", "picture"),
    [
        ("png", png(100_000, 100_000)),
        ("bmp", bmp(100_000, -100_000)),
        ("pgm", b"P5 # as GIMP writes it\n100000 100000\n255\n"),
        ("pgm", b"P2\n# a\n# b\n100000\n100000 255\n"),
    ],
)
def test_a_small_image_of_more_pixels_than_a_robot_has_memory_for_is_refused(
    suffix: str, picture: bytes
) -> None:
    with pytest.raises(BadBundleError, match="100000 x 100000 pixels"):
        MapBundle.of(attic(description(f"attic.{suffix}"), picture, suffix))


@pytest.mark.parametrize(("suffix", "picture"), [("png", png(400, 300)), ("bmp", bmp(400, 300))])
def test_other_image_formats_are_accepted(suffix: str, picture: bytes) -> None:
    assert MapBundle.of(attic(description(f"attic.{suffix}"), picture, suffix)).image == picture


@pytest.mark.parametrize("suffix", ["png", "bmp", "pgm"])
def test_an_invalid_image_is_refused(suffix: str) -> None:
    with pytest.raises(BadBundleError, match=f"not a {suffix.upper()} image"):
        MapBundle.of(attic(description(f"attic.{suffix}"), b"#!/bin/sh" + b"\n " * 10_000, suffix))


@pytest.mark.parametrize("space", [b" ", b"\t", b" #", b"\n", b"a"])
def test_a_description_of_spaces_is_read_at_once(space: bytes) -> None:
    text = b"mode: x" + space * 60_000 + b"x\n" + description()
    begun = time.process_time()
    with pytest.raises(BadBundleError):
        MapBundle.of(attic(text))
    assert time.process_time() - begun < 1.0


@pytest.mark.parametrize(
    "more",
    [
        b'"image": /etc/shadow\n',
        b"? image\n: /etc/shadow\n",
        b"image: /etc/shadow\n",
        b"!!str image: /etc/shadow\n",
        b"other: &x [/etc/shadow]\n",
    ],
)
@pytest.mark.parametrize("before", [False, True])
def test_map_server_reads_no_other_file(more: bytes, before: bool) -> None:  # noqa: FBT001 - a parameter
    text = more + description() if before else description() + more
    try:
        written = MapBundle.of(attic(text)).description
    except BadBundleError:
        return
    assert written == description("image.pgm").decode()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (description().replace(b"0.5", b"/etc/shadow"), "'resolution' cannot be '/etc/shadow'"),
        (description().replace(b"[-5.0, -5.0, 0.0]", b"[1, 2]"), "'origin' needs three numbers"),
        (description() + b"mode: *x\n", r"'mode' cannot be '\*x'"),
    ],
)
def test_values_unknown_to_map_server_are_refused(text: bytes, reason: str) -> None:
    with pytest.raises(BadBundleError, match=reason):
        MapBundle.of(attic(text))


@pytest.mark.parametrize(
    "origin", ["[ -5.0,-5.0 , 0.0 ]", "\n- -5.0\n- -5.0\n- 0.0", "\r\n  - -5.0\r\n  - -5.0\r\n  - 0.0\r"]
)
def test_an_origin_may_be_written_in_every_way(origin: str) -> None:
    text = description().replace(b"[-5.0, -5.0, 0.0]", origin.encode())
    assert MapBundle.of(attic(text)).description == description("image.pgm").decode()


@pytest.mark.parametrize("value", [b"0", b"1", b"true", b"False", b"yes", b"NO", b"on", b"Off"])
def test_negate_may_be_written_in_every_way(value: bytes) -> None:
    text = description().replace(b"negate: 0", b"negate: " + value)
    assert f"negate: {value.decode()}\n" in MapBundle.of(attic(text)).description


def damaged(content: bytes, at: int) -> bytes:
    return content[:at] + bytes([content[at] ^ 0x5A]) + content[at + 1 :]


def longnames() -> bytes:
    """Return a tar of 2,000 heads that are each about the next one."""
    head = bytearray(tarred({"x": b""}, "w")[:512])
    head[156:157] = b"L"
    head[124:136] = b"00000000001\x00"
    head[148:156] = b" " * 8
    head[148:156] = f"{sum(head):06o}\x00 ".encode()
    return (bytes(head) + b"x" + bytes(511)) * 2000 + bytes(1024)


def compressed_by(method: int) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as archive:
        for name, part in FILES.items():
            archive.writestr(name, part)
    return content.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        longnames(),
        compressed_by(zipfile.ZIP_LZMA),
        compressed_by(zipfile.ZIP_BZIP2),
        b"\x1f\x8b",
        b"BZh9",
        b"\xfd7zXZ\0",
    ],
)
def test_a_forged_archive_is_refused(content: bytes) -> None:
    with pytest.raises(BadBundleError):
        MapBundle.of(content)


@pytest.mark.parametrize("pack", PACKS)
def test_a_damaged_archive_is_refused_or_read(pack: Callable[[dict[str, bytes]], bytes]) -> None:
    whole = pack(FILES)
    refused = 0
    for at in range(0, len(whole), 7):
        try:
            MapBundle.of(damaged(whole, at))
        except BadBundleError:
            refused += 1
    assert refused > 0
