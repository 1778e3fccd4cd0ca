// What has to be smooth first: the map while it is dragged, then everything else.

const BUSY = 500; // ms

let dragged = false;
const waiting = new Set();

/** Set whether the map is being dragged; what has waited for the end of the drag is called in the next frame. */
export function setDragged(on) {
  dragged = on;
  if (!dragged) waiting.forEach(callWaiting);
}

function callWaiting(action) {
  if (waiting.delete(action)) requestAnimationFrame(action);
}

/** Call `action` in the next frame; half a second later while the map is dragged. */
export function inNextFrame(action) {
  if (!dragged) return requestAnimationFrame(action);
  waiting.add(action);
  return setTimeout(callWaiting, BUSY, action);
}
