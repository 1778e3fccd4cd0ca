"""Ids of the objects of one kind in a file: those that an import kept, where they still can be."""

from collections import Counter
from collections.abc import Mapping


def distinct_ids(wanted: Mapping[str, str | None]) -> dict[str, str]:
    """Give each object, by its name, an id that no other one has: what it wants, else its name.

    People copy and change objects with their properties; an empty id, or one that two want, is nobody's.
    """
    ids = {name: own or name for name, own in wanted.items()}
    # Each round takes a wanted id away, and names are distinct.
    while twice := {each for each, times in Counter(ids.values()).items() if times > 1}:
        ids = {name: name if own in twice else own for name, own in ids.items()}
    return ids
