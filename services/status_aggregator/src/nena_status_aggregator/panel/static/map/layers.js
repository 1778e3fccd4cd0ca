// What of the map is shown. The choice is kept.

const KEY = "nena-layers";

/** The layers, from the ground up; names as in the catalogue under `layer.`. */
export const LAYERS = ["grids", "blocks", "ways", "points", "locations", "names", "ahead", "goals", "plans", "robots", "robotNames"];

/** Give what was chosen last; a layer that was never chosen is shown. */
export function readLayers() {
  const hidden = (localStorage.getItem(KEY) ?? "").split(" ");
  return Object.fromEntries(LAYERS.map((name) => [name, !hidden.includes(name)]));
}

/** Keep a choice. */
export function keepLayers(layers) {
  localStorage.setItem(KEY, LAYERS.filter((name) => !layers[name]).join(" "));
}
