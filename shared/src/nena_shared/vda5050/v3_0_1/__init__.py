"""VDA 5050 3.0.1 (draft): the messages of 3.0.0, with another name for one parameter.

Clarifications of 3.0.1 (angles up to 3.1416, the warning of a lost release, the end of requests) apply to all
versions, as the others allow them.
"""

from dataclasses import replace

from nena_shared.vda5050.v3_0 import CODEC as CODEC_3_0
from nena_shared.vda5050.v3_0 import RULES

CODEC = replace(
    CODEC_3_0, version="3.0.1", rules=replace(RULES, load_handling_device_key="loadHandlingDevice")
)
