"use strict";
// A span of the past is an example: dragged over the timeline, or typed in as seconds ago.

const LONGEST = 15; // seconds that an example may last
const DRAGGED = 5; // points from which on a pointer that moves drags

/** The span that is chosen: its performer and its ends on the clock of the page's process; null for none. */
let span = null;
let dragging = null;

/** Mark the span on the timeline, which has just been drawn. */
function drawSpan(canvas) {
  if (!span) return;
  const { left, seconds } = scaleOf(canvas);
  const place = (second) => left + Math.max(second - page.now + SHOWN, 0) / seconds;
  const [from, to] = [place(span.begin), place(span.end)];
  const context = canvas.getContext("2d");
  Object.assign(context, { fillStyle: theme.warm, globalAlpha: 0.25 });
  context.fillRect(from, 0, to - from, canvas.clientHeight - 16);
  Object.assign(context, { strokeStyle: theme.warm, globalAlpha: 1, lineWidth: 2 });
  context.strokeRect(from, 1, to - from, canvas.clientHeight - 18);
}

/** Where the timeline's bars begin, in points, and the seconds of a point. */
function scaleOf(canvas) {
  const left = gutterOf([...page.performers.values()], canvas.clientWidth);
  return { left, seconds: SHOWN / (canvas.clientWidth - left) };
}

/** The performer whose row a height is in: the last one that begins above it. */
function performerAt(y) {
  const above = page.hits.filter((hit) => hit.y - 2 <= y).map(({ row }) => row.name);
  return above.at(-1) ?? page.chosen;
}

function chooseSpan(performer, one, other) {
  const [begin, end] = [Math.min(one, other), Math.min(Math.max(one, other), nowThere())];
  span = { performer, begin: Math.max(begin, end - LONGEST), end };
}

/** Write the span's ends into the fields, as seconds ago. */
function writeSpan() {
  for (const [id, second] of [["span-from", span.begin], ["span-to", span.end]]) byId(id).value = Math.max(nowThere() - second, 0).toFixed(1);
}

function forgetSpan() {
  span = dragging = null;
  byId("span").reset();
  drawPast();
}

const timeline = byId("timeline");
timeline.addEventListener("pointerdown", (event) => {
  if (!teaches()) return;
  const { left, seconds } = scaleOf(timeline);
  const secondAt = (x) => page.now - SHOWN + (Math.min(Math.max(x, left), timeline.clientWidth) - left) * seconds;
  dragging = { x: event.offsetX, begin: secondAt(event.offsetX), performer: performerAt(event.offsetY), secondAt, moved: false };
  timeline.setPointerCapture(event.pointerId);
});
timeline.addEventListener("pointermove", (event) => {
  if (!dragging || (!dragging.moved && Math.abs(event.offsetX - dragging.x) < DRAGGED)) return;
  dragging.moved = true;
  chooseSpan(dragging.performer, dragging.begin, dragging.secondAt(event.offsetX));
  drawPast();
});
for (const ended of ["pointerup", "pointercancel"]) timeline.addEventListener(ended, () => {
  if (dragging?.moved) {
    choose(span.performer);
    writeSpan();
    byId("span-name").select();
  }
});
// A drag is no click on a bar: this listener comes before the page's own.
timeline.addEventListener("click", (event) => {
  if (dragging?.moved) event.stopImmediatePropagation();
  dragging = null;
}, { capture: true });

for (const id of ["span-from", "span-to"]) byId(id).addEventListener("input", () => {
  const [from, to] = [byId("span-from").valueAsNumber, byId("span-to").valueAsNumber];
  span = null;
  if (from > to) chooseSpan(page.chosen, nowThere() - from, nowThere() - to);
});
byId("span").addEventListener("submit", (event) => {
  event.preventDefault();
  if (!span) { say("from: expected more seconds ago than to"); return; }
  const ago = Math.max(nowThere() - span.end, 0);
  page.taught = byId("span-name").value.trim();
  ask({ do: "last", performer: span.performer, seconds: span.end - span.begin, class: page.taught, ago });
  forgetSpan();
});
byId("span").addEventListener("keydown", (event) => { if (event.key === "Escape") forgetSpan(); });
