"use strict";
// What the page draws: its colours, bodies on a stage, and bars over time.

/** The colour of a class by its index: far apart for neighbours, as light in every hue. */
function colourOf(index, lightness = 0.76) {
  return index < 0 ? `oklch(${lightness - 0.1} 0.015 250)` : `oklch(${lightness} 0.145 ${(40 + index * 137.508) % 360})`;
}

const byId = (id) => document.getElementById(id);
const isLight = () => document.documentElement.dataset.theme === "light";

/** The page's own colours as they are now: a canvas does not follow them by itself. */
const theme = {};

/** Choose the page's colours, and name the other choice on its button. */
function setTheme(name) {
  document.documentElement.dataset.theme = name;
  byId("theme").textContent = isLight() ? "Dark" : "Light";
  const style = getComputedStyle(document.documentElement);
  for (const each of ["ground", "line", "text", "soft", "warm", "bad"]) theme[each] = style.getPropertyValue(`--${each}`).trim();
}

byId("theme").addEventListener("click", () => setTheme(isLight() ? "dark" : "light"));
setTheme(matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");

/** The colour of the body that does a class. */
const bodyColour = (index) => colourOf(index, isLight() ? 0.58 : 0.78);

/** Make an element with text and attributes; text from outside never becomes markup. */
function made(kind, { text = "", ...attributes } = {}, ...children) {
  const element = document.createElement(kind);
  if (kind === "button") element.type = "button";
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...(text ? [text] : []), ...children);
  return element;
}

/** Make a canvas for a `Stage`, which the keyboard reaches. */
const madeStage = (label) => made("canvas", { tabindex: 0, role: "img", "aria-label": label });

