// Sends a squat to kinespace and prints what it answers. First: npm install node-osc, and elsewhere: kinespace live
import { readFileSync } from "node:fs";
import { Client, Server } from "node-osc";

// Where kinespace listens, where it answers to, and how often to squat.
const [listens = 9310, answers = 9311, times = 5] = process.argv.slice(2).map(Number);

// A line for each frame: x y z in metres of HDM05's 31 joints. Joints of other names or in another order: send
// "/motion/skeleton", "node", "Hips", "Spine", ... at the start and every second.
const lines = readFileSync(new URL("squat.txt", import.meta.url), "utf8").trim().split("\n");
const frames = lines.map((line) => line.split(" ").map(Number));

const client = new Client("127.0.0.1", listens);
const server = new Server(answers, "127.0.0.1");
let last = "";
server.on("message", ([address, ...values]) => take(address, values));
// Label, class and scores come together in a bundle.
server.on("bundle", (bundle) => bundle.elements.forEach(([address, ...values]) => take(address, values)));

const silence = setTimeout(() => {
  console.log(`no answer yet: does kinespace live --osc-in ${listens} --osc-out ${answers} run?`);
}, 5000);

function take(address, values) {
  clearTimeout(silence);
  if (address === "/motion/node/label" && values[0] !== last) {
    last = values[0];
    console.log(`node: ${last}`);
  }
  if (address === "/motion/node/event") console.log(`node: ${values[1]} ${values[0]}s at ${values[4].toFixed(1)} s`);
}

let sent = 0;
const timer = setInterval(() => {
  if (sent === times * frames.length) {
    clearInterval(timer);
    setTimeout(() => process.exit(0), 500);
    return;
  }
  // Floats, every one of them: a number that happens to be whole must not become an integer.
  const numbers = frames[sent++ % frames.length].map((value) => ({ type: "float", value }));
  // Who performs, the time in seconds (0: when it arrives), and the positions.
  client.send("/motion/frame", "node", 0, ...numbers);
}, 1000 / 30);
