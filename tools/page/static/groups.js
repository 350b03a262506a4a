"use strict";
// The page of `kinespace discover`: every group as a body that moves again and again, with a field for its name.

const { folder, groups } = JSON.parse(byId("shown").textContent);
const found = { cards: [], drawn: 0 };
window.kinespace = found;
/** Quote a word for a shell. */
const quoted = (word) => (/^[\w./=-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

function card(group) {
  const canvas = madeStage(`Group ${group.number}, came ${group.came} times: arrows turn the body, plus and minus zoom`);
  const name = made("input", { maxlength: 64, autocomplete: "off", placeholder: "name", "aria-label": `name of group ${group.number}` });
  name.addEventListener("input", showLine);
  const title = made("h2", { text: `${group.number} · ${group.came}× · ${group.seconds} s` });
  byId("groups").append(made("article", { class: "stage" }, canvas, title, name));
  const stage = new Stage(canvas);
  stage.setSkeleton(group.names, group.parents);
  found.cards.push({ group, stage, name, canvas, bodies: bodiesIn(group.bodies), seen: true, frame: -1 });
}

/** Give the body some seconds after its motion began; it begins again at the end, after a short rest. */
function go(each, second) {
  const size = 3 * each.group.names.length;
  const frames = each.bodies.length / size;
  const frame = Math.min(Math.floor((second * each.group.rate) % (frames + each.group.rate / 3)), frames - 1);
  if (frame === each.frame) return;
  if (frame < each.frame) each.stage.trails.forEach((trail) => trail.splice(0));
  each.frame = frame;
  each.stage.setBody(Float32Array.from(each.bodies.subarray(frame * size, (frame + 1) * size), (number) => number / 1000));
  each.stage.draw({ colour: bodyColour(each.name.value ? each.group.number - 1 : -1) });
}

function step(moment) {
  found.cards.filter(({ seen }) => seen).forEach((each) => go(each, moment / 1000));
  found.drawn += 1;
  requestAnimationFrame(step);
}

function showLine() {
  const names = found.cards.filter(({ name }) => name.value.trim()).map(({ group, name }) => quoted(`${group.number}=${name.value.trim()}`));
  byId("line").textContent = `kinespace discover -o ${quoted(folder)} --name ${names.join(" ") || "1=bow"}${byId("rest").checked ? " --rest-nothing" : ""}`;
  byId("copy").disabled = !names.length;
  byId("state").textContent = `${groups.length} groups, ${names.length} named`;
}

groups.forEach(card);
const watch = new IntersectionObserver((entries) => entries.forEach(({ target, isIntersecting }) => {
  found.cards.find(({ canvas }) => canvas === target).seen = isIntersecting;
}));
found.cards.forEach(({ canvas }) => watch.observe(canvas));
byId("rest").addEventListener("change", showLine);
byId("copy").addEventListener("click", async () => {
  await navigator.clipboard.writeText(byId("line").textContent);
  byId("state").textContent = "copied";
});
showLine();
requestAnimationFrame(step);
