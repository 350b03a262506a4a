// A browser has no UDP: this passes frames from a WebSocket on to kinespace, and answers back.
// First: npm install node-osc ws, and elsewhere: kinespace live. Then: node bridge.mjs, and open index.html by way of a
// web server that serves the folder above, like: python3 -m http.server
import { Client, Server } from "node-osc";
import { WebSocketServer } from "ws";

// Where kinespace listens, where it answers to, and where the browser finds this.
const [listens = 9310, answers = 9311, sockets = 8081] = process.argv.slice(2).map(Number);

let silence;
const client = new Client("127.0.0.1", listens);
const browsers = new WebSocketServer({ host: "127.0.0.1", port: sockets });
browsers.on("connection", (browser) =>
  browser.on("message", (text) => {
    const { performer, positions } = JSON.parse(text);
    silence ??= setTimeout(() => {
      console.log(`nothing heard yet: does kinespace live --osc-in ${listens} --osc-out ${answers} run?`);
    }, 5000);
    client.send("/motion/frame", performer, 0, ...positions.map((value) => ({ type: "float", value })));
  }),
);

const server = new Server(answers, "127.0.0.1");
const pass = (message) => {
  clearTimeout(silence);
  browsers.clients.forEach((browser) => browser.send(JSON.stringify(message)));
};
server.on("message", pass);
server.on("bundle", (bundle) => bundle.elements.forEach(pass));
console.log(`bridge: ws://127.0.0.1:${sockets}`);
