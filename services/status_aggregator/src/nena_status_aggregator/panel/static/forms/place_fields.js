// A place of the plant model and what is done there.

import { t } from "../catalogue.js";
import { byName } from "../format.js";
import { element } from "../dom.js";
import { field, refillSelect, select } from "./fields.js";

/** Fields for a point or location and an operation that it allows. */
export class PlaceFields {
  constructor(plant) {
    this.plant = plant;
    this.place = select(placeOptions(plant.model), { name: "place", required: true });
    this.operation = select([], { name: "operation" });
    this.place.addEventListener("change", () => this.#showOperations());
    this.element = element(
      "div",
      { class: "fields" },
      field(t("form.place"), this.place),
      field(t("form.operation"), this.operation),
    );
    this.#showOperations();
  }

  /** Give the destination as the order service takes it. */
  get destination() {
    return { locationName: this.place.value, operation: this.operation.value };
  }

  /** Tell whether a point is chosen. */
  get isPoint() {
    return this.plant.model.points.some((point) => point.name === this.place.value);
  }

  #showOperations() {
    refillSelect(this.operation, this.plant.operationsAt(this.place.value).map(operation));
  }
}

function operation(name) {
  return ["MOVE", "PARK", "NOP"].includes(name) ? [name, t(`operation.${name}`)] : [name, name, true];
}

function placeOptions(model) {
  const names = (things) => (things ?? []).map((each) => each.name).sort(byName).map((name) => [name, name, true]);
  return [
    ["", t("form.choose")],
    { group: t("form.locations"), options: names(model?.locations) },
    { group: t("form.points"), options: names(model?.points) },
  ];
}
