// Why a robot or an order is as it is: from codes and facts to sentences in the reader's language.

import { chosenLanguage, has, t } from "./catalogue.js";
import { number, timeOfDay } from "./format.js";

const SINCE = {
  offline: "connectionSince",
  hibernating: "connectionSince",
  broken: "connectionSince",
  silent: "lastState",
  blind: "lastState",
};

/** Say why a robot is in its condition. */
export function reasonOf(robot) {
  const { reasonCode: code, reasonValues: values } = robot;
  if (code === "idle_why" && chosenLanguage() !== "en") return t("reason.idle");
  if (code === "emergency_stop") return t(`reason.emergency_stop.${values.how === "remotely" ? "remote" : "manual"}`);
  if (!has(`reason.${code}`)) return robot.reason;
  const filled = { ...values };
  if (code === "mode") filled.mode = t(`mode.${values.mode}`);
  if (SINCE[code] && robot[SINCE[code]]) filled.since = timeOfDay(robot[SINCE[code]]);
  for (const key of ["limit", "charge"]) if (key in filled) filled[key] = number(filled[key]);
  return t(`reason.${code}`, filled);
}

/** Say what to do about it; empty: nothing to be done. */
export function adviceFor(robot) {
  const key = `advice.${robot.reasonCode}`;
  return has(key) ? t(key) : "";
}

/** Say what to do about an error of a robot, by its type (2.x: nodeUnreachable); empty: its own words have to do. */
export function adviceForError(error) {
  const key = `errorAdvice.${error.errorType.replace(/([a-z])([A-Z])/g, "$1_$2").toUpperCase()}`;
  return has(key) ? t(key) : "";
}
