"""VDA 5050 3.0.1, as its draft has it: the messages of 3.0.0, and another name for one parameter.

What 3.0.1 states more exactly than 3.0.0 (angles up to 3.1416, the warning of a lost release, when a request
ends) is done in all versions, since it is allowed in them.
"""

from dataclasses import replace

from nena_shared.vda5050.v3_0 import CODEC as CODEC_3_0
from nena_shared.vda5050.v3_0 import RULES

CODEC = replace(
    CODEC_3_0, version="3.0.1", rules=replace(RULES, load_handling_device_key="loadHandlingDevice")
)
