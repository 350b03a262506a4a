"use strict";
// Finds a body's landmarks in pictures, in a thread of its own: BlazePose by @mediapipe/pose (Google, Apache-2.0).

// The library needs a page's window: here is as much of one as it asks for.
self.window = self;
self.alert = (text) => { throw new Error(text); };
self.document = {
  addEventListener() {},
  createElement: (kind) => (kind === "canvas" ? new OffscreenCanvas(1, 1)
    : { setAttribute(name, value) { this[name] = value; }, addEventListener(event, does) { this[event] = does; } }),
  body: { appendChild(script) { importScripts(script.src); script.load(); } },
};
// It notes how it calculates; what goes wrong is thrown.
for (const kind of ["log", "info", "warn", "error"]) console[kind] = () => {};

let pose = null;
let found = null;

async function begin() {
  importScripts("pose.js");
  pose = new Pose({});
  // As `kinespace camera` does: the full network, on the processor, each picture by itself.
  pose.setOptions({ modelComplexity: 1, smoothLandmarks: false, useCpuInference: true });
  pose.onResults(({ poseLandmarks, poseWorldLandmarks }) => { found = poseWorldLandmarks && [poseLandmarks, poseWorldLandmarks]; });
  await pose.initialize();
}

async function look({ picture, at }) {
  found = null;
  await pose.send({ image: picture }, at);
  picture.close();
  if (!found) return null;
  const [pictured, world] = found;
  const near = (metres) => Math.round(metres * 10000) / 10000;
  // y up; a landmark outside of the picture is a guess.
  return world.map(({ x, y, z }, index) => {
    const inside = [pictured[index].x, pictured[index].y].every((share) => share >= 0 && share < 1);
    return inside ? [near(x), near(-y), near(-z)] : null;
  });
}

self.onmessage = async ({ data }) => {
  try {
    if (!pose) await begin();
    self.postMessage({ at: data?.at, places: data ? await look(data) : null });
  } catch (error) {
    self.postMessage({ failed: String(error?.message ?? error) });
  }
};
