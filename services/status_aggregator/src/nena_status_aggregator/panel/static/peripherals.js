// Peripheral devices, such as doors: their table, and the state and jobs of one on the page of its location.

import { element, refill, setAttribute, setText, verbatim } from "./dom.js";
import { jobOf } from "./fleet.js";
import { age, byName, dateAndTime, plural, t } from "./i18n.js";
import { LiveTable, cell, matches } from "./live_table.js";
import { reasonElement } from "./reasons.js";
import { address, lists } from "./router.js";

// The default order: devices that need attention, those with a job, the others.
const RANKS = ["ERROR", "UNAVAILABLE"];

function rankOf(device) {
  return RANKS.includes(device.state) ? 0 : jobOf(device) ? 1 : 2;
}

function stateText(device) {
  return t(`peripheral.${device.state}`);
}

/** Return the name of a device with its state. */
export function nameAndState(device) {
  return t("peripherals.head", { name: device.id, state: stateText(device) });
}

// The last job, if it failed and no other one is under way.
function failureOf(device) {
  const last = device.jobs[0];
  return last?.state === "FAILED" ? last : null;
}

// The names of other vehicles that wait at a device.
function waitingAt(device, store) {
  const own = jobOf(device)?.vehicle;
  const waiting = [...store.robots.values()].filter(({ vehicle }) => vehicle?.wait?.at === device.id && vehicle.name !== own);
  return waiting.map(({ vehicle }) => vehicle.name).sort(byName);
}

// The vehicle and the transport order of a job, each with its address; none for a job of a host.
function ownersOf(job, store) {
  const robot = job?.vehicle && store.robotOfVehicle(job.vehicle);
  return [
    job?.vehicle && { name: job.vehicle, href: robot && address("robots", robot.id) },
    job?.transportOrder && { name: job.transportOrder, href: address("orders", job.transportOrder) },
  ].filter(Boolean);
}

function ownerLink({ name, href }) {
  return href ? verbatim("a", name, { href }) : verbatim("span", name);
}

class PeripheralTable extends LiveTable {
  columns = ["peripherals.name", "peripherals.state", "peripherals.job", "peripherals.vehicle"];
  empty = "peripherals.empty";
  sortKey = "peripheralSort";
  first = () => 0;
  usual = (a, b) => rankOf(a) - rankOf(b) || byName(a.id, b.id);
  comparators = {
    name: (a, b) => byName(a.id, b.id),
    state: (a, b) => byName(stateText(a), stateText(b)),
    job: (a, b) => Date.parse(jobOf(a)?.created ?? "9999") - Date.parse(jobOf(b)?.created ?? "9999"), // the oldest first
  };

  /** Show the devices of the store. */
  show(store) {
    this.follow(store, "peripherals");
  }

  accept(device) {
    const job = jobOf(device);
    const words = [device.id, job?.operation, job?.vehicle, job?.transportOrder, ...device.usedBy, ...waitingAt(device, this.store)];
    return matches(lists.get("q"), words);
  }

  makeRow(id) {
    const parts = {
      operations: verbatim("span", "", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      failed: element("span", { class: "reason of-orders" }),
      unconfirmed: element("span", { class: "reason" }),
      operation: verbatim("span", "", { class: "of-orders" }),
      since: element("span", { class: "detail of-orders" }),
      reason: element("span", { class: "reason of-orders" }),
      more: element("span", { class: "detail of-orders" }),
      owners: element("span", { class: "owners of-orders" }),
      waiting: element("span", { class: "detail of-orders" }),
    };
    const row = element(
      "tr",
      { "data-peripheral": id },
      cell("peripherals.name", verbatim("a", id, { class: "name", title: id, href: address("places", id) }), parts.operations),
      cell("peripherals.state", parts.chip, parts.failed, parts.unconfirmed),
      cell("peripherals.job", parts.operation, parts.since, parts.reason, parts.more),
      cell("peripherals.vehicle", parts.owners, parts.waiting),
    );
    return { row, update: (device, now) => updateRow(parts, device, now, this.store) };
  }
}

function updateRow(parts, device, now, store) {
  const job = jobOf(device);
  const waiting = waitingAt(device, store);
  const owners = ownersOf(job, store);
  setText(parts.operations, device.operations.join(" · "));
  setText(parts.chip, stateText(device));
  setAttribute(parts.chip, "data-state", device.state);
  refill(parts.failed, failureOf(device), (failed) => (failed ? [t("peripherals.failed", failed), " ", reasonElement("span", failed)] : []));
  setText(parts.unconfirmed, device.confirmed ? "" : t("orders.unconfirmed"));
  setText(parts.operation, job?.operation ?? t("none"));
  setText(parts.since, job ? t("peripherals.since", { state: t(`state.${job.state}`), age: age((now - Date.parse(job.created)) / 1000) }) : "");
  refill(parts.reason, job, () => (job?.reason ? [reasonElement("span", job)] : []));
  const more = device.waiting - (job && !device.job ? 1 : 0);
  setText(parts.more, more > 0 ? plural("peripherals.more", more) : "");
  refill(parts.owners, owners, () => owners.map(ownerLink));
  setText(parts.waiting, waiting.length ? t("peripherals.waiting", { names: waiting.join(", ") }) : "");
}

customElements.define("nena-peripheral-table", PeripheralTable);

/** Shows the device of a location with its jobs; hidden for a location without one. */
class PeripheralDetails extends HTMLElement {
  show(device, store) {
    this.hidden = !device;
    const owners = (device?.jobs ?? []).map((job) => ownersOf(job, store));
    refill(this, [device, owners], () => (device ? [section(device, owners)] : []));
  }
}

function section(device, owners) {
  const chip = element("span", { class: "chip", "data-state": device.state }, stateText(device));
  const used = device.usedBy.length ? t("peripherals.usedBy", { names: device.usedBy.join(", ") }) : "";
  const jobs = element("ul", { class: "entries of-orders" }, ...device.jobs.map((job, at) => jobItem(job, owners[at])));
  const none = element("p", { class: "hint" }, t("peripherals.noJobs"));
  return element("section", {}, element("h3", {}, t("peripherals.name")), element("p", {}, chip, " ", used), device.jobs.length ? jobs : none);
}

function jobItem(job, owners) {
  const time = job.finished ?? job.created;
  const made = element("li", { "data-status": job.state }, verbatim("span", job.operation), " – ", element("strong", {}, t(`state.${job.state}`)), " ");
  made.append(element("time", { datetime: time }, dateAndTime(time)), ...owners.flatMap((owner) => [" · ", ownerLink(owner)]));
  if (job.reason) made.append(element("p", { class: "hint" }, reasonElement("span", job)));
  return made;
}

customElements.define("nena-peripheral-details", PeripheralDetails);
