"""What reads users, sites, journals, recordings, hosts' requests and issuers' answers: taken, or refused."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from support.damage import DEPTH, stream
from support.examples import DAMAGED_FILES
from support.readers.files import FILES
from support.readers.issuer import ISSUER
from support.readers.messages import MESSAGES
from support.readers.reader import Make, Place, Reader

READERS: dict[str, Make] = {**FILES, **MESSAGES, **ISSUER}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with ExitStack() as stack:
        yield Place(tmp_path_factory.mktemp("readers"), stack)


@pytest.fixture(scope="module", params=READERS)
def reader(request: pytest.FixtureRequest, place: Place) -> Reader:
    return READERS[request.param](place)


def test_damaged_input_is_read_or_refused(reader: Reader, request: pytest.FixtureRequest) -> None:
    assert all(map(reader.takes, reader.samples))
    chance = stream(request.node.name)
    outcomes = [
        reader.takes(reader.spoiled(chance.choice(reader.samples), chance)) for _ in range(DAMAGED_FILES)
    ]

    assert not (reader.refusals and all(outcomes)), "whatever comes is taken"


@settings(max_examples=DAMAGED_FILES)
@given(data=st.binary(max_size=100))
def test_any_bytes(reader: Reader, data: bytes) -> None:
    reader.takes(data)


def test_deeply_nested_input(reader: Reader) -> None:
    for depth in (150, 240, 600, 1200, DEPTH):
        for begin, middle, end in (("[", "", "]"), ('{"a":', "1", "}"), ("[", "", "")):
            reader.takes(f"{begin * depth}{middle}{end * depth}".encode())
