"use strict";
// The page of an evaluation: takes to scrub through, what was performed above what was answered.

const { classes, takes } = JSON.parse(byId("shown").textContent);
const stage = new Stage(byId("body"));
const colourOfClass = (name) => colourOf(classes.indexOf(name));
const report = { take: null, at: 0, playing: false, last: 0, bodies: null };
window.kinespace = report;

function choose(index) {
  report.take = takes[index];
  report.bodies = bodiesIn(report.take.bodies);
  stage.setSkeleton(report.take.names, report.take.parents);
  byId("scrub").max = report.take.seconds;
  byId("who").textContent = [report.take.name, report.take.person].filter(Boolean).join(" · ");
  go(0);
}

function go(second) {
  report.at = Math.min(Math.max(second, 0), report.take.seconds);
  const size = 3 * report.take.names.length;
  const last = report.bodies.length / size - 1;
  const place = Math.min(report.at * report.take.rate, last);
  const [before, share] = [Math.floor(place), place % 1];
  const body = new Float32Array(size);
  for (let each = 0; each < size; each += 1) {
    const [one, next] = [report.bodies[before * size + each], report.bodies[Math.min(before + 1, last) * size + each]];
    body[each] = (one + (next - one) * share) / 1000;
  }
  stage.setBody(body);
  byId("scrub").value = report.at;
  draw();
}

/** The span of a list that holds now. */
const now = (spans) => spans.find(([begin, end]) => begin <= report.at && report.at < end)?.[2];

function draw() {
  const { take } = report;
  const [performed, event, named, guess] = [now(take.performed), now(take.events), now(take.named), now(take.guesses)];
  stage.draw({ colour: bodyColour(named ?? -1) });
  byId("performed").textContent = performed ?? "";
  byId("answered").textContent = `event ${classes[event] ?? "–"} · named ${classes[named] ?? "–"} · guess ${classes[guess] ?? "–"}`;
  byId("state").textContent = `${report.at.toFixed(2)} of ${take.seconds.toFixed(2)} s`;
  const timeline = byId("timeline");
  const right = ([begin, end, index]) => {
    const middle = (begin + end) / 2;
    const truth = take.performed.find(([from, to]) => from <= middle && middle < to);
    return !take.performed.length || truth?.[2] === classes[index] ? "" : "wrong";
  };
  const answered = (spans, marked) => spans.map((span) => ({ begin: span[0], end: span[1], label: classes[span[2]],
    colour: colourOf(span[2]), mark: marked ? right(span) : "" }));
  const performedBars = take.performed.map(([begin, end, label]) => ({ begin, end, label, colour: colourOfClass(label) }));
  const rows = [["performed", 24, performedBars], ["events", 24, answered(take.events, true)],
    ["named now", 9, answered(take.named, false)], ["guess", 9, answered(take.guesses, false)]]
    .map(([name, height, bars]) => ({ name, lanes: [{ height, bars }] }));
  rows.push({ name: "score", lanes: [], line: take.scores });
  report.gutter = gutterOf(rows, timeline.clientWidth);
  timeline.style.height = `${heightOf(rows)}px`;
  drawTimeline(timeline, rows, { from: 0, to: Math.max(take.seconds, 0.1), at: report.at, origin: 0,
    tick: [1, 2, 5, 10, 20, 60, 120, 300].find((each) => take.seconds / each < 14) ?? 600, named: (second) => `${second} s` });
}

function play(playing) {
  report.playing = playing;
  report.last = performance.now();
  byId("play").textContent = playing ? "Pause" : "Play";
  if (playing && report.at >= report.take.seconds) go(0);
  if (playing) requestAnimationFrame(step);
}

function step(moment) {
  if (!report.playing) return;
  go(report.at + Math.max(moment - report.last, 0) / 1000 * Number(byId("speed").value));
  report.last = moment;
  if (report.at >= report.take.seconds) play(false); else requestAnimationFrame(step);
}

byId("take").append(...takes.map(({ name, person }, index) => new Option([name, person].filter(Boolean).join(" · "), index)));
byId("take").addEventListener("change", ({ target }) => choose(Number(target.value)));
byId("play").addEventListener("click", () => play(!report.playing));
byId("scrub").addEventListener("input", ({ target }) => { play(false); go(Number(target.value)); });
byId("timeline").addEventListener("click", ({ offsetX }) => {
  const { gutter, take } = report;
  go(Math.max(offsetX - gutter, 0) / (byId("timeline").clientWidth - gutter) * take.seconds);
});
document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, button, canvas")) return;
  if (event.key === " ") { event.preventDefault(); play(!report.playing); }
  if (event.key === "ArrowLeft" || event.key === "ArrowRight") go(report.at + (event.key === "ArrowLeft" ? -0.1 : 0.1));
});
byId("theme").addEventListener("click", () => draw());
window.addEventListener("resize", () => draw());
choose(0);
