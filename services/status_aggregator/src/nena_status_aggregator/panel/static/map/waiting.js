// Where robots waited: the waiting times of a report by place, painted below the paths of the plant.

import { dateAndTime, duration, t } from "../i18n.js";
import { stroke } from "./lines.js";

const DAY = 86_400_000; // ms
const EVERY = 300_000; // ms
const LABELLED = 5;
const THIN = 8; // px
const WIDE = 30;

/** The report whose waiting times are shown: the last one of the Reports page, else that of the last 24 hours. Fires `change`. */
export class WaitingTimes extends EventTarget {
  shares = new Map();
  note = "";
  #given = false;

  /** Load the last 24 hours while `wanted()`, and every five minutes; `now()` is the server's time, ms. */
  follow(wanted, now) {
    this.load = async () => {
      if (this.#given || document.hidden || !wanted()) return;
      const query = new URLSearchParams({ since: new Date(now() - DAY).toISOString(), until: new Date(now()).toISOString() });
      const answer = await fetch(`api/v1/report?${query}`).catch(() => null);
      const report = answer?.ok ? await answer.json() : null;
      if (!this.#given) this.#set(report);
    };
    setInterval(this.load, EVERY);
    this.load();
  }

  /** Show the times of a report. */
  take(report) {
    this.#given = true;
    this.#set(report);
  }

  #set(report) {
    const places = report?.waitingPlaces ?? [];
    this.shares = new Map(places.map(({ place, seconds }) => [place, { seconds, share: Math.sqrt(seconds / places[0].seconds) }]));
    this.note = noteOn(report, places[0]);
    this.dispatchEvent(new Event("change"));
  }
}

function noteOn(report, longest) {
  if (!report) return t("map.waiting.failed");
  const values = { since: dateAndTime(report.since), until: dateAndTime(report.until) };
  if (!longest) return t("map.waiting.none", values);
  return t("map.waiting", { ...values, place: longest.place, duration: duration(longest.seconds) });
}

/** Paint the places of a plan for which robots waited: the longer, the wider and the stronger. */
export function paintWaiting(context, view, plan, shares, colour) {
  context.save();
  context.strokeStyle = context.fillStyle = colour;
  for (const [name, { share }] of shares) {
    context.globalAlpha = 0.2 + 0.5 * share;
    context.lineWidth = THIN + (WIDE - THIN) * share;
    const { lines, spots } = shapesOf(plan, name);
    for (const { line, curved } of lines) stroke(context, line.map(([x, y]) => view.toScreen(x, y)), curved);
    for (const { x, y } of spots) {
      context.beginPath();
      context.arc(...view.toScreen(x, y), context.lineWidth / 2 + 3, 0, 2 * Math.PI);
      context.fill();
    }
  }
  context.restore();
}

/** Place the durations of the longest waits. */
export function labelWaiting(labels, view, plan, shares) {
  for (const [name, { seconds }] of [...shares].slice(0, LABELLED)) {
    const { lines, spots } = shapesOf(plan, name);
    const [x, y] = spots.length ? [spots[0].x, spots[0].y] : (lines[0] ? centreOf(lines[0]) : []);
    if (x !== undefined) labels.put(duration(seconds), view.toScreen(x, y), WIDE / 2 + 10, { important: true });
  }
}

function centreOf({ line }) {
  return [0, 1].map((axis) => (line[0][axis] + line.at(-1)[axis]) / 2);
}

// The lines and points of a place on the map: a path, a point, a location, or the members of a block; none for other names.
function shapesOf(plan, name) {
  const path = plan.named.get(name);
  if (path) return { lines: [path], spots: [] };
  const spot = plan.points.get(name) ?? plan.locations.find((each) => each.name === name);
  if (spot) return { lines: [], spots: [spot] };
  const block = plan.blocks.find((each) => each.name === name);
  return { lines: block?.lines ?? [], spots: block?.corners ?? [] };
}
