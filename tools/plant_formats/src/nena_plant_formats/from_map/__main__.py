"""``python -m nena_plant_formats.from_map map.yaml``: what an uploaded map is, and its picture, in JSON.

The image is the file ``image`` beside it, whatever the YAML file names; it is written into that.
"""

import sys
from base64 import b64encode
from contextlib import suppress
from io import BytesIO
from json import dumps
from pathlib import Path
from typing import Final

import yaml  # type: ignore[import-untyped]
from PIL import Image, ImageOps

from nena_plant_formats.from_map.robot_map import RobotMapError, read_map

IMAGE: Final = "image"


def main(path: Path) -> str:
    """Return size, origin and picture: black, the darker the more opaque; raises RobotMapError."""
    values = None
    with suppress(yaml.YAMLError, RecursionError):  # which read_map names
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    if isinstance(values, dict):
        path.write_text(yaml.safe_dump({**values, "image": IMAGE}), encoding="utf-8")
    read = read_map(path)
    with Image.open(path.with_name(IMAGE)) as image:
        grey = image.convert("L")
    opacity = grey if values and values.get("negate") else ImageOps.invert(grey)
    picture = BytesIO()
    Image.merge("LA", (Image.new("L", grey.size), opacity)).save(picture, "PNG")
    x, y, theta = read.origin
    size = {"width": grey.width, "height": grey.height, "resolution": read.resolution}
    return dumps({**size, "x": x, "y": y, "theta": theta, "picture": b64encode(picture.getvalue()).decode()})


if __name__ == "__main__":
    try:
        sys.stdout.write(main(Path(sys.argv[1])))
    except (RobotMapError, OSError) as error:
        sys.exit(str(error))
