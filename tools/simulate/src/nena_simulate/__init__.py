"""A site under accelerated time: the real order service and robots, one clock, no broker."""
