// Press once, follow the faces until one's own is there, and write it as ID.xyz, for each point
// x y z (mm) red green blue sigma (mm):   node press.mjs ADDRESS [OWN.secret HUB.public]
import { randomUUID } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { Dealer, Subscriber } from "zeromq";

const [address, own, hub] = process.argv.slice(2);
const publications = address.startsWith("ipc:") ? `${address}.publications`
  : address.replace(/\d+$/, (port) => Number(port) + 1);
const options = { receiveTimeout: 2000, receiveHighWaterMark: 16, maxMessageSize: 2 ** 25 };
if (own) {
  const pair = JSON.parse(readFileSync(own, "utf8"));
  [options.curvePublicKey, options.curveSecretKey] = [pair.public_key, pair.secret_key];
  options.curveServerKey = JSON.parse(readFileSync(hub, "utf8")).public_key;
}
const dealer = new Dealer({ ...options, immediate: true });
const subscriber = new Subscriber(options);
const fail = (why) => { console.error(why); process.exit(1); };
dealer.events.on("handshake:error:auth", () => fail(`${address}: the hub refuses this key`));

async function receive(socket, at = 0) { // a header and its arrays; {} after two silent seconds
  const parts = await socket.receive().catch(
    ({ code }) => (code === "EAGAIN" ? Array(at + 1).fill("{}") : fail(code)));
  return [JSON.parse(parts[at]), ...parts.slice(at + 1)];
}

let number = 0;
async function request(kind, fields) {
  const text = JSON.stringify({ kind, version: 2, request: ++number, ...fields });
  for (let answer = [{}]; ; answer = await receive(dealer)) {
    if (!answer[0].kind) await dealer.send(text); // and again, until it is answered
    if (answer[0].request !== number) continue;
    if (answer[0].kind === "request_failed") fail(answer[0].message);
    return answer;
  }
}

function pointsOf({ initial_points: n, dense_points: m, grid_shape: [rows, columns] }, parts) {
  const row = Math.ceil(columns / 8); // bytes of dense_support
  const sizes = [12 * n, 3 * n, rows * row, 4 * columns, 4 * rows, 4 * m, 3 * m, 4 * m, 2 * m];
  if (`${parts.map((part) => part.length)}` !== `${sizes}`) fail("the arrays are not as told");
  const [, , support, x, y, z, colors, , sigma] = parts;
  const lines = [];
  for (let v = 0; v < rows; v++) for (let u = 0; u < columns; u++) {
    if (!(support[v * row + (u >> 3)] & (128 >> u % 8))) continue; // no point there
    const i = lines.length;
    if (i === m) fail("there are more points than told");
    const half = sigma.readUInt16LE(2 * i); // a float16, never below 0
    const mm = half < 1024 ? half * 2 ** -24 : (1024 + half % 1024) * 2 ** ((half >> 10) - 25);
    lines.push([x.readFloatLE(4 * u), y.readFloatLE(4 * v), z.readFloatLE(4 * i),
      ...colors.subarray(3 * i, 3 * i + 3), mm].join(" "));
  }
  if (lines.length < m) fail("there are fewer points than told");
  return lines;
}

setTimeout(fail, 60_000, `${address}: no face within 60 s: is a hub there, and this key allowed?`);
dealer.connect(address);
subscriber.connect(publications);
subscriber.subscribe("faces");
let [{ epoch, sequence }] = await request("find_start", { since: new Date().toISOString() });
const id = randomUUID();
const [{ reason, message: why }] = await request("press", { capture_id: id });
if (reason) fail(`${reason}: ${why}`);
for (let behind = true; ;) { // whether outcomes may have been missed: those are asked for
  const [outcome, ...arrays] = await (behind ? request("get_next", { after: sequence })
    : receive(subscriber, 1)); // behind its topic
  if (!behind && (outcome.epoch !== epoch || outcome.sequence !== sequence + 1)) behind = true;
  else if (outcome.epoch !== epoch) [epoch, sequence] = [outcome.epoch, 0]; // another store
  else if (outcome.kind === "nothing_newer") [behind, sequence] = [false, outcome.sequence];
  else {
    sequence = outcome.sequence;
    const { capture_id: name, face, message } = outcome;
    console.log(`${name}: ${face ? `${face.dense_points} points` : message}`);
    if (name === id && face) writeFileSync(`${id}.xyz`, pointsOf(face, arrays).join("\n"));
    if (name === id) process.exit(face ? 0 : 1);
  }
}
