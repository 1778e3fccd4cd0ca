// The state of a transport order as people see it.

/** Give the state that is shown: an order that somebody holds does nothing, whatever its state. */
export function shownState(order) {
  return order.held && !order.final ? "HELD" : order.state;
}
