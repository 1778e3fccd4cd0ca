// Puts the page together: one store, one line to the server, and the parts that show them.

import { chosenLanguage, t } from "./catalogue.js";
import { commandsEnabled } from "./commands.js";
import { EventLink } from "./event_link.js";
import { FleetStore } from "./fleet_store.js";
import { PlantStore } from "./plant_store.js";
import { address, followView } from "./router.js";
import { whoIsIt } from "./session.js";
import "./components/fleet_map.js";
import "./components/fleet_summary.js";
import "./components/history_page.js";
import "./components/language_select.js";
import "./components/link_banner.js";
import "./components/message_health.js";
import "./components/order_form.js";
import "./components/order_page.js";
import "./components/order_table.js";
import "./components/robot_page.js";
import "./components/robot_table.js";
import "./components/theme_button.js";
import "./components/user_menu.js";

document.documentElement.lang = chosenLanguage();
for (const node of document.querySelectorAll("[data-text]")) node.textContent = t(node.dataset.text);

const part = (name) => document.querySelector(`nena-${name}`);
const store = new FleetStore();
const plant = new PlantStore(store);
const link = new EventLink(store, "api/v1/events");
const session = await whoIsIt();
const enabled = await commandsEnabled();
const noCommands = enabled ? { viewer: "login.noCommands" }[session?.role] : "command.off";
const fleet = { store, plant, link, enabled, noCommands };
const map = part("fleet-map");
const views = { robots: part("robot-page"), orders: part("order-page"), newOrder: part("order-form"), history: part("history-page") };

for (const name of ["fleet-summary", "message-health", "order-table", "robot-table"]) part(name).show(store);
part("link-banner").show(store, link);
part("user-menu").show(session);
map.show(store, plant);
for (const view of Object.values(views)) view.show(fleet);

map.addEventListener("select", (event) => event.detail && (location.hash = address("robots", event.detail)));
views.robots.addEventListener("reveal", (event) => map.reveal(event.detail));
views.history.addEventListener("replay", (event) => map.replay(event.detail));
document.addEventListener("poseshow", (event) => map.showPose(event.detail));
document.addEventListener("posepick", (event) => map.pickPose(event.detail));

let begun = false;
followView(([name, id]) => {
  const chosen = id || name === "history" ? name : { orders: "newOrder" }[name];
  const view = views[chosen] ?? null;
  document.getElementById("lists").hidden = view !== null;
  map.showPose(null);
  for (const [key, each] of Object.entries(views)) {
    each.hidden = each !== view;
    each.open(key === chosen ? (id ?? "new") : null);
  }
  mark(chosen === "robots" ? id : null);
  if (begun && view) view.scrollIntoView({ block: "nearest" });
  begun = true;
});

function mark(id) {
  part("robot-table").select(id);
  map.select(id);
}

link.addEventListener("state", () => {
  document.body.classList.toggle("stale", !link.connected);
  if (!link.connected) whoIsIt(); // the user may have been taken out
});
link.start();
