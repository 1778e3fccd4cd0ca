// All texts of the page, by language. No other module holds words that people read.

const TEXTS = {
  en: {
    "page.skip": "Skip to the robots",
    "summary.label": "Robots by condition",
    "summary.none": "no robots",
    "summary.robots.one": "{count} robot",
    "summary.robots.other": "{count} robots",

    "theme.auto": "Theme: as the system",
    "theme.light": "Theme: light",
    "theme.dark": "Theme: dark",

    "link.connecting": "Connecting …",
    "link.lost": "Connection to the status aggregator lost. What you see is as of {time}. Trying again …",
    "link.never": "The status aggregator does not answer. Trying again …",
    "link.broker":
      "The status aggregator has no link to the MQTT broker; what you see is as of {time}. Is the broker running, and do --mqtt.host and --mqtt.port name it?",
    "link.broker.never":
      "The status aggregator has not reached the MQTT broker yet. Is the broker running, and do --mqtt.host and --mqtt.port name it?",
    "link.back": "Connected.",

    "map.title": "Map",
    "map.label":
      "Map of {plant} with {points} points and {robots} robots. Arrow keys move it, plus and minus zoom, 0 shows everything. The table of robots holds the same facts.",
    "map.label.empty": "Map without a plant model, with {robots} robots.",
    "map.fit": "Show everything",
    "map.in": "Zoom in",
    "map.out": "Zoom out",
    "map.follow": "Follow the chosen robot",
    "map.layers": "Layers",
    "map.empty.title": "No plant model yet",
    "map.empty.text":
      "The map comes from the order service: start it with a plant model, on the same MQTT broker and the same prefix. Robots are drawn as soon as they tell where they are.",
    "map.scale": "{length} m",
    "map.position": "x {x} m, y {y} m",

    "layer.blocks": "Blocks",
    "layer.ways": "Paths",
    "layer.points": "Points",
    "layer.locations": "Locations",
    "layer.names": "Names",
    "layer.ahead": "Ways ahead",
    "layer.goals": "Goals",
    "layer.robots": "Robots",
    "layer.robotNames": "Names of robots",

    "robots.title": "Robots",
    "robots.name": "Robot",
    "robots.condition": "Condition",
    "robots.battery": "Battery",
    "robots.order": "Order",
    "robots.age": "Last state",
    "robots.empty.title": "No robot has been heard of yet",
    "robots.empty.text":
      "Robots appear by themselves as soon as they send VDA 5050 messages to the broker. Start an edge agent on the same broker, and with the same interface name.",
    "robots.show": "Show {name} on the map",
    "robots.warnings.one": "{count} warning",
    "robots.warnings.other": "{count} warnings",
    "robots.errors.one": "{count} error",
    "robots.errors.other": "{count} errors",
    "robots.unreadable.one": "{count} unreadable message",
    "robots.unreadable.other": "{count} unreadable messages",
    "robots.skew": "Clock off by {seconds} s",
    "robots.loads.one": "{count} load",
    "robots.loads.other": "{count} loads",
    "robots.since": "since {time}",

    "condition.IDLE": "Idle",
    "condition.BUSY": "Busy",
    "condition.CHARGING": "Charging",
    "condition.BLOCKED": "Blocked",
    "condition.ERROR": "Error",
    "condition.MANUAL": "Manual",
    "condition.SILENT": "Silent",
    "condition.BROKEN": "Connection broken",
    "condition.OFFLINE": "Offline",

    "battery.charge": "{charge} %",
    "battery.charging": "charging",
    "progress.label": "Progress of {name}",
    "progress.value": "{percent} %",
    "age.never": "never",
    "age.seconds": "{count} s",
    "age.minutes": "{count} min",
    "age.hours": "{count} h",
    "age.days": "{count} d",
    "none": "–",

    "orders.title": "Transport orders",
    "orders.name": "Order",
    "orders.state": "State",
    "orders.vehicle": "Vehicle",
    "orders.destinations": "Destinations",
    "orders.progress": "Progress",
    "orders.empty.title": "No transport order yet",
    "orders.empty.text":
      "Orders appear as soon as the order service has taken one, over REST or MQTT.",
    "orders.unconfirmed": "Not heard of since the link to the broker was lost.",
    "orders.intended": "{name} (wanted)",
    "orders.created": "{age} ago",
    "destination": "{place}: {operation}",

    "state.RAW": "New",
    "state.ACTIVE": "Accepted",
    "state.DISPATCHABLE": "Waiting",
    "state.BEING_PROCESSED": "Under way",
    "state.WITHDRAWN": "Being withdrawn",
    "state.FINISHED": "Finished",
    "state.FAILED": "Failed",
    "state.UNROUTABLE": "No route",

    "messages.fine": "All messages understood.",
    "messages.malformed.one": "{count} message not understood ({kinds}).",
    "messages.malformed.other": "{count} messages not understood ({kinds}).",
    "messages.last": "Last at {time} on {topic}: {problem}",
    "messages.kind": "{kind}: {count}",
  },
};

let language = "en";

/** Give the language in use, as a BCP 47 tag. */
export function locale() {
  return language;
}

/** Give a text with its `{values}` filled in; a missing key shows itself, so that it is found. */
export function t(key, values = {}) {
  const text = TEXTS[language][key] ?? key;
  return text.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

/** Give a text in the form that goes with `count`, which is one of its values. */
export function plural(key, count, values = {}) {
  const form = new Intl.PluralRules(language).select(count);
  return t(`${key}.${form}`, { count, ...values });
}
