// Entry point of the panel: one store, one event stream, and the components that show them.

import { commandsEnabled, getSession } from "./api.js";
import { mayAudit } from "./audit_page.js";
import { EventLink, FleetStore, PlantStore } from "./fleet.js";
import { unsentForm } from "./forms.js";
import { chosenLanguage, t } from "./i18n.js";
import { address, followView } from "./router.js";
import { personOf } from "./stops.js";
import "./divider.js";
import "./attention.js";
import "./fleet_commands.js";
import "./header.js";
import "./history_page.js";
import "./lists.js";
import "./map/fleet_map.js";
import "./order_page.js";
import "./peripherals.js";
import "./place_page.js";
import "./plant/plant_page.js";
import "./reports_page.js";
import "./robot_page.js";
import "./schedules_page.js";
import "./tables.js";

document.documentElement.lang = chosenLanguage();
for (const node of document.querySelectorAll("[data-text]")) node.textContent = t(node.dataset.text);

const part = (name) => document.querySelector(`nena-${name}`);
const store = new FleetStore();
const person = () => personOf(session);
const plant = new PlantStore(store, person);
const link = new EventLink(store, "api/v1/events");
const session = await getSession();
const enabled = await commandsEnabled();
const noCommands = enabled ? { viewer: "login.noCommands" }[session?.role] : "command.off";
const fleet = { store, plant, link, enabled, noCommands, person };
const map = part("fleet-map");
const views = { robots: part("robot-page"), orders: part("order-page"), newOrder: part("order-form"), places: part("place-page"), history: part("history-page"), reports: part("reports-page"), schedules: part("schedules-page"), plant: part("plant-page"), audit: part("audit-page") };
const withoutId = ["history", "reports", "schedules", "plant", "audit"]; // views

const tables = { robots: part("robot-table"), orders: part("order-table"), peripherals: part("peripheral-table") };

for (const name of ["fleet-summary", "message-health", "peripheral-table"]) part(name).show(store);
part("attention").show(fleet, session);
part("attention-button").show(store, part("attention"));
tables.robots.show(store, !noCommands);
tables.orders.show(store, !noCommands);
part("several-orders").show(tables.orders);
part("fleet-commands").show(tables.robots, plant);
part("tabs").show(tables);
part("search").show(tables, plant);
document.getElementById("new-order").hidden = Boolean(noCommands);
document.getElementById("schedules-link").hidden = !enabled;
for (const name of ["plant", "audit"]) document.getElementById(`${name}-link`).hidden = !enabled || !mayAudit(session);
part("link-banner").show(store, link);
part("stops").show(store, session, noCommands);
part("stop-commands").show(part("stops"), noCommands);
part("user-menu").show(session);
map.show(fleet);
for (const view of Object.values(views)) view.show(fleet);

// A click on the map does not close a form with input that was not sent yet.
function go(...view) {
  const form = unsentForm();
  if (form) form.scrollIntoView({ block: "nearest" });
  else location.hash = address(...view);
}

// A command of the map's menu begins on the page of the robot or place, once it is shown.
let wanted = null;
map.addEventListener("command", ({ detail: { view, id, name, value } }) => {
  const form = unsentForm();
  wanted = null;
  if (form) return form.scrollIntoView({ block: "nearest" });
  const target = address(view, id);
  if (location.hash === target && name) return views[view].begin(name, value);
  wanted = name && { target, begin: () => views[view].begin(name, value) };
  location.hash = target;
});

map.addEventListener("select", (event) => go("robots", event.detail));
map.addEventListener("selectplace", (event) => go("places", event.detail));
views.orders.addEventListener("edit", ({ detail }) => {
  views.newOrder.fillIn(detail);
  go("orders");
});
views.robots.addEventListener("reveal", (event) => map.reveal(event.detail));
views.reports.addEventListener("waiting", ({ detail: { report, reveal } }) => map.showWaiting(report, reveal));
views.history.addEventListener("replay", (event) => map.replay(event.detail));
document.addEventListener("poseshow", (event) => map.showPose(event.detail));
document.addEventListener("posepick", (event) => map.pickPose(event.detail));
document.addEventListener("placepick", (event) => map.pickPlace(event.detail));
document.addEventListener("areashow", (event) => map.showArea(event.detail));
document.addEventListener("areapick", (event) => map.pickArea(event.detail));

let begun = false;
followView(([name, id]) => {
  const chosen = id || withoutId.includes(name) ? name : name === "orders" && "newOrder";
  const view = Object.hasOwn(views, chosen) ? views[chosen] : null;
  document.getElementById("lists").hidden = view !== null;
  document.body.dataset.view = view ? "page" : "lists";
  map.showPose(null);
  for (const [key, each] of Object.entries(views)) {
    each.hidden = each !== view;
    each.open(key === chosen ? (id ?? "new") : null);
  }
  if (!view) for (const table of Object.values(tables)) table.refresh(); // once the page no longer takes their room
  map.select(chosen === "robots" ? id : null);
  map.selectPlace(chosen === "places" ? id : null);
  if (wanted?.target === location.hash) wanted.begin();
  wanted = null;
  if (begun && view) view.scrollIntoView({ block: "nearest" });
  begun = true;
});

store.addEventListener("change", () => document.body.classList.toggle("orders-old", store.orderService.up === false));
link.addEventListener("state", () => {
  document.body.classList.toggle("stale", !link.connected);
  if (!link.connected) getSession(); // the user may have been removed
});
if (enabled) plant.followLocks();
link.start();
