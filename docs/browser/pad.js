// The page "A pad in the browser": MuJoCo's own module simulates the stage in data.js, and this reads and draws the pad.
"use strict";

(() => {
  const PAD = window.PAD, N = PAD.rows * PAD.cols;
  // taxels in the order in which they fail
  const ORDER = Array.from({length: N}, (_, i) => (i * 7 + 3) % N);
  const RADIUS = 12e-3, STEP = 2e-3;
  let mujoco, model, data, taxel, buffer;

  /** Load a surface by its name. */
  function load(surface) {
    data?.delete();
    model?.delete();
    mujoco.FS.writeFile("/stage.xml", PAD.surfaces[surface]);
    model = mujoco.MjModel.loadFromXML("/stage.xml");
    data = new mujoco.MjData(model);
    taxel = new Map();
    for (let i = 0; i < N; i++) {
      const name = `table_pad_taxel_${Math.floor(i / PAD.cols)}_${i % PAD.cols}`;
      taxel.set(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM.value, name), i);
    }
  }

  /** Move the ball towards x, y (m, frame of the pad), press it with a force (N), and simulate some steps. */
  function press(x, y, force, steps) {
    data.ctrl[0] = x;
    data.ctrl[1] = -y; // the pad lies on its back: its y and z axes are turned
    data.ctrl[2] = -force;
    for (let i = 0; i < steps; i++) mujoco.mj_step(model, data);
  }

  /** Return the force on each taxel in the frame of the pad: 3 arrays of N numbers, in newtons. */
  function read() {
    const felt = [0, 1, 2].map(() => new Float64Array(N));
    const contacts = data.contact, view = buffer.GetView(), turned = data.geom_xmat;
    for (let c = 0; c < data.ncon; c++) {
      const contact = contacts.get(c);
      mujoco.mj_contactForce(model, data, c, buffer);
      for (const [geom, sign] of [[contact.geom1, -1], [contact.geom2, 1]]) {
        if (!taxel.has(geom)) continue;
        for (let axis = 0; axis < 3; axis++)
          for (let k = 0; k < 3; k++)
            for (let j = 0; j < 3; j++)
              felt[axis][taxel.get(geom)] += sign * turned[9 * geom + 3 * j + axis] * contact.frame[3 * k + j] * view[k];
      }
      contact.delete();
    }
    contacts.delete();
    return felt;
  }

  /** Return what a sensor of GCS reads: the Poisson effect, gains, and taxels that fail. */
  function sensor(felt, {cx, cy, gain, dropped}) {
    const read = felt.map((axis) => Float64Array.from(axis));
    for (let j = 0; j < N; j++)
      if (felt[2][j] !== 0)
        for (let i = 0; i < N; i++) {
          read[0][i] += cx * PAD.kernel[j][0][i] * felt[2][j];
          read[1][i] += cy * PAD.kernel[j][1][i] * felt[2][j];
        }
    for (let axis = 0; axis < 3; axis++)
      for (let i = 0; i < N; i++) read[axis][i] *= gain[axis];
    for (const i of ORDER.slice(0, dropped)) for (const axis of read) axis[i] = 0;
    return read;
  }

  // taxels at rest and at full force, arrows, and the rim of the ball, on light and on dark pages
  const LIGHT = {rest: [240, 240, 236], full: [195, 0, 31], arrow: "#0b7a34", ball: "#555"};
  const DARK = {rest: [56, 51, 51], full: [255, 96, 84], arrow: "#57d364", ball: "#ccc"};

  /** Draw a pad: red is normal force, arrows are shear; `full` is the force (N) of full red. */
  function draw(canvas, force, full, ball) {
    const colors = document.body.dataset.mdColorScheme === "slate" ? DARK : LIGHT;
    const pen = canvas.getContext("2d"), size = canvas.width / PAD.cols;
    const high = (size * PAD.pitch[0]) / PAD.pitch[1], scale = canvas.width / (PAD.cols * PAD.pitch[1]);
    canvas.height = Math.round(high * PAD.rows);
    const corner = (i) => [(i % PAD.cols) * size, Math.floor(i / PAD.cols) * high];
    for (let i = 0; i < N; i++) {
      const [left, top] = corner(i), share = Math.max(0, Math.min(1, force[2][i] / full));
      pen.fillStyle = `rgb(${colors.rest.map((at, k) => at + (colors.full[k] - at) * share)})`;
      pen.fillRect(left + 1, top + 1, size - 2, high - 2);
    }
    for (let i = 0; i < N; i++) {
      const [left, top] = corner(i), [u, v] = [0, 1].map((axis) => (force[axis][i] / full) * 2 * size);
      if (Math.hypot(u, v) > 1.5) arrow(pen, left + size / 2, top + high / 2, u, v, colors.arrow);
    }
    if (!ball) return;
    pen.strokeStyle = colors.ball;
    pen.setLineDash([4, 4]);
    pen.beginPath();
    pen.arc(canvas.width / 2 + ball[0] * scale, canvas.height / 2 + ball[1] * scale, 0.4 * RADIUS * scale, 0, 7);
    pen.stroke();
    pen.setLineDash([]);
  }

  function arrow(pen, x, y, u, v, color) {
    const length = Math.hypot(u, v), head = Math.min(9, length / 2);
    pen.strokeStyle = pen.fillStyle = color;
    pen.lineWidth = 2.5;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + u, y + v);
    pen.stroke();
    pen.beginPath();
    pen.moveTo(x + u, y + v);
    for (const side of [2.6, -2.6]) {
      const angle = Math.atan2(v, u) + side;
      pen.lineTo(x + u + head * Math.cos(angle), y + v + head * Math.sin(angle));
    }
    pen.fill();
  }

  function start(app) {
    const element = (name) => app.querySelector(`[name=${name}]`);
    const value = (name) => Number(element(name).value);
    const target = [0, 0];
    let touched = false, began;
    const left = app.querySelector(".felt"), right = app.querySelector(".read");
    for (const name of Object.keys(PAD.surfaces)) element("surface").add(new Option(name));
    element("surface").addEventListener("change", () => load(element("surface").value));
    const follow = (event) => {
      if (event.type === "pointermove" && !event.buttons) return;
      touched = true;
      const box = left.getBoundingClientRect();
      target[0] = ((event.clientX - box.left) / box.width - 0.5) * PAD.cols * PAD.pitch[1];
      target[1] = ((event.clientY - box.top) / box.height - 0.5) * PAD.rows * PAD.pitch[0];
      event.preventDefault();
    };
    for (const kind of ["pointerdown", "pointermove"]) left.addEventListener(kind, follow);

    const frame = (now) => {
      began ??= now;
      if (!touched) { // until someone takes the ball, it moves in a circle
        const angle = (now - began) / 1500;
        [target[0], target[1]] = [4e-3 * Math.cos(angle), 4e-3 * Math.sin(angle)];
      }
      press(...target, value("force"), Math.round(0.016 / STEP));
      const felt = read();
      const reading = sensor(felt, {
        cx: value("cx"), cy: value("cy"), gain: [value("gxy"), value("gxy"), value("gz")], dropped: value("dropped"),
      });
      const full = Math.max(0.5, ...felt[2]);
      draw(left, felt, full, [data.qpos[0], -data.qpos[1]]);
      draw(right, reading, full);
      app.querySelector(".scale").textContent =
        `Full red is ${full.toFixed(1)} N; an arrow as long as a taxel is ${(full / 2).toFixed(1)} N.`;
      for (const input of app.querySelectorAll("input")) input.nextElementSibling.textContent = input.value;
      for (const [name, force] of [["felt", felt], ["read", reading]]) {
        const [x, y, z] = force.map((axis) => axis.reduce((a, b) => a + b, 0).toFixed(2));
        app.querySelector(`.sum-${name}`).textContent = `sum: normal ${z} N, shear ${x}, ${y} N`;
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  window.addEventListener("load", async () => {
    const app = document.querySelector(".pad-app"), note = app.querySelector(".note");
    if (typeof loadMujoco === "undefined") {
      note.textContent = "This build of the site lacks MuJoCo's module: run python docs/browser/make.py and build the site again.";
      return;
    }
    mujoco = await loadMujoco();
    buffer = new mujoco.DoubleBuffer(6);
    load("flat");
    note.textContent = `MuJoCo ${mujoco.mj_versionString()}, in this page. Drag on the left pad to move the ball.`;
    app.classList.add("ready"); // until then only the note shows
    start(app);
    window.padApp = {load, press, read, sensor, order: ORDER};
  });
})();