/** Fit a canvas to its place on the screen; give its context and its size in points. */
function fitted(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const pixels = { width: Math.round(width * ratio), height: Math.round(height * ratio) };
  if (canvas.width !== pixels.width || canvas.height !== pixels.height) Object.assign(canvas, pixels);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** Draw a line through points. */
function stroke(context, points) {
  context.beginPath();
  for (const { x, y } of points) context.lineTo(x, y);
  context.stroke();
}

const TRAIL = 40; // bodies that a trail shows
const LIT = "#fff3b0"; // the light on joints that carry the decision
const NEAR = 0.2; // metres before the eye, at least

/** A body in three dimensions on a floor, with its shadow, trails, and what carries the decision. */
class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.reset();
    this.setSkeleton([], []);
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => event.buttons && this.turn(event.movementX / 150, event.movementY / 200));
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.closer(Math.exp(event.deltaY / 800)); }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** Look from where the stage is seen at first. */
  reset() { Object.assign(this, { yaw: 0.6, pitch: 0.16, zoom: 1 }); }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(Math.max(this.pitch + pitch, -0.2), 1.5);
  }

  closer(factor) { this.zoom = Math.min(Math.max(this.zoom * factor, 0.35), 4); }

  key(event) {
    const does = { ArrowLeft: () => this.turn(-0.12, 0), ArrowRight: () => this.turn(0.12, 0), ArrowUp: () => this.turn(0, 0.08),
      ArrowDown: () => this.turn(0, -0.08), "+": () => this.closer(0.9), "-": () => this.closer(1.1), 0: () => this.reset() }[event.key];
    if (does) { event.preventDefault(); does(); }
  }

  /** Take the joints' names and parents; -1: a joint without a parent. */
  setSkeleton(names, parents) {
    Object.assign(this, { names, upright: [0, 0], centre: null, floor: Infinity, size: 0 });
    this.bones = parents.map((parent, joint) => [parent, joint]).filter(([parent]) => parent >= 0);
    this.head = names.findIndex((name) => /^head$/i.test(name));
    const tips = [/^l(hand|wrist)$/i, /^r(hand|wrist)$/i, /^l(toes|foot)$/i, /^r(toes|foot)$/i].map(
      (kind) => names.findIndex((name) => kind.test(name))).filter((joint) => joint >= 0);
    const leaves = names.map((_, joint) => joint).filter((joint) => !parents.includes(joint));
    this.tips = tips.length ? tips : leaves.slice(0, 4);
    this.trails = this.tips.map(() => []);
    // HDM05 calls a joint by the bone that ends there: these are the shoulders and the hips.
    const trunk = ["lclavicle", "rclavicle", "rhipjoint", "lhipjoint"].map((name) => names.indexOf(name));
    this.trunk = trunk.includes(-1) ? [] : trunk;
    const within = /^(lower|upper)back$|^thorax$|^[lr](clavicle|hipjoint)$/;
    if (this.trunk.length) this.bones = this.bones.filter(([, joint]) => !within.test(names[joint]));
    this.feet = names.map((name, joint) => (/foot|toe|ankle/i.test(name) ? joint : -1)).filter((joint) => joint >= 0);
  }

  /** Take a body (x, y, z of each joint, metres, y or z up) and keep its joints as {x, y up, z}. */
  setBody(numbers) {
    const joints = [];
    const zUp = this._zIsUp(numbers);
    let [low, high, x, z, count] = [Infinity, -Infinity, 0, 0, 0];
    for (let place = 0; place < numbers.length; place += 3) {
      const joint = zUp ? { x: numbers[place], y: numbers[place + 2], z: -numbers[place + 1] }
        : { x: numbers[place], y: numbers[place + 1], z: numbers[place + 2] };
      joints.push(joint);
      if (Number.isNaN(joint.x + joint.y + joint.z)) continue;
      low = Math.min(low, joint.y);
      high = Math.max(high, joint.y);
      x += joint.x;
      z += joint.z;
      count += 1;
    }
    if (!count) return;
    this.joints = joints;
    this.size = Math.max(high - low, this.size * 0.9995);
    this.floor = low < this.floor ? low : this.floor + (low - this.floor) * 0.002;
    const [cx, cz] = [x / count, z / count];
    const far = !this.centre || Math.hypot(cx - this.centre.x, cz - this.centre.z) > 2 * this.size;
    const pace = far ? 1 : 0.06;
    this.centre = { x: (this.centre?.x ?? 0) * (1 - pace) + cx * pace, z: (this.centre?.z ?? 0) * (1 - pace) + cz * pace };
    this.at = { x: cx, z: cz };
    this.tips.forEach((joint, index) => {
      const last = this.trails[index].at(-1);
      if (last && !(Math.hypot(last.x - joints[joint].x, last.y - joints[joint].y, last.z - joints[joint].z) < 0.25 * this.size)) this.trails[index].length = 0;
      this.trails[index].push(joints[joint]);
      if (this.trails[index].length > TRAIL) this.trails[index].shift();
    });
  }

  /** Which axis is up: that along which a head is above the feet in the first second. */
  _zIsUp(numbers) {
    const [y, z] = this.upright;
    if (this.head >= 0 && this.feet.length && Math.abs(y) + Math.abs(z) < 40) {
      const over = (axis) => numbers[3 * this.head + axis] - this.feet.reduce((sum, joint) => sum + numbers[3 * joint + axis], 0) / this.feet.length;
      const [up, side] = [over(1), over(2)];
      if (Number.isFinite(up + side)) this.upright = [y + up, z + side];
    }
    return z > 2 * Math.abs(y);
  }

  _project({ x, y, z }) {
    const [dx, dy, dz] = [x - this.centre.x, y - this.floor - 0.5 * this.size, z - this.centre.z];
    const [cosine, sine] = this.turned;
    const [side, ahead] = [dx * cosine - dz * sine, dx * sine + dz * cosine];
    const depth = Math.max(this.distance - ahead * this.tilted[0] - dy * this.tilted[1], NEAR);
    const scale = this.focus / depth;
    return { x: this.middle.x + side * scale, y: this.middle.y - (dy * this.tilted[0] - ahead * this.tilted[1]) * scale, scale, depth };
  }

  /**
   * Draw the body, in a `colour`, with what is `carried` ({joints, pairs}) or null, and with a ring that says how far in
   * a motion it is (`phase`, 0 to 1, or null); or `bare`: nothing but the body.
   */
  draw({ colour, carried = null, phase = null, bare = false }) {
    const { context, width, height } = fitted(this.canvas);
    if (!this.joints || !width) return;
    this.distance = 2.35 * this.size * this.zoom;
    this.focus = 1.42 * Math.min(height, width * 1.15);
    this.middle = { x: width / 2, y: height * 0.58 };
    this.turned = [Math.cos(this.yaw), Math.sin(this.yaw)];
    this.tilted = [Math.cos(this.pitch), Math.sin(this.pitch)];
    context.lineCap = context.lineJoin = "round";
    if (!bare) { this._drawFloor(context); this._drawShadow(context); }
    if (phase !== null) this._drawRing(context, phase, colour);
    if (!bare) this._drawTrails(context, colour);
    const points = this.joints.map((joint) => this._project(joint));
    this._drawBones(context, points, colour, bare);
    if (carried) this._drawCarried(context, points, carried);
  }

  _line(context, from, to) {
    const [a, b] = [this._project(from), this._project(to)];
    context.moveTo(a.x, a.y);
    context.lineTo(b.x, b.y);
  }

  _drawFloor(context) {
    const step = this.size / 3.4;
    const reach = 7 * step;
    const [x, z] = [Math.round(this.centre.x / step) * step, Math.round(this.centre.z / step) * step];
    // The floor fades away from the body. Fading the lines costs a fraction of fading the picture below them.
    const foot = this._project({ ...this.centre, y: this.floor });
    const fade = context.createRadialGradient(foot.x, foot.y, 0, foot.x, foot.y, reach * 0.8 * foot.scale);
    fade.addColorStop(0, theme.soft);
    fade.addColorStop(1, `${theme.soft}00`);
    Object.assign(context, { strokeStyle: fade, globalAlpha: 0.35, lineWidth: 1 });
    context.beginPath();
    for (let across = -reach; across <= reach + step / 2; across += step) {
      this._line(context, { x: x + across, y: this.floor, z: z - reach }, { x: x + across, y: this.floor, z: z + reach });
      this._line(context, { x: x - reach, y: this.floor, z: z + across }, { x: x + reach, y: this.floor, z: z + across });
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  _drawShadow(context) {
    const { scale } = this._project({ ...this.at, y: this.floor });
    Object.assign(context, { strokeStyle: "#000", globalAlpha: 0.28, lineWidth: 0.05 * this.size * scale });
    context.beginPath();
    const down = (joint) => ({ ...this.joints[joint], y: this.floor });
    for (const [parent, joint] of this.bones) {
      if (Number.isFinite(this.joints[parent].x + this.joints[joint].x)) this._line(context, down(parent), down(joint));
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  _drawRing(context, phase, colour) {
    const arc = (share) => Array.from({ length: 49 }, (_, step) => {
      const angle = 2 * Math.PI * share * step / 48 - Math.PI / 2;
      return this._project({ x: this.at.x + 0.36 * this.size * Math.cos(angle), y: this.floor, z: this.at.z + 0.36 * this.size * Math.sin(angle) });
    });
    Object.assign(context, { strokeStyle: theme.line, lineWidth: 4 });
    stroke(context, arc(1));
    Object.assign(context, { strokeStyle: colour, lineWidth: 8 });
    stroke(context, arc(Math.min(Math.max(phase, 0.001), 1)));
  }

  _drawTrails(context, colour) {
    context.strokeStyle = colour;
    for (const trail of this.trails) {
      const points = trail.map((joint) => this._project(joint));
      for (let from = 0; from < points.length - 1; from += 5) {
        const share = (from + 5) / TRAIL;
        Object.assign(context, { globalAlpha: 0.55 * share, lineWidth: 1 + 3 * share });
        stroke(context, points.slice(from, from + 6));
      }
    }
    context.globalAlpha = 1;
  }

  _drawBones(context, points, colour, bare) {
    const there = (joints) => joints.every((joint) => Number.isFinite(points[joint].x));
    const depth = (joints) => joints.reduce((sum, joint) => sum + points[joint].depth, 0) / joints.length;
    const pieces = [...this.bones, ...(this.trunk.length ? [this.trunk] : [])].filter(there)
      .map((joints) => [joints, depth(joints)]).sort(([, one], [, other]) => other - one);
    context.fillStyle = colour;
    // Each piece has a rim in the ground's colour, so that a limb before the trunk stays clear; a small body has none.
    const strokes = bare ? [[colour, 0]] : [[theme.ground, 3], [colour, 0]];
    for (const [joints] of pieces) {
      const wide = Math.max(this._thickness(joints) * points[joints[0]].scale, 2);
      for (const [style, more] of strokes) {
        Object.assign(context, { strokeStyle: style, lineWidth: wide + more });
        context.beginPath();
        for (const joint of joints) context.lineTo(points[joint].x, points[joint].y);
        if (joints.length > 2) { context.closePath(); context.fill(); }
        context.stroke();
      }
    }
    if (!pieces.length) for (const point of points) this._dot(context, point, 4);
    if (this.head >= 0 && there([this.head])) this._dot(context, points[this.head], 0.06 * this.size * points[this.head].scale);
  }

  /** A bone is as thick as it is long, within limits: fingers are thin, thighs thick. */
  _thickness(joints) {
    if (joints.length > 2) return 0.05 * this.size;
    const [from, to] = joints.map((joint) => this.joints[joint]);
    const long = Math.hypot(from.x - to.x, from.y - to.y, from.z - to.z);
    return Math.min(Math.max(0.2 * long, 0.016 * this.size), 0.045 * this.size);
  }

  _dot(context, { x, y }, radius) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
  }

  _drawCarried(context, points, carried) {
    const most = Math.max(...carried.joints);
    carried.joints.forEach((share, joint) => {
      const [strength, point] = [share / most, points[joint]];
      if (strength < 0.3 || !Number.isFinite(point.x)) return;
      const radius = 0.07 * strength * this.size * point.scale;
      const light = context.createRadialGradient(point.x, point.y, 0, point.x, point.y, radius);
      light.addColorStop(0, LIT);
      light.addColorStop(0.25, LIT);
      light.addColorStop(1, `${LIT}00`);
      Object.assign(context, { fillStyle: light, globalAlpha: strength });
      this._dot(context, point, radius);
    });
    Object.assign(context, { strokeStyle: theme.text, globalAlpha: 0.7, lineWidth: 1.5 });
    context.setLineDash([5, 5]);
    for (const pair of carried.pairs) stroke(context, pair.map((joint) => points[joint]));
    context.setLineDash([]);
    context.globalAlpha = 1;
  }
}

const GUTTER = 96; // points for the performers' names
const NAMES = 15; // points of a line of names
const SMALL = "12px system-ui, sans-serif";

/** Points left of the bars that rows' names take. */
const gutterOf = (rows, width) => rows.some((row) => row.name) && width > 500 ? GUTTER : 0;

/**
 * Draw rows of bars over the minute before `now`. Each row has a `name`, `lanes` ({height, names: lines of names,
 * bars: [{begin, end, label, colour, mark}]}) and perhaps a `line` ([[second, 0 to 1]]). Gives the bars' places, for a
 * pointer: [{x, y, width, height, bar, row}].
 */
function drawTimeline(canvas, rows, now) {
  const { context, width, height } = fitted(canvas);
  const gutter = gutterOf(rows, width);
  const place = (second) => gutter + (1 - (now - second) / SHOWN) * (width - gutter);
  const hits = [];
  Object.assign(context, { font: SMALL, textBaseline: "middle", textAlign: "center" });
  Object.assign(context, { fillStyle: theme.soft, strokeStyle: theme.line, lineWidth: 1 });
  for (let ago = 0; ago <= SHOWN; ago += 10) {
    const x = place(now - ago);
    stroke(context, [{ x, y: 0 }, { x, y: height - 16 }]);
    if (x > gutter + 16 && x < width - 16) context.fillText(`${-ago} s`, x, height - 8);
  }
  let top = 2;
  for (const row of rows) {
    Object.assign(context, { textAlign: "left", fillStyle: theme.soft });
    if (gutter) context.fillText(shortened(context, row.name, gutter - 8), 0, top + row.lanes[0].height / 2);
    context.save();
    context.beginPath();
    context.rect(gutter, 0, width - gutter, height);
    context.clip();
    for (const lane of row.lanes) {
      // Whole names stand above the bars, in two lines where one is too short; the list below has those that find no room.
      const free = Array(lane.names ?? 0).fill(-Infinity);
      for (const bar of lane.bars) {
        if (bar.end < now - SHOWN) continue;
        const [x, wide] = [place(bar.begin), Math.max(place(bar.end) - place(bar.begin), 2)];
        const long = context.measureText(bar.label).width;
        const at = Math.max(Math.min(x, width - long), gutter);
        const tier = free.findLastIndex((end) => end <= at);
        if (tier >= 0) {
          context.fillStyle = theme.text;
          context.fillText(bar.label, at, top + NAMES * tier + NAMES / 2);
          free[tier] = at + long + 6;
        }
        const box = { x, y: top + NAMES * free.length, width: wide, height: lane.height };
        drawBar(context, box, bar);
        hits.push({ ...box, bar, row });
      }
      top += heightOfLane(lane);
    }
    if (row.line) {
      Object.assign(context, { strokeStyle: theme.text, lineWidth: 1.5 });
      context.beginPath();
      let last = -Infinity;
      for (const [second, value] of row.line) {
        const [x, y] = [place(second), top + 22 - 21 * value];
        if (second - last > 1) context.moveTo(x, y); else context.lineTo(x, y);
        last = second;
      }
      context.stroke();
      top += 26;
    }
    context.restore();
    top += 6;
  }
  return hits;
}

function drawBar(context, { x, y, width, height }, bar) {
  const isWrong = bar.mark === "wrong";
  Object.assign(context, { fillStyle: bar.colour, globalAlpha: isWrong ? 0.3 : 1 });
  context.beginPath();
  context.roundRect(x, y, width, height, Math.min(height / 4, 5));
  context.fill();
  context.globalAlpha = 1;
  if (bar.mark) {
    Object.assign(context, { strokeStyle: isWrong ? theme.bad : theme.text, lineWidth: 2 });
    context.stroke();
  }
  if (isWrong) stroke(context, [{ x, y: y + height / 2 }, { x: x + width, y: y + height / 2 }]);
}

function shortened(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let kept = text;
  while (kept && context.measureText(`${kept}…`).width > width) kept = kept.slice(0, -1);
  return `${kept}…`;
}

const heightOfLane = (lane) => lane.height + NAMES * (lane.names ?? 0) + 3;

/** The height in points that rows need. */
function heightOf(rows) {
  const lanes = (row) => row.lanes.reduce((sum, lane) => sum + heightOfLane(lane), 0) + (row.line ? 26 : 0) + 6;
  return rows.reduce((sum, row) => sum + lanes(row), 0) + 20;
}
