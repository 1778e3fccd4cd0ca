// Sends a vehicle to a point, a location or a coordinate.

import { t } from "../catalogue.js";
import { command, newKey } from "../commands.js";
import { element } from "../dom.js";
import { commandForm } from "./command_form.js";
import { field, numberInput, numberOf, select } from "./fields.js";
import { PlaceFields } from "./place_fields.js";
import { PoseFields } from "./pose_fields.js";

export function dispatchForm(vehicle, plant) {
  const place = new PlaceFields(plant);
  const pose = new PoseFields();
  const priority = numberInput({ name: "priority", value: 0, min: -1000, max: 1000, step: 1 });
  const kind = select([["place", t("dispatch.place")], ["coordinate", t("dispatch.coordinate")]], { name: "kind" });
  const chosen = element("div");
  const choose = () => {
    chosen.replaceChildren((kind.value === "place" ? place : pose).element);
    if (kind.value === "place") document.dispatchEvent(new CustomEvent("poseshow", { detail: null }));
    else pose.show();
  };
  kind.addEventListener("change", choose);
  choose();
  let key = newKey();
  return commandForm({
    label: t("dispatch.title"),
    submit: t("dispatch.send"),
    fields: [field(t("dispatch.kind"), kind), chosen, field(t("form.priority"), priority)],
    send: async () => {
      const where = kind.value === "place" ? placeBody(place) : { coordinate: pose.pose };
      const body = { ...where, priority: numberOf(priority) ?? 0, idempotencyKey: key };
      const order = await command(["vehicles", vehicle, "dispatch"], body);
      key = newKey();
      return ["command.orderCreated", { name: order.name }];
    },
  });
}

function placeBody(place) {
  const { locationName, operation } = place.destination;
  return place.isPoint ? { point: locationName, operation } : { locationName, operation };
}
