// Zones of VDA 5050 3.0: the zone sets of the order service, painted below the paths of the plant.

import { ask } from "../api.js";
import { t } from "../i18n.js";

const EVERY = 60_000; // ms
const FORBIDDEN = "BLOCKED";

/** The zones of the order service's zone sets, loaded every minute while `wanted()`. Fires `change`. */
export class Zones extends EventTarget {
  list = [];

  /** Start loading. */
  follow(wanted) {
    this.load = async () => {
      if (document.hidden || !wanted()) return;
      const answer = await ask("zoneSets").catch(() => null);
      if (!answer) return;
      const sets = answer.zoneSets.filter(({ deleted }) => !deleted);
      const list = sets.flatMap(({ enabled, outlines }) => outlines.map((each) => ({ ...each, enabled })));
      if (JSON.stringify(list) === JSON.stringify(this.list)) return;
      this.list = list;
      this.dispatchEvent(new Event("change"));
    };
    setInterval(this.load, EVERY);
    this.load();
  }
}

/** Paint zones: those in use are solid, the others dashed. */
export function paintZones(context, view, zones, colours) {
  context.save();
  context.lineWidth = 1.5;
  for (const { zoneType, vertices, enabled } of zones) {
    context.beginPath();
    for (const [x, y] of vertices) context.lineTo(...view.toScreen(x, y));
    context.closePath();
    context.fillStyle = context.strokeStyle = zoneType === FORBIDDEN ? colours.bad : colours.accent;
    context.globalAlpha = enabled ? 0.14 : 0.05;
    context.fill();
    context.globalAlpha = enabled ? 0.9 : 0.6;
    context.setLineDash(enabled ? [] : [6, 4]);
    context.stroke();
  }
  context.restore();
}

/** Place the names and types of zones, at the tops of the zones. */
export function labelZones(labels, view, zones) {
  for (const { zoneId, zoneType, vertices, enabled } of zones) {
    const xs = vertices.map(([x]) => x);
    const top = Math.max(...vertices.map(([, y]) => y));
    const values = { name: zoneId, type: t(`zone.${zoneType}`) };
    const text = enabled ? t("map.zone", values) : t("map.zone.unused", values);
    labels.put(text, view.toScreen((Math.min(...xs) + Math.max(...xs)) / 2, top), 12);
  }
}
