"""Archives of maps: what is taken, and why others are not."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from nena_edge_agent.nav2 import map_bundle
from nena_edge_agent.nav2.map_bundle import BadBundleError, MapBundle
from support.map_archives import description, image, tarred, zipped

FILES = {"attic.yaml": description(), "attic.pgm": image()}


@pytest.mark.parametrize("pack", [zipped, tarred, lambda files: tarred(files, "w")])
@pytest.mark.parametrize("folder", ["", "maps/", "./"])
def test_the_yaml_file_names_the_image_beside_it(
    pack: Callable[[dict[str, bytes]], bytes], folder: str
) -> None:
    bundle = MapBundle.of(pack({f"{folder}{name}": part for name, part in FILES.items()}))
    assert (bundle.image_name, bundle.image) == ("image.pgm", image())
    assert bundle.description == description("image.pgm").decode()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"walls", "no zip or tar"),
        (zipped({"attic.pgm": image()}), "one YAML file in its archive, not 0"),
        (zipped({**FILES, "other.yml": description()}), "one YAML file in its archive, not 2"),
        (zipped({"attic.yaml": description()}), "which is not in the archive"),
        (zipped({"attic.yaml": description("../../etc/x.pgm")}), "which is not in the archive"),
        (zipped({"attic.yaml": b"image: attic.pgm\norigin: [0, 0, 0]\n", "attic.pgm": b""}), "'resolution'"),
        (zipped({"attic.yaml": b"\xff\xfe"}), "no text"),
        (zipped({"attic.yaml": description("attic.sh"), "attic.sh": b""}), "not in the archive"),
    ],
)
def test_what_is_no_map_is_refused_with_the_reason(content: bytes, reason: str) -> None:
    with pytest.raises(BadBundleError, match=reason):
        MapBundle.of(content)


def test_a_small_archive_of_a_huge_image_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_bundle, "IMAGE_LIMIT", 1000)
    huge = zipped({**FILES, "attic.pgm": bytes(100_000)})
    assert len(huge) < 1000
    with pytest.raises(BadBundleError, match=r"attic\.pgm has more than 1000 bytes"):
        MapBundle.of(huge)
