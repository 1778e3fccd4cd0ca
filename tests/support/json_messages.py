"""Messages as parsed JSON: read and written by the codec of one version, and what many tests send."""

from __future__ import annotations

import json
from typing import Any

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec

FACTSHEET = {
    "typeSpecification": {
        "seriesName": "Carrier 1",
        "agvKinematic": "DIFF",
        "agvClass": "CARRIER",
        "maxLoadMass": 100,
        "localizationTypes": ["NATURAL"],
        "navigationTypes": ["AUTONOMOUS"],
    },
    "physicalParameters": {
        "speedMin": 0,
        "speedMax": 1.5,
        "accelerationMax": 1,
        "decelerationMax": 1,
        "heightMin": 0.3,
        "heightMax": 0.3,
        "width": 0.6,
        "length": 0.9,
    },
    "protocolLimits": {
        "maxStringLens": {},
        "maxArrayLens": {},
        "timing": {"minOrderInterval": 0, "minStateInterval": 0},
    },
    "protocolFeatures": {"optionalParameters": [], "agvActions": []},
    "agvGeometry": {},
    "loadSpecification": {},
}
"""Of a robot of VDA 5050 2.1 that sets no limits and has no actions; without its header."""


class JsonMessages:
    """The messages of one version."""

    def __init__(self, codec: Codec) -> None:
        self._codec = codec

    def read(self, kind: type[Header], content: dict[str, Any]) -> Any:
        """Return the neutral message of parsed JSON."""
        return self._codec.decode(kind, json.dumps(content).encode())

    def written(self, message: Header) -> Any:
        """Return a neutral message as parsed JSON."""
        return json.loads(self._codec.encode(message))
