"use strict";
// This browser's camera: its pictures go to a worker, which finds the body; the body's landmarks alone go to kinespace.

const MAX_UNSENT = 20000; // bytes that wait for the network, beyond which bodies are left out
const INSECURE = "no camera: a browser gives it to a page that comes by https, or from its own machine (localhost)";
const REFUSALS = { NotAllowedError: "no camera: allow this page to use it, beside the address", NotFoundError: "there is no camera",
  NotReadableError: "no camera: another program may have it" };
/** The camera while it is on, and the counts since it began; tests and the curious may look. */
const eye = { stream: null, worker: null, watching: 0, pictures: 0, bodies: 0, unsent: 0, begun: 0, performer: "" };
window.kinespaceEye = eye;

/** Keep the secret by which kinespace knows this page again; a copied tab is another page. */
function secret() {
  const kept = sessionStorage.getItem("camera") ?? Array.from(crypto.getRandomValues(new Uint8Array(16)), (each) => each.toString(16).padStart(2, "0")).join("");
  sessionStorage.setItem("camera", kept);
  return kept;
}

/** Say what the camera does, or why there is none. */
function sayEye(text) {
  byId("eye").hidden = !text;
  byId("eye-state").textContent = text;
  byId("camera").textContent = eye.stream ? "Camera off" : "Camera";
  byId("picture").toggleAttribute("data-on", Boolean(eye.stream));
}

/** Show what kinespace says of this page's camera. */
function showEye({ performer, unreadable, fast, little }) {
  eye.performer = performer;
  if (!eye.stream || !eye.pictures) return; // news of a camera that is off
  const often = eye.pictures / (performance.now() - eye.begun) * 1000;
  const lost = [["unreadable", unreadable], ["too fast", fast], ["too little of the body", little], ["not sent", eye.unsent]];
  sayEye([performer, `${Math.round(often)} pictures a second`, `a body in ${Math.round(100 * eye.bodies / eye.pictures)} %`,
    ...lost.filter(([, count]) => count).map(([why, count]) => `${why}: ${count}`)].filter(Boolean).join(" · "));
}

async function openEye() {
  if (!window.isSecureContext) return sayEye(INSECURE);
  const models = await fetch("pose.js");
  if (!models.ok) return sayEye((await models.text()).trim().replace("kinespace: ", ""));
  sayEye("the browser asks for its camera …");
  try {
    eye.stream = await navigator.mediaDevices.getUserMedia({ video: { width: 640, height: 360, frameRate: 30, facingMode: "user" } });
  } catch (error) {
    return sayEye(REFUSALS[error.name] ?? `no camera: ${error.message}`);
  }
  eye.stream.getVideoTracks()[0].addEventListener("ended", () => closeEye("the camera has stopped"));
  byId("picture").srcObject = eye.stream;
  await byId("picture").play();
  Object.assign(eye, { pictures: 0, bodies: 0, unsent: 0, begun: 0, worker: new Worker("pose-worker.js") });
  sayEye("getting ready …");
  eye.worker.addEventListener("message", ({ data }) => takeLandmarks(data));
  eye.worker.addEventListener("error", ({ message }) => closeEye(`no camera: ${message}`));
  eye.worker.postMessage(null);
}

function closeEye(why = "") {
  for (const track of eye.stream?.getTracks() ?? []) track.stop();
  eye.worker?.terminate();
  byId("picture").cancelVideoFrameCallback(eye.watching);
  eye.stream = eye.worker = byId("picture").srcObject = null;
  sayEye(why);
}

/** Take the landmarks of a picture, and give the worker the next one. */
function takeLandmarks({ at, places, failed }) {
  if (failed) { closeEye(`no camera: ${failed}`); return; }
  if (at) {
    eye.begun ||= performance.now();
    eye.pictures += 1;
    eye.bodies += Boolean(places);
    const goes = socket.readyState === WebSocket.OPEN && socket.bufferedAmount < MAX_UNSENT;
    // Seconds that go on when the page is loaded again.
    if (places && goes) send({ body: { camera: secret(), at: (performance.timeOrigin + at) / 1000, places } });
    else eye.unsent += Boolean(places);
    if (!places) showEye({ performer: eye.performer });
  }
  eye.watching = byId("picture").requestVideoFrameCallback(async (now, { captureTime }) => {
    const worker = eye.worker;
    const picture = await createImageBitmap(byId("picture"));
    if (worker === eye.worker) worker?.postMessage({ picture, at: captureTime ?? now }, [picture]);
  });
}

byId("camera").addEventListener("click", async ({ target }) => {
  if (eye.stream) { closeEye(); return; }
  target.disabled = true; // while the browser asks
  try { await openEye(); } catch (error) { closeEye(`no camera: ${error.message}`); } finally { target.disabled = false; }
});
