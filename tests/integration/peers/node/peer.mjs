// vda-5050-lib as fleet control, or as robot: one JSON object per event on standard output, until standard input ends.
// node peer.mjs master|robot BROKER_URL INTERFACE MANUFACTURER SERIAL JSON

import { createRequire } from "node:module";

const { AgvController, BlockingType, MasterController, VirtualAgvAdapter } = createRequire(import.meta.url)("vda-5050-lib");
const [role, brokerUrl, interfaceName, manufacturer, serialNumber, given] = process.argv.slice(2);
const options = { interfaceName, transport: { brokerUrl }, vdaVersion: "2.0.0" };
const robot = { manufacturer, serialNumber };
const content = JSON.parse(given);

function tell(event) {
  process.stdout.write(`${JSON.stringify(event)}\n`);
}

function cancel(master) {
  const actions = [{ actionType: "cancelOrder", actionId: "cancel", blockingType: BlockingType.Hard }];
  return master.initiateInstantActions(robot, { instantActions: actions, actions }, {
    onActionStateChanged: ({ actionStatus }) => tell({ event: "instantAction", status: actionStatus }),
    onActionError: (error) => tell({ event: "instantActionError", error: error.errorType }),
  });
}

function assign(master, order, after) {
  return master.assignOrder(robot, order, {
    onNodeTraversed: ({ nodeId }) => tell({ event: "node", nodeId }),
    onActionStateChanged: ({ actionId, actionStatus }) => tell({ event: "action", actionId, status: actionStatus }),
    onOrderProcessed: (error, cancelled, active, { order: { orderId } }) => {
      tell({ event: "processed", orderId, error: error?.errorType ?? null, cancelled, active });
      after?.();
    },
  });
}

async function runMaster() {
  const master = new MasterController(options, {});
  await master.start();
  let begun = false;
  master.trackAgvs((agv, connection) => {
    if (connection !== "ONLINE" || begun) return;
    begun = true;
    const [first, second] = content;
    assign(master, first, () => second && assign(master, second).then(() => cancel(master)));
  });
}

async function runRobot() {
  const controller = new AgvController(robot, options, { agvAdapterType: VirtualAgvAdapter }, content);
  await controller.start();
  tell({ event: "started" });
}

process.stdin.on("end", () => process.exit(0)).resume();
await (role === "master" ? runMaster() : runRobot());
