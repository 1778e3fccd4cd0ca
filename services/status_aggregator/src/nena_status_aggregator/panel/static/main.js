// Puts the page together: one store, one line to the server, and the parts that show them.

import { locale, t } from "./catalogue.js";
import { EventLink } from "./event_link.js";
import { FleetStore } from "./fleet_store.js";
import "./components/fleet_map.js";
import "./components/fleet_summary.js";
import "./components/link_banner.js";
import "./components/message_health.js";
import "./components/order_table.js";
import "./components/robot_table.js";
import "./components/theme_button.js";

document.documentElement.lang = locale();
for (const node of document.querySelectorAll("[data-text]")) node.textContent = t(node.dataset.text);

const store = new FleetStore();
const link = new EventLink(store, "api/v1/events");
const sideBySide = matchMedia("(min-width: 901px)");
const robots = document.querySelector("nena-robot-table");
const map = document.querySelector("nena-fleet-map");

document.querySelector("nena-fleet-summary").show(store);
document.querySelector("nena-message-health").show(store);
document.querySelector("nena-order-table").show(store);
document.querySelector("nena-link-banner").show(store, link);
robots.show(store);
map.show(store);

for (const [part, other] of [[robots, map], [map, robots]]) {
  part.addEventListener("select", (event) => {
    robots.select(event.detail);
    map.select(event.detail);
    // where both do not fit on the screen, a tap on the map must not take the map away
    if (event.detail && (other === map || sideBySide.matches)) other.reveal(event.detail);
  });
}
link.addEventListener("state", () => document.body.classList.toggle("stale", !link.connected));
link.start();
