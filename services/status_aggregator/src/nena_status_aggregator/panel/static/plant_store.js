// The plant model itself, loaded when the event stream says that there is another one.

/** Holds `model`, as it was published, or null. Fires `change`. */
export class PlantStore extends EventTarget {
  model = null;
  #known = null;

  constructor(store) {
    super();
    store.addEventListener("change", (event) => event.detail.parts.has("plant") && this.#load(store.plant));
  }

  /** Give the operations that a vehicle may be asked for at a place; empty: there is no such place. */
  operationsAt(name) {
    if (this.model?.points.some((point) => point.name === name)) return ["MOVE", "PARK"];
    const location = this.model?.locations.find((each) => each.name === name);
    if (!location) return [];
    const type = this.model.locationTypes.find((each) => each.name === location.type);
    const allowed = type?.allowedOperations ?? [];
    const linked = location.links.flatMap((link) => (link.allowedOperations.length ? link.allowedOperations : allowed));
    return [...new Set(linked), "NOP"];
  }

  async #load(plant) {
    const known = plant && `${plant.version} ${plant.name}`;
    if (known === this.#known) return;
    this.#known = known;
    const answer = plant ? await fetch("api/v1/plant") : null;
    this.model = answer?.ok ? await answer.json() : null;
    this.dispatchEvent(new Event("change"));
  }
}
