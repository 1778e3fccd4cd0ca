"""A plant on which each robot has its own two-way lane of two points, so that none waits for another."""

from __future__ import annotations

import http.client
import json
import queue
import threading
from typing import Any
from urllib.parse import urlsplit

import httpx

from bench.programs import LOOK_EVERY, WAIT_SECONDS
from nena_shared.plant import PlantModel, Point, Vehicle
from nena_shared.plant.track import BoundingBox
from support.plants import path
from support.waiting import wait_until

MAP_ID = "bench-lanes"
LENGTH_M = 5
APART_M = 2
ROBOT_MM = 800
CONNECTIONS = 8
"""Connections over which orders are created."""
THERE = {"IDLE", "EXECUTING"}
"""States of vehicles whose robots are there, without an order and with one."""


def robot(number: int) -> str:
    """Name a robot as a loopback fleet numbers it, from 0 on: its serial number, and its vehicle."""
    return f"lane-{number + 1}"


def point(number: int, end: int) -> str:
    """Name an end, 0 or 1, of a robot's lane."""
    return f"{robot(number)}-{end}"


def lanes(robots: int) -> PlantModel:
    """Return the plant model for so many robots."""
    ends = [(number, end) for number in range(robots) for end in (0, 1)]
    return PlantModel(
        name=f"{robots} lanes",
        points=tuple(
            Point(name=point(number, end), x_mm=end * LENGTH_M * 1000, y_mm=number * APART_M * 1000)
            for number, end in ends
        ),
        paths=tuple(
            path(f"{point(number, end)} {point(number, 1 - end)}", LENGTH_M * 1000) for number, end in ends
        ),
        vehicles=tuple(_vehicle(number) for number in range(robots)),
    )


def _vehicle(number: int) -> Vehicle:
    return Vehicle(
        name=robot(number),
        bounding_box=BoundingBox(length_mm=ROBOT_MM, width_mm=ROBOT_MM),
        properties={
            "vda5050:manufacturer": "NeNa",
            "vda5050:serialNumber": robot(number),
            "vda5050:version": "2.1.0",
            "vda5050:mapId": MAP_ID,
        },
    )


def order(number: int, robots: int) -> dict[str, Any]:
    """Return the order of this number: each robot in turn to the other end of its lane, and back."""
    lane, turn = number % robots, number // robots
    return {
        "destinations": [{"locationName": point(lane, 1 - turn % 2)}],
        "intendedVehicle": robot(lane),
    }


def wait_for_robots(url: str, robots: int) -> None:
    """Wait until every robot can accept an order."""

    def all_there() -> bool:
        vehicles = httpx.get(f"{url}/v1/vehicles", timeout=WAIT_SECONDS).json()["vehicles"]
        there = (each["state"] in THERE and each["currentPosition"] is not None for each in vehicles)
        return sum(there) == robots

    wait_until(all_there, timeout=WAIT_SECONDS, what="every robot is there", every=LOOK_EVERY)


class Host:
    """Creates orders over several connections, as fast as they are answered."""

    def __init__(self, url: str) -> None:
        self.refused: list[str] = []
        self._bodies: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._address = urlsplit(url)
        self._threads = [
            threading.Thread(target=self._create_orders, name=f"host {number}")
            for number in range(CONNECTIONS)
        ]
        for thread in self._threads:
            thread.start()

    def create(self, body: dict[str, Any]) -> None:
        """Create an order as soon as a connection is free."""
        self._bodies.put(body)

    def close(self) -> None:
        """Wait until all orders are answered, and disconnect."""
        for _ in self._threads:
            self._bodies.put(None)
        for thread in self._threads:
            thread.join()

    def _create_orders(self) -> None:
        connection = http.client.HTTPConnection(
            self._address.hostname or "", self._address.port, timeout=WAIT_SECONDS
        )
        while (body := self._bodies.get()) is not None:
            try:
                status, text = self._post(connection, body)
            except (ConnectionError, http.client.HTTPException):  # an idle connection may have been closed
                connection.close()
                status, text = self._post(connection, body)
            if status != http.client.CREATED:
                self.refused.append(text)
        connection.close()

    def _post(self, connection: http.client.HTTPConnection, body: dict[str, Any]) -> tuple[int, str]:
        headers = {"Content-Type": "application/json"}
        connection.request("POST", "/v1/transportOrders", json.dumps(body).encode(), headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
