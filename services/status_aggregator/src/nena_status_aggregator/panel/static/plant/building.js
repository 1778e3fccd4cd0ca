// Larger changes of a plant model: blocks. Each returns a new model, which shares what stays the same. No DOM.

/** Return the members of a block of these objects: with the paths between selected points. */
export function blockOf(model, names) {
  const chosen = new Set(names);
  const between = (model.paths ?? []).filter(({ source, destination }) => chosen.has(source) && chosen.has(destination));
  return [...new Set([...names, ...between.map(({ name }) => name)])];
}
