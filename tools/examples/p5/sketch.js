// Sends a squat to kinespace, by way of bridge.mjs, and shows what it answers.
let frames = [];
let label = "";
let next = 0;
let bridge;

function preload() {
  // A line for each frame: x y z in metres of HDM05's 31 joints.
  loadStrings("../squat.txt", (lines) => {
    frames = lines.filter((line) => line.trim()).map((line) => line.trim().split(" ").map(Number));
  });
}

function setup() {
  createCanvas(640, 240);
  frameRate(30);
  textAlign(CENTER, CENTER);
  textSize(32);
  bridge = new WebSocket("ws://127.0.0.1:8081");
  bridge.onmessage = ({ data }) => {
    const [address, told] = JSON.parse(data);
    // A class, or still, or unknown.
    if (address === "/motion/p5/label") label = told;
  };
}

function draw() {
  if (bridge.readyState === WebSocket.OPEN) {
    bridge.send(JSON.stringify({ performer: "p5", positions: frames[next++ % frames.length] }));
  }
  background(20);
  fill(255);
  text(label, width / 2, height / 2);
}
