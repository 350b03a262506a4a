"use strict";
// The live page: takes one message at a time from kinespace, draws it, says so, and sends back what a person asks for.

const SHOWN = 60; // seconds of the timeline
const KEPT_SCORES = 620; // points of a score's line: a minute at ten a second
const OLD = 3; // seconds after which a notice is neither said nor sounded
const NO_FRAMES = 0.5; // seconds without a body after which a performer is grey
const SILENT = 2.5; // seconds without a status after which the recogniser counts as away
const number = (value, digits = 2) => (Number.isFinite(value) ? value.toFixed(digits) : "–");

/** All that the page knows. `drawn` counts pictures; tests and the curious may look. */
const page = { performers: new Map(), classes: [], control: null, status: null, chosen: "", now: 0, since: 0, drawn: 0,
  // A class may be called `constructor`.
  titles: Object.create(null), hits: [], motions: {}, asking: 0, played: 0, wrong: null, taught: "", held: "", sound: true };
window.kinespace = page;
/** How people call a class; the wire has its name. */
const titleOf = (name) => page.titles[name] ?? name;

// --- what comes ---

const decoder = new TextDecoder();
let socket = null;
let waiting = null; // the message to be drawn next

function connect() {
  socket = new WebSocket(`ws://${location.host}/live${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.addEventListener("open", () => { forget(); fetchMotions(); });
  socket.addEventListener("message", ({ data }) => { waiting = data; requestAnimationFrame(show); });
  socket.addEventListener("close", () => {
    showState("no connection to kinespace page, trying again …", true);
    setTimeout(connect, 1000);
  });
}

function send(message) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function forget() {
  for (const name of [...page.performers.keys()]) leave(name);
  page.status = page.control = null;
  page.classes = [];
}

function show() {
  if (waiting === null) return;
  const message = waiting;
  waiting = null;
  const size = new DataView(message).getUint32(0, true);
  const news = JSON.parse(decoder.decode(new Uint8Array(message, 4, size)));
  let place = 4 + size;
  try {
    take(news);
    for (const [name, joints] of news.bodies ?? []) {
      const performer = page.performers.get(name);
      performer?.stage.setBody(new Float32Array(message, place, 3 * joints));
      if (performer) performer.seen = performance.now();
      place += 12 * joints;
    }
    draw();
    page.drawn += 1;
  } finally {
    send({ ack: news.number }); // or nothing would come any more
  }
}

function take(news) {
  page.now = news.now;
  page.since = performance.now();
  if (news.here) {
    for (const name of [...page.performers.keys()].filter((each) => !news.here.includes(each))) leave(name);
    news.here.filter((each) => !page.performers.has(each)).forEach(enter);
  }
  Object.assign(page.titles, news.titles);
  if (news.classes) { page.classes = news.classes; listClasses(); }
  // A class may be called `constructor`.
  if (news.control) { page.control = news.control; Object.setPrototypeOf(page.control.taught, null); listClasses(); showControl(); }
  // What was taught is in its file a second later; a lesson changes much, and the motions once.
  if (news.classes || news.control) { clearTimeout(page.asking); page.asking = setTimeout(fetchMotions, 2000); }
  if (news.status) { page.status = news.status; showStatus(); }
  for (const [name, { names, parents }] of Object.entries(news.skeleton ?? {})) page.performers.get(name)?.stage.setSkeleton(names, parents);
  for (const [name, carried] of Object.entries(news.carried ?? {})) { const each = page.performers.get(name); if (each) each.carried = carried; }
  for (const [name, answer] of Object.entries(news.answer ?? {})) takeAnswer(page.performers.get(name), answer);
  for (const [name, at, guess] of news.guesses ?? []) page.performers.get(name)?.guesses.push([at, guess]);
  for (const motion of news.motions ?? []) takeMotion(motion);
  for (const [name, className, count, begin, end] of news.done ?? []) {
    const performer = page.performers.get(name);
    performer?.counts.set(className, count);
    if (performer) performer.done = [...performer.done, { begin, end, className }].filter((each) => each.end > page.now - SHOWN);
  }
  (news.notices ?? []).forEach(takeNotice);
  (news.replies ?? []).forEach(takeReply);
}

function takeAnswer(performer, answer) {
  if (!performer) return;
  performer.answer = answer;
  const last = performer.scores.at(-1);
  if (!last || answer.at - last[0] >= 0.1) performer.scores.push([answer.at, answer.named || answer.guess ? answer.score : 0]);
  if (performer.scores.length > KEPT_SCORES) performer.scores.shift();
}

function takeMotion([name, key, className, begin, end, mark]) {
  const performer = page.performers.get(name);
  if (!performer) return;
  performer.motions.set(key, { ...performer.motions.get(key), key, className, begin, end, ...(mark ? { mark } : {}) });
  for (const [old, motion] of performer.motions) if (motion.end !== null && motion.end < page.now - SHOWN - 5) performer.motions.delete(old);
  performer.guesses = performer.guesses.filter(([at], place, all) => !(place < all.length - 1 && all[place + 1][0] < page.now - SHOWN));
  performer.going = [...performer.motions.values()].find((motion) => motion.end === null)?.className ?? "";
  if (name === page.chosen) listMotions();
}

// --- performers ---

function enter(name) {
  const canvas = madeStage(`The body of ${name}: arrows turn it, plus and minus zoom, 0 resets`);
  const [doing, moment] = [made("p", { class: "doing", "aria-live": "polite" }), made("p", { class: "moment" })];
  const [lesson, carried] = [made("div", { class: "lesson", "aria-hidden": "true" }), made("p", { class: "carried" })];
  const card = made("article", { class: "stage", "aria-label": name }, canvas,
    made("div", { class: "answers" }, made("p", { class: "who", text: name }), doing, moment), carried, lesson);
  card.addEventListener("pointerdown", () => choose(name));
  canvas.addEventListener("focus", () => choose(name));
  byId("stages").append(card);
  page.performers.set(name, { name, card, doing, moment, lesson, carriedBy: carried, stage: new Stage(canvas), carried: null,
    seen: performance.now(), answer: null, motions: new Map(), guesses: [], done: [], counts: new Map(), scores: [] });
  arrange();
}

function leave(name) {
  page.performers.get(name)?.card.remove();
  page.performers.delete(name);
  arrange();
}

function arrange() {
  byId("empty").hidden = page.performers.size > 0;
  byId("stages").dataset.count = page.performers.size;
  if (!page.performers.has(page.chosen)) choose(page.performers.keys().next().value ?? "");
}

function choose(name) {
  if (page.chosen === name) return;
  page.chosen = name;
  for (const each of page.performers.values()) each.card.setAttribute("aria-current", String(each.name === name));
  byId("bars-title").textContent = name ? `Classes · ${name}` : "Classes";
  listMotions();
}

// --- drawing ---

function draw() {
  for (const performer of page.performers.values()) drawPerformer(performer);
  drawScores();
  drawPast();
}

function drawPerformer(performer) {
  const silent = (performance.now() - performer.seen) / 1000;
  performer.card.classList.toggle("silent", silent > NO_FRAMES);
  if (silent > NO_FRAMES) {
    performer.stage.draw({ colour: colourOf(-1) });
    performer.doing.textContent = performer.carriedBy.textContent = "";
    performer.moment.textContent = `no frames for ${Math.round(silent)} s`;
    return;
  }
  const { answer, stage, carried } = performer;
  const class_ = answer ? page.classes.indexOf(answer.named ? answer.label : performer.going) : -1;
  const progress = answer?.progress;
  stage.draw({ colour: bodyColour(class_), carried: answer?.label === "still" ? null : carried, phase: progress?.phase });
  if (!answer) return;
  const doing = titleOf(performer.going || (answer.named ? answer.label : ""));
  if (performer.doing.textContent !== doing) performer.doing.textContent = doing;
  // As sure as it looks: a name of a low score is small and pale.
  const sure = answer.named ? Math.min(Math.max(answer.score, 0), 1) : 0;
  performer.doing.style.cssText = `opacity: ${(0.45 + 0.55 * sure).toFixed(2)}; scale: ${(0.6 + 0.4 * sure).toFixed(2)}`;
  const scores = answer.label === "still" ? [] : [`score ${number(answer.score)}`, `margin ${number(answer.margin)}`];
  const how = progress ? [`${Math.round(100 * progress.phase)} %`, `${number(progress.speed, 1)} × as fast`] : [];
  const label = titleOf(answer.label);
  performer.moment.replaceChildren(made("b", { text: label === doing ? "" : label }), ` ${[...scores, ...how].join(" · ")}`);
  performer.carriedBy.textContent = answer.label === "still" || !carried || !stage.names?.length ? "" : carriedInWords(stage, carried);
}

/** Name the joints that weigh most: every joint's share of the leading eigenvector. */
function carriedInWords(stage, carried) {
  const heaviest = carried.joints.map((share, joint) => [share, stage.names[joint]]).sort(([one], [other]) => other - one);
  return `carried by ${heaviest.slice(0, 3).map(([share, name]) => `${inWords(name)} ${Math.round(100 * share)} %`).join(", ")}`;
}

/** HDM05 calls a joint by the bone that ends there. */
const BONES = { root: "hips", hipjoint: "hip", femur: "thigh", tibia: "shin", clavicle: "shoulder", humerus: "upper arm", radius: "forearm",
  lowerback: "lower back", upperback: "upper back", thorax: "chest", lowerneck: "neck", upperneck: "upper neck" };
function inWords(joint) {
  const [, side, bone] = /^([lr]?)(hipjoint|femur|tibia|foot|toes|clavicle|humerus|radius|wrist|hand|fingers|thumb)$/.exec(joint) ?? [, "", joint];
  return `${{ l: "left ", r: "right " }[side] ?? ""}${BONES[bone] ?? bone}`;
}

function drawScores() {
  const chosen = page.performers.get(page.chosen);
  const answer = chosen?.card.classList.contains("silent") ? null : chosen?.answer;
  page.rows?.forEach(({ row, fill, score, name, done }, index) => {
    const count = chosen?.counts.get(name);
    const counted = count ? ` ✓ ${count}` : "";
    if (done.textContent !== counted) done.textContent = counted;
    const value = answer?.scores[index] ?? null;
    fill.style.transform = `scaleX(${value === null ? 0 : Math.max(0, Math.min(value, 1)).toFixed(3)})`;
    score.textContent = value === null ? "" : value.toFixed(2);
    row.classList.toggle("best", answer?.guess === name);
  });
}

function drawPast() {
  const canvas = byId("timeline");
  const rows = [...page.performers.values()].map(rowOf);
  const height = `${Math.max(heightOf(rows), 70)}px`;
  if (canvas.style.height !== height) canvas.style.height = height;
  page.hits = drawTimeline(canvas, rows, page.now);
  drawSpan(canvas);
}

function rowOf(performer) {
  const until = performer.answer?.at ?? page.now;
  const bars = [...performer.motions.values()].map((motion) => ({ ...motion, end: motion.end ?? until, label: `${motion.mark === "taught" ? "+ " : ""}${titleOf(motion.className)}`,
    colour: colourOf(page.classes.indexOf(motion.className)) }));
  const guesses = performer.guesses.map(([begin, guess], place, all) => ({ begin, end: all[place + 1]?.[0] ?? until,
    colour: guess ? colourOf(page.classes.indexOf(guess)) : "transparent" }));
  const done = performer.done.map((each) => ({ ...each, colour: colourOf(page.classes.indexOf(each.className)) }));
  return { name: performer.name, lanes: [{ height: 18, names: 2, bars }, { height: 7, bars: guesses }, { height: 4, bars: done }],
    line: page.performers.size <= 2 ? performer.scores : null };
}

// --- lists ---

function listClasses() {
  const list = byId("classes");
  const focused = page.rows?.find(({ row }) => row === document.activeElement)?.name;
  list.replaceChildren();
  page.rows = page.classes.map((name, index) => {
    const fill = made("span", { class: "fill" });
    fill.style.background = colourOf(index);
    const score = made("span", { class: "score" });
    const examples = page.control?.taught[name];
    const done = made("small", { class: "done", title: "how often it was done, from beginning to end" });
    const taught = made("small", { text: examples ? `  taught ${examples}×` : "" });
    const named = made("span", { class: "name", title: name, text: titleOf(name) }, taught, done);
    const small = new Stage(made("canvas", { class: "small", "aria-hidden": "true" }));
    small.zoom = 0.7;
    const row = made("button", {}, small.canvas, named, score, made("span", { class: "track" }, fill));
    row.disabled = !teaches();
    row.classList.toggle("off", Boolean(page.control?.off.includes(name)));
    row.addEventListener("click", () => openClass(name));
    const hint = `another example of ${name}`;
    const again = made("button", { class: "again", text: "+", "aria-label": hint, title: hint });
    again.hidden = !examples || !teaches();
    again.addEventListener("click", () => teach(name));
    list.append(made("li", {}, row, again));
    return { row, fill, score, name, done, small };
  });
  if (!page.classes.length) list.append(made("li", { class: "none", text: page.control ? "None yet: teach one below." : "None yet." }));
  byId("names").replaceChildren(...page.classes.map((name) => new Option("", name)));
  if (focused) focusClass(focused);
}

async function fetchMotions() {
  if (socket.readyState !== WebSocket.OPEN) return;
  const answer = await fetch(`motions.json${location.search}`).catch(() => null);
  page.motions = (answer?.ok && await answer.json().catch(() => null)) || page.motions;
}

const calm = matchMedia("(prefers-reduced-motion: reduce)");
/** Play a motion of each class beside its name; show its middle to people who want no movement. */
function playClasses() {
  page.played += calm.matches ? 0 : 1;
  const list = byId("classes").getBoundingClientRect();
  page.rows?.forEach(({ small, name }, index) => {
    const { names, parents, frames } = page.motions[name] ?? {};
    small.canvas.hidden = !frames;
    const at = small.canvas.getBoundingClientRect();
    if (!frames || at.bottom < list.top || at.top > list.bottom) return;
    // Another library's body of the class may have other joints.
    if (small.names !== names) small.setSkeleton(names, parents);
    small.centre = null; // it stays in the middle
    small.setBody(frames[calm.matches ? frames.length >> 1 : page.played % frames.length]);
    small.draw({ colour: bodyColour(index), bare: true });
  });
}
setInterval(playClasses, 1000 / 12);

/** Give a class's new row the keyboard: the old one is gone. */
const focusClass = (name) => page.rows.find((each) => each.name === name)?.row.focus();

function listMotions() {
  const performer = page.performers.get(page.chosen);
  const motions = [...(performer?.motions.values() ?? [])].filter((motion) => motion.end !== null).reverse();
  // Nobody is asked whether an example is right, nor about what was named before it.
  const named = motions.find((motion) => motion.mark !== "taught");
  const last = motions.some((motion) => motion.mark === "taught" && motion.begin >= named?.end) ? null : named;
  byId("last").textContent = last ? `was ${titleOf(last.className)} right?` : "no motion yet";
  for (const button of document.querySelectorAll("[data-judge]")) button.disabled = !last;
  byId("motions").replaceChildren(...motions.map((motion) => {
    const seconds = `${titleOf(motion.className)} ${number(motion.end - motion.begin, 1)} s`;
    const button = made("button", { class: motion.mark ?? "", text: motion.mark === "taught" ? `taught ${seconds}` : seconds });
    button.style.borderLeftColor = colourOf(page.classes.indexOf(motion.className));
    if (motion.mark === "wrong") button.append(` was ${titleOf(motion.meant)}`);
    button.addEventListener("click", () => openWrong(performer, motion));
    return made("li", {}, button);
  }));
}

function showStatus() {
  const { counters, hop, notes, further, frames, listening, promise } = page.status;
  if (listening.length) byId("place").textContent = listening.join(", ");
  byId("counters").textContent = counters.map(([words, count]) => `${words} ${count}`).join(", ");
  byId("promise").textContent = page.classes.length ? promise : "";
  byId("latency").textContent = `frame to answer ${hop.map((each) => number(1000 * each, 1)).join(" / ")} ms (p50 / p99)`;
  const lines = [...notes, ...(further ? [`${further} further performers are not shown`] : [])];
  for (const each of page.performers.values()) {
    if (!each.answer) each.moment.textContent = notes.find((line) => line.startsWith(`performer ${each.name}: `)) ?? "";
  }
  // While nobody is answered the reasons stand where everybody looks.
  const answered = [...page.performers.values()].some((each) => each.answer);
  for (const [id, shown] of [["why", !answered], ["notes", answered]]) {
    byId(id).replaceChildren(...(shown ? lines : []).map((text) => made("li", { text })));
  }
  showState(`live · ${number(frames, 0)} frames/s`, false);
}

function showState(text, lost) {
  const state = byId("state");
  if (state.textContent !== text) state.textContent = text;
  state.classList.toggle("lost", lost);
}

setInterval(() => {
  if (socket.readyState !== WebSocket.OPEN || document.hidden) return;
  if ([...page.performers.values()].some((each) => performance.now() - each.seen > 1000 * NO_FRAMES)) draw();
  if (!page.status || nowThere() - page.status.at > SILENT) showState("no recogniser: waiting for kinespace live", true);
}, 250);

// --- teaching ---

/** Seconds on the clock of the page's process. */
const nowThere = () => page.now + (performance.now() - page.since) / 1000;
const ask = (command) => send({ ask: command });
const teaches = () => Boolean(page.control?.teaches);

function showControl() {
  byId("teach").toggleAttribute("data-on", teaches());
  const taught = Object.keys(page.control.taught);
  byId("at-will").hidden = !taught.length;
  byId("at-will").classList.toggle("main", !taught.includes("nothing"));
  const { sensitivity } = page.control;
  const slider = byId("sensitivity");
  slider.closest("label").hidden = sensitivity === null;
  if (sensitivity !== null && document.activeElement !== slider) slider.value = sensitivity;
  byId("sensitivity-shown").textContent = sensitivity === null ? "" : number(sensitivity);
}

byId("teach").addEventListener("submit", (event) => {
  event.preventDefault();
  beep(0, 0);
  byId("name").blur();
  teach(byId("name").value.trim(), Number(byId("times").value));
});
/** Begin a lesson of the performer who is chosen; `a` gives another example of its class. */
function teach(name, repetitions = 1) {
  page.taught = name;
  ask({ do: "teach", performer: page.chosen, class: name, repetitions });
}
/** Offered after the first gesture: what a performer does beside it. */
const teachNothing = () => ask({ do: "teach", performer: page.chosen, class: "nothing" });
byId("at-will").addEventListener("click", teachNothing);
for (const button of document.querySelectorAll("[data-do]")) button.addEventListener("click", () => ask({ do: button.dataset.do }));
/** Say that the last motion of the performer who is chosen was named rightly, or wrongly. */
const judge = (how) => ask({ do: how, performer: page.chosen });
for (const button of document.querySelectorAll("[data-judge]")) button.addEventListener("click", () => judge(button.dataset.judge));
/** Record while a button or key is held; without a name the class taught last. */
function hold(on) {
  const name = byId("name").value.trim() || page.taught;
  if (on === Boolean(page.held)) return;
  if (on && !name) { say("a name first"); return; }
  if (on) page.taught = name;
  ask({ do: "hold", performer: page.chosen, class: on ? name : page.held, on });
  page.held = on ? name : "";
}
byId("hold").addEventListener("pointerdown", (event) => { event.target.setPointerCapture(event.pointerId); hold(true); });
for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) byId("hold").addEventListener(end, () => hold(false));
window.addEventListener("blur", () => hold(false));
document.addEventListener("keyup", (event) => { if (event.key === "h" || event.key === " " || event.key === "Enter") hold(false); });
byId("hold").addEventListener("keydown", (event) => { if (event.key === " " || event.key === "Enter") { event.preventDefault(); hold(true); } });
byId("sensitivity").addEventListener("change", ({ target }) => ask({ do: "sensitivity", share: Number(target.value) }));

function takeNotice({ at, performer: name, state, seconds, reason, taught, check, tried, examples }) {
  const old = page.now - at > OLD;
  if (taught) {
    // Also where this page was too busy to hear it in time.
    if (byId("name").value.trim() === taught) byId("name").value = "";
    for (const { lesson } of page.performers.values()) if (lesson.textContent === "checking") lesson.replaceChildren();
    if (!old) say(`${taught}: ${examples} ${examples === 1 ? "example" : "examples"}, ${check}${tried && `; it would have been ${tried}`}`);
    return;
  }
  const performer = page.performers.get(name);
  // How much a performer moves who is waited for: a bar that fills; or that movement is free.
  const goes = ["waiting", "recording"].includes(state) && reason;
  const words = { waiting: "move now", recording: goes || "recording", checking: "checking" }[state];
  const share = state === "waiting" ? Number(/^movement (\d+)%/.exec(reason)?.[1] ?? (reason ? NaN : 0)) : NaN;
  if (performer) {
    const filled = Number.isNaN(share) ? [] : [made("i", { style: `--share: ${Math.min(share / 100, 1)}` })];
    const slow = state === "waiting" && reason && !filled.length ? reason : words;
    performer.lesson.replaceChildren(state === "countdown" ? String(Math.round(seconds)) : slow ?? "", ...filled);
    performer.lesson.classList.toggle("words", state !== "countdown");
  }
  if (old) return;
  if (state === "countdown") { beep(440, 0.12); say(reason || String(Math.round(seconds))); }
  if (state === "waiting" && !goes) { beep(880, 0.3); say("move now"); }
  if (state === "recording") say("");
  if (state === "checking") beep(660, 0.15);
  if (state === "refused") { beep(180, 0.4); say(`refused: ${reason}`); }
  if (state === "done" && !performer) say(reason);
}

function takeReply({ states }) {
  const refused = states.find((each) => each.state === "refused");
  if (refused) say(`refused: ${refused.reason}`);
  else if (page.wrong) {
    const { performer, key, meant } = page.wrong;
    // News of the bar may have come since the question.
    Object.assign(performer.motions.get(key) ?? {}, { mark: "wrong", meant });
    listMotions();
  }
  page.wrong = null;
}

let silence = 0;
function say(text) {
  byId("said").textContent = text;
  clearTimeout(silence);
  silence = setTimeout(() => { byId("said").textContent = ""; }, 5000);
}

let audio = null;
/** Sound a tone; the first call must come from a click, or a browser stays silent. */
function beep(pitch, seconds) {
  audio ??= new AudioContext();
  if (!pitch || !page.sound) return;
  const [tone, volume] = [audio.createOscillator(), audio.createGain()];
  tone.frequency.value = pitch;
  volume.gain.setValueAtTime(0.2, audio.currentTime);
  volume.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + seconds);
  tone.connect(volume).connect(audio.destination);
  tone.start();
  tone.stop(audio.currentTime + seconds);
}

/** Open a dialog; `answered` gets the value of the button that closes it, empty where none has one. */
function openDialog(id, answered) {
  const dialog = byId(id);
  dialog.returnValue = "";
  dialog.onclose = () => answered(dialog.returnValue);
  dialog.showModal();
}

function openClass(name) {
  byId("class-title").textContent = titleOf(name);
  byId("answers").hidden = !teaches();
  byId("enabled").checked = !page.control?.off.includes(name);
  byId("enabled").onchange = ({ target }) => ask({ do: "enable", class: name, on: target.checked });
  byId("own").hidden = !(name in (page.control?.taught ?? {}));
  byId("rename").value = name;
  openDialog("class", (answer) => {
    if (answer === "rename") ask({ do: "rename", class: name, to: byId("rename").value.trim() });
    if (answer === "forget") ask({ do: "forget", class: name });
    focusClass(name);
  });
}

function openWrong(performer, motion) {
  if (!teaches() || motion.end === null || motion.mark === "taught") return;
  byId("wrong-title").textContent = `${titleOf(motion.className)}, ${number(motion.end - motion.begin, 1)} s`;
  byId("meant").replaceChildren(...["nothing", ...page.classes.filter((name) => name !== motion.className)].map((name) => new Option(titleOf(name), name)));
  openDialog("wrong", (answer) => { if (answer) correct(performer, motion, byId("meant").value); });
}

/** Teach that a bar was another class. A motion is named some time after it began: its bar begins with the guess that led to it. */
function correct(performer, motion, meant) {
  const led = performer.guesses.findLast(([at]) => at <= motion.begin);
  const begin = led && led[1] === motion.className ? led[0] : motion.begin;
  page.wrong = { performer, key: motion.key, meant };
  // Counted from the last frame: a feed may pause.
  const ago = Math.max(nowThere() - (performance.now() - performer.seen) / 1000 - motion.end, 0);
  ask({ do: "last", performer: performer.name, seconds: motion.end - begin, class: meant, ago });
}

byId("timeline").addEventListener("click", (event) => {
  const hit = page.hits.find(({ x, y, width, height, bar }) => bar.key && event.offsetX >= x && event.offsetX <= x + width
    && event.offsetY >= y && event.offsetY <= y + height);
  if (!hit) return;
  choose(hit.row.name);
  const performer = page.performers.get(hit.row.name);
  openWrong(performer, performer.motions.get(hit.bar.key));
});

// --- the page ---

byId("sound").addEventListener("click", ({ target }) => {
  page.sound = !page.sound;
  target.setAttribute("aria-pressed", String(page.sound));
});

byId("theme").addEventListener("click", () => {
  localStorage.setItem("theme", document.documentElement.dataset.theme);
  draw();
});

document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, dialog") || event.ctrlKey || event.metaKey || event.altKey) return;
  const name = [...page.performers.keys()][Number(event.key) - 1];
  if (name && event.target.tagName !== "CANVAS") choose(name);
  const does = { t: () => { event.preventDefault(); byId("name").select(); }, a: () => page.taught && teach(page.taught),
    h: () => hold(true), y: () => judge("right"), n: () => judge("wrong"), m: teachNothing, Escape: () => ask({ do: "cancel" }) };
  if (teaches() && Object.hasOwn(does, event.key)) does[event.key]();
});

setTheme(localStorage.getItem("theme") ?? document.documentElement.dataset.theme);
connect();
