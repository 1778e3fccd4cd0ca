#!/usr/bin/env bash
# vda-5050-lib 1.4.0 (npm) with vdaVersion "2.0.0" still reads and writes the array of instant actions under its name of
# VDA 5050 1.1, `instantActions`. The schema of 2.0.0 calls it `actions` and requires it. An AgvClient drops a message
# by the schema before its handler (one line on the console), and takes one with the old name; its master
# sends the old name. A fleet control by the standard can neither pause nor cancel such a robot.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --ignore-scripts --no-audit --no-fund --no-package-lock vda-5050-lib@1.4.0 aedes@0.51.3 >/dev/null
cat > run.js <<'EOF'
const { createServer } = require("node:net");
const aedes = require("aedes")();
const mqtt = require("mqtt");
const { AgvClient, MasterControlClient, Topic } = require("vda-5050-lib");

const robot = { manufacturer: "ACME", serialNumber: "1" };
const topic = "uagv/v2/ACME/1/instantActions";
const header = { headerId: 1, timestamp: "2026-01-01T00:00:00.000Z", version: "2.0.0", ...robot };
const action = (id) => ({ actionId: id, actionType: "startPause", blockingType: "NONE" });

async function main() {
  const server = createServer(aedes.handle);
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const brokerUrl = `mqtt://127.0.0.1:${server.address().port}`;
  const options = { interfaceName: "uagv", transport: { brokerUrl }, vdaVersion: "2.0.0" };

  const taken = [];
  const agv = new AgvClient(robot, options);
  await agv.start();
  const both = new Promise((resolve) =>
    agv.subscribe(Topic.InstantActions, (message) => {
      taken.push(Object.keys(message).find((key) => /actions/i.test(key)));
      resolve();
    }),
  );
  const plain = mqtt.connect(brokerUrl);
  await new Promise((resolve) => plain.on("connect", resolve));
  plain.publish(topic, JSON.stringify({ ...header, actions: [action("by the schema")] }));
  plain.publish(topic, JSON.stringify({ ...header, headerId: 2, instantActions: [action("by its old name")] }));
  await both;
  const first = taken.join();

  const sent = new Promise((resolve) => plain.on("message", (_, payload) => resolve(JSON.parse(payload))));
  await new Promise((resolve) => plain.subscribe(topic, resolve));
  const master = new MasterControlClient(options);
  await master.start();
  let refusal = "none";
  try {
    await master.publish(Topic.InstantActions, robot, { actions: [action("a")] });
  } catch (error) {
    refusal = error.message;
  }
  await master.publish(Topic.InstantActions, robot, { instantActions: [action("b")] });
  const written = Object.keys(await sent).filter((key) => /actions/i.test(key));

  console.log(`its robot takes: ${first}; its master writes: ${written}; for "actions" it says: ${refusal}`);
  const as = first === "instantActions" && written.join() === "instantActions" && /instantActions/.test(refusal);
  process.exit(as ? 0 : 1);
}
main().catch((error) => { console.error(error); process.exit(1); });
EOF
timeout 60 node run.js
