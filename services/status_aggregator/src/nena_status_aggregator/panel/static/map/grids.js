// The robots' grid maps: loads them as images and paints them in the colours of the page.

const RETRY = 3000; // ms between two attempts to load a map

/** The robots' grid maps as images. Fires `change` when an image has been loaded. */
export class Grids extends EventTarget {
  #images = new Map(); // by digest

  /** Return `[{grid, image}]` to paint: one per map, preferably the selected robot's. */
  of(robots, selected) {
    const chosen = new Map();
    for (const { id, grid } of robots) if (grid && (id === selected || !chosen.has(grid.mapId))) chosen.set(grid.mapId, { id, grid });
    const wanted = new Set([...chosen.values()].map(({ grid }) => grid.digest));
    for (const digest of this.#images.keys()) if (!wanted.has(digest)) this.#images.delete(digest);
    return [...chosen.values()].map(({ id, grid }) => ({ grid, image: this.#image(id, grid) })).filter(({ image }) => image);
  }

  // The image, or null while it is loading.
  #image(id, { digest }) {
    if (!this.#images.has(digest)) {
      this.#images.set(digest, null);
      this.#load(id, digest);
    }
    return this.#images.get(digest);
  }

  async #load(id, digest) {
    const image = await loadMap(id, digest).catch(() => null);
    if (!image) return setTimeout(() => this.#retry(digest), RETRY);
    if (this.#images.has(digest)) this.#images.set(digest, image);
    this.dispatchEvent(new Event("change"));
  }

  // Painting again loads the map again, unless the robot or its map no longer exists.
  #retry(digest) {
    this.#images.delete(digest);
    this.dispatchEvent(new Event("change"));
  }
}

/** Load the picture of a robot's map: black, the surer an obstacle the more opaque. */
export async function loadMap(id, digest) {
  const at = id.indexOf("/");
  const image = new Image();
  image.src = `api/v1/robots/${[id.slice(0, at), id.slice(at + 1)].map(encodeURIComponent).join("/")}/map?${digest}`;
  await image.decode();
  return image;
}

/** Return the image in one colour, with its opacity unchanged. */
function tinted(image, colour) {
  const sheet = document.createElement("canvas");
  Object.assign(sheet, { width: image.width, height: image.height });
  const context = sheet.getContext("2d");
  context.drawImage(image, 0, 0);
  context.globalCompositeOperation = "source-in";
  context.fillStyle = colour;
  context.fillRect(0, 0, image.width, image.height);
  return sheet;
}

const tints = new WeakMap(); // by image: {colour, sheet}

/** Paint maps, `[{grid, image}]`; `grid` holds the pose of the lower left corner, m and rad. */
export function paintGrids(context, view, grids, colour) {
  for (const { grid, image } of grids) paintGrid(context, view, grid, tint(image, colour));
}

function tint(image, colour) {
  if (tints.get(image)?.colour !== colour) tints.set(image, { colour, sheet: tinted(image, colour) });
  return tints.get(image).sheet;
}

function paintGrid(context, view, grid, sheet) {
  const scale = grid.resolution * view.scale;
  context.save();
  context.translate(...view.toScreen(grid.x, grid.y));
  context.rotate(-grid.theta);
  context.imageSmoothingEnabled = scale < 1;
  context.drawImage(sheet, 0, -grid.height * scale, grid.width * scale, grid.height * scale);
  context.restore();
}
