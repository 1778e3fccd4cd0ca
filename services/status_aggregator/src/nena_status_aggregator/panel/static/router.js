// Which view is shown: the part of the address after #, so that Back works and views can be linked to.


/** Return the address of a view, e.g. `address("robots", id)`. */
export function address(...parts) {
  return `#/${parts.map(encodeURIComponent).join("/")}`;
}

/** Return the parts of the current view's address. */
export function currentView() {
  if (!location.hash.startsWith("#/")) return [];
  return location.hash.slice(2).split("/").map(decoded).filter(Boolean);
}

function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return "";
  }
}

/** Call back with the current view and on every change. An address such as `#robots` is a place in the page instead. */
export function followView(callback) {
  const look = () => /^(#\/|$)/.test(location.hash) && callback(currentView());
  addEventListener("hashchange", look);
  callback(currentView());
}
