// What has to be smooth first: the map while it is dragged, then everything else.

const BUSY = 500; // ms

let dragged = false;

/** Set whether the map is being dragged. */
export function setDragged(on) {
  dragged = on;
}

/** Call `action` in the next frame; half a second later while the map is dragged. */
export function inNextFrame(action) {
  if (dragged) setTimeout(() => requestAnimationFrame(action), BUSY);
  else requestAnimationFrame(action);
}
