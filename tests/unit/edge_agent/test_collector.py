from __future__ import annotations

import gc
from weakref import ref

from nena_edge_agent.collector import spare_what_is_loaded


class Ring:
    def __init__(self) -> None:
        self.me = self


def test_what_is_loaded_is_spared_and_what_comes_later_is_collected() -> None:
    spare_what_is_loaded()
    assert gc.get_freeze_count() > 0

    ring = Ring()
    later = ref(ring)
    del ring
    spare_what_is_loaded()
    gc.collect()

    assert later() is None
