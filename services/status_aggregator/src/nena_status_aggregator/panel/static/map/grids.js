// The robots' own maps: one for each map id, loaded as images and coloured as the page is.

/** Fires `change` when an image has come. */
export class Grids extends EventTarget {
  #images = new Map(); // by digest

  /** Give what to draw, `[{grid, image}]`: of each map that of the chosen robot, else the first there is. */
  of(robots, selected) {
    const chosen = new Map();
    for (const { id, grid } of robots) if (grid && (id === selected || !chosen.has(grid.mapId))) chosen.set(grid.mapId, { id, grid });
    const wanted = new Set([...chosen.values()].map(({ grid }) => grid.digest));
    for (const digest of this.#images.keys()) if (!wanted.has(digest)) this.#images.delete(digest);
    return [...chosen.values()].map(({ id, grid }) => ({ grid, image: this.#image(id, grid) })).filter(({ image }) => image);
  }

  // The image, or null as long as it is on its way.
  #image(id, { digest }) {
    if (!this.#images.has(digest)) {
      this.#images.set(digest, null);
      this.#load(id, digest);
    }
    return this.#images.get(digest);
  }

  async #load(id, digest) {
    const [manufacturer, serial] = split(id).map(encodeURIComponent);
    const image = new Image();
    image.src = `api/v1/robots/${manufacturer}/${serial}/map?${digest}`;
    try {
      await image.decode();
    } catch {
      return; // the robot, or its map, has gone meanwhile
    }
    if (this.#images.has(digest)) this.#images.set(digest, image);
    this.dispatchEvent(new Event("change"));
  }
}

function split(id) {
  const at = id.indexOf("/");
  return [id.slice(0, at), id.slice(at + 1)];
}

/** Give the image in one colour; how opaque it is stays. */
export function tinted(image, colour) {
  const sheet = document.createElement("canvas");
  Object.assign(sheet, { width: image.width, height: image.height });
  const context = sheet.getContext("2d");
  context.drawImage(image, 0, 0);
  context.globalCompositeOperation = "source-in";
  context.fillStyle = colour;
  context.fillRect(0, 0, image.width, image.height);
  return sheet;
}
