from __future__ import annotations

from nena_shared.mqtt.link import Pauses


def test_pauses_double_up_to_the_longest() -> None:
    pauses = Pauses(1.0, 5.0)

    assert [pauses.after(None) for _ in range(5)] == [1.0, 2.0, 4.0, 5.0, 5.0]
    assert not pauses.suspicious


def test_lasting_connection_resets_the_delay() -> None:
    pauses = Pauses(1.0, 5.0)
    for _ in range(4):
        pauses.after(None)

    assert [pauses.after(10.0), pauses.after(None)] == [1.0, 2.0]


def test_short_connections_increase_the_delay_and_are_reported_once() -> None:
    pauses = Pauses(1.0, 5.0)
    found = []
    for _ in range(5):
        pause = pauses.after(0.1)
        found.append((pause, pauses.suspicious))

    assert found == [(1.0, False), (2.0, False), (4.0, True), (5.0, False), (5.0, False)]

    pauses.after(60.0)
    assert [(pauses.after(0.1), pauses.suspicious) for _ in range(3)][-1] == (5.0, True)
