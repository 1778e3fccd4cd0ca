"""The driver switched off and on, and moved in the ROS graph: at the page of a real robot's agent."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Browser, Locator, Page, expect

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet
from support.panel import findings, opened
from support.ros import RosPeer, own_domain_id
from support.waiting import wait_until

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.ros]

ROBOT = "#/robots/NeNa%2Frobot-01"
WORDS = {
    "en-GB": ("Connect ROS", "Disconnect ROS …", "ROS settings …"),
    "nl-NL": ("Met ROS verbinden", "Van ROS loskoppelen …", "ROS-instellingen …"),
    "de-DE": ("Mit ROS verbinden", "Von ROS trennen …", "ROS-Einstellungen …"),
}
AGENT = """
driver = "nav2"
interface_name = "{interface}"
map_id = "sample-hall"
serial_number = "robot-01"
[mqtt]
port = {port}
[journal]
folder = "{folder}"
[ros]
namespace = "r1"
domain_id = {domain_id}
"""


@asynccontextmanager
async def panel_of(broker: Broker, interface_name: str, folder: Path, domain_id: int) -> AsyncIterator[str]:
    """Return the address of the page of a fleet of one robot with ROS, and no Nav2."""
    fleet = Fleet(broker, interface_name, folder)
    with fleet.stack:
        fleet.agent_of(
            AGENT.format(
                interface=fleet.interface, port=broker.port, folder=folder / "journal", domain_id=domain_id
            )
        )
        async with await fleet.order_service().client() as orders:
            port = free_port()
            options = [
                *("--http.port", str(port), "--mqtt.port", str(broker.port)),
                *("--interface_name", interface_name, "--topic_prefix", fleet.prefix),
                *("--order_service.url", str(orders.base_url)),
            ]
            with AggregatorProcess(*options) as aggregator:
                await aggregator.logged("broker connected")
                yield f"http://127.0.0.1:{port}/{ROBOT}"


def fact(page: Page, name: str) -> Locator:
    return page.locator(f".facts dt:text-is('{name}') + dd")


async def test_ros_session_is_stopped_started_and_moved(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    with own_domain_id() as domain_id, RosPeer(domain_id) as peer:
        async with (
            panel_of(broker, interface_name, tmp_path, domain_id) as url,
            opened(browser, url) as page,
        ):
            off = page.get_by_role("button", name="Disconnect ROS …", exact=True)
            on = page.get_by_role("button", name="Connect ROS", exact=True)
            await expect(fact(page, "Driver")).to_have_text("active")
            await expect(fact(page, "ROS")).to_have_text(f"namespace /r1, domain {domain_id}")
            await expect(on).to_be_disabled()

            await off.click()
            await page.get_by_role("button", name="Disconnect now").click()
            await expect(fact(page, "Driver")).to_have_text("not active")
            await expect(off).to_be_disabled()
            wait_until(lambda: "nena_edge_agent" not in peer.node.get_node_names(), what="no node")

            await page.get_by_role("button", name="ROS settings …").click()
            form = page.get_by_role("form", name="ROS settings")
            await form.get_by_label("Namespace (/ for none)").fill(
                "hall-2"
            )  # none that ROS knows: is not sent
            await form.get_by_role("button", name="Apply").click()
            await form.get_by_label("Namespace (/ for none)").fill("hall_2/r1")
            await form.get_by_label("Keep after restart").check()
            assert await findings(page) == []
            await form.get_by_role("button", name="Apply").click()
            await expect(form).to_contain_text("ROS settings of Robot-01 applied")
            await expect(fact(page, "ROS")).to_have_text(f"namespace /hall_2/r1, domain {domain_id}")

            await on.click()
            await expect(fact(page, "Driver")).to_have_text("active")
            wait_until(
                lambda: ("nena_edge_agent", "/hall_2/r1") in peer.node.get_node_names_and_namespaces(),
                what="the node where it was moved to",
            )
            for language, names in WORDS.items():
                async with opened(browser, url, language=language) as other:
                    for name in names:
                        await expect(other.get_by_role("button", name=name, exact=True)).to_be_visible()


async def test_robot_without_ros_has_no_session_buttons(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    fleet = Fleet(broker, interface_name, tmp_path)
    port = free_port()
    options = ("--http.port", str(port), "--mqtt.port", str(broker.port), "--interface_name", interface_name)
    with fleet.stack, AggregatorProcess(*options, "--topic_prefix", fleet.prefix) as aggregator:
        await aggregator.logged("broker connected")
        fleet.agent()
        async with opened(browser, f"http://127.0.0.1:{port}/{ROBOT}") as page:
            await expect(fact(page, "Driver")).to_have_text("active")
            for name in WORDS["en-GB"]:
                await expect(page.get_by_role("button", name=name)).to_be_hidden()
