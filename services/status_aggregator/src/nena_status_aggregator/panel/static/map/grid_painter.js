// Paints the robots' own maps under everything else.

import { tinted } from "./grids.js";

const tints = new WeakMap(); // by image: {colour, sheet}

/** Paint maps, `[{grid, image}]`; `grid` says where the lower left corner is, in metres and radians. */
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
