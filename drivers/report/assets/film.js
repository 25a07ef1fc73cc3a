"use strict";

// The film: the plate on its supports, displacements enlarged, contacts opening and closing. A flat plate is seen from the
// front; any other can be turned with the pointer.

function film(data) {
  const canvas = document.getElementById("film");
  const context = canvas.getContext("2d");
  const play = document.getElementById("play");
  const slider = document.getElementById("frame");
  const factor = document.getElementById("factor");
  const speed = document.getElementById("speed");
  const words = document.getElementById("filmtime");
  const factorWords = document.getElementById("factorvalue");
  const n = data.times.length;
  const codes = unpack(data.frames, Int16Array);
  const force = data.force ? unpack(data.force, Uint16Array) : null;
  const open = data.open ? unpack(data.open, Uint8Array) : null;
  const contacts = data.feet.length;
  const nodes = data.points.length;
  const state = { frame: data.start, playing: false, yaw: (32 * Math.PI) / 180, pitch: (22 * Math.PI) / 180, begun: 0, from: 0 };
  const listeners = [];

  slider.max = n - 1;
  // The slider for the enlargement is logarithmic; it begins where the largest displacement is a twelfth of the plate.
  const wanted = data.largest > 0 ? (0.085 * data.extent) / data.largest : 1;
  const most = Math.max(wanted * 5, 10);
  factor.max = 1000;
  factor.value = Math.max(0, Math.round((1000 * Math.log(round(wanted))) / Math.log(most)));
  function enlargement() {
    return round(most ** (factor.value / 1000));
  }
  function round(value) {
    if (value <= 1) return 1;
    return Number(value.toPrecision(2));
  }

  function project(p) {
    if (data.flat) return [p[0], p[1], 0];
    const first = (data.up + 1) % 3;
    const second = (data.up + 2) % 3;
    const across = Math.cos(state.yaw) * p[first] + Math.sin(state.yaw) * p[second];
    const deep = -Math.sin(state.yaw) * p[first] + Math.cos(state.yaw) * p[second];
    return [across, Math.sin(state.pitch) * deep + Math.cos(state.pitch) * p[data.up], deep];
  }

  function moved(frame, enlarged) {
    const size = (enlarged * data.largest) / 32767;
    const c = data.components;
    return data.points.map((p, i) => {
      const at = (frame * nodes + i) * c;
      return project([p[0] + size * codes[at], p[1] + size * codes[at + 1], p[2] + (c > 2 ? size * codes[at + 2] : 0)]);
    });
  }

  // The box that all frames stay in, for the enlargement and the direction of view at hand.
  let box = null;
  function measure() {
    const reach = enlargement() * data.largest;
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const p of data.points) {
      const q = project(p);
      left = Math.min(left, q[0]);
      right = Math.max(right, q[0]);
      low = Math.min(low, q[1]);
      high = Math.max(high, q[1]);
    }
    box = { left: left - reach, right: right + reach, low: low - 0.45 * reach - 0.1 * data.extent, high: high + 0.45 * reach };
  }

  function paint() {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    measure();
    const pad = 30;
    const scale = Math.min((width - 2 * pad) / (box.right - box.left), (height - 2 * pad) / (box.high - box.low));
    const px = (q) => [width / 2 + scale * (q[0] - (box.left + box.right) / 2), height / 2 - scale * (q[1] - (box.low + box.high) / 2)];
    const plain = data.points.map((p) => px(project(p)));
    const now = moved(state.frame, enlargement());
    const here = now.map(px);

    context.lineWidth = 1;
    context.strokeStyle = "#9aa3ab";
    context.setLineDash([4, 3]);
    context.beginPath();
    for (const [a, b] of data.edges) {
      context.moveTo(...plain[a]);
      context.lineTo(...plain[b]);
    }
    context.stroke();
    context.setLineDash([]);

    let cells = data.cells;
    if (!data.flat && cells.length) {
      const depth = cells.map((cell) => cell.reduce((sum, i) => sum + now[i][2], 0));
      cells = cells.map((cell, k) => [depth[k], cell]).sort((a, b) => b[0] - a[0]).map((pair) => pair[1]);
    }
    context.fillStyle = "#dbe7f1";
    context.strokeStyle = "#8ba0b3";
    context.lineWidth = cells.length > 800 ? 0.4 : 0.8;
    for (const cell of cells) {
      context.beginPath();
      cell.forEach((i, k) => (k ? context.lineTo(...here[i]) : context.moveTo(...here[i])));
      context.closePath();
      context.fill();
      context.stroke();
    }
    context.beginPath();
    for (const loop of data.loops) {
      loop.forEach((i, k) => (k ? context.lineTo(...here[i]) : context.moveTo(...here[i])));
      context.closePath();
    }
    context.fill("evenodd");
    context.strokeStyle = "#26323c";
    context.lineWidth = 1.6;
    context.beginPath();
    for (const [a, b] of data.edges) {
      context.moveTo(...here[a]);
      context.lineTo(...here[b]);
    }
    context.stroke();
    supports(plain, here, px);
    words.textContent = `t = ${data.times[state.frame].toFixed(3)} s`;
    factorWords.textContent = `\u00d7 ${say(enlargement(), 3)}`;
    canvas.dataset.frame = state.frame;
    canvas.dataset.open = open ? String(openNow()) : "";
    document.getElementById("filmopen").textContent = open ? `${openNow()} of ${contacts} contacts open` : "";
    const ground = data.ground ? data.ground[state.frame] : null;
    document.getElementById("filmground").textContent =
      ground ? `ground ${ground.map((v, k) => (v ? `${"XYZ"[k]} ${say(v, 3)}` : "")).filter(Boolean).join(", ") || "0"} m/s\u00b2` : "";
  }

  function openNow() {
    let count = 0;
    for (let c = 0; c < contacts; c++) count += open[state.frame * contacts + c];
    return count;
  }

  function supports(plain, here, px) {
    const size = contacts > 60 ? 4 : 8;
    for (let c = 0; c < contacts; c++) {
      const foot = plain[data.feet[c]];
      const node = here[data.feet[c]];
      const d = data.directions[c];
      const o = px(project([0, 0, 0]));
      const e = px(project(d));
      const length = Math.hypot(e[0] - o[0], e[1] - o[1]);
      const push = length > 1e-6 ? [(e[0] - o[0]) / length, (e[1] - o[1]) / length] : [0, -1];
      const side = [-push[1], push[0]];
      const lifted = open && open[state.frame * contacts + c];
      context.beginPath();
      context.moveTo(foot[0] - push[0], foot[1] - push[1]);
      context.lineTo(foot[0] - 1.8 * size * push[0] + size * side[0], foot[1] - 1.8 * size * push[1] + size * side[1]);
      context.lineTo(foot[0] - 1.8 * size * push[0] - size * side[0], foot[1] - 1.8 * size * push[1] - size * side[1]);
      context.closePath();
      context.lineWidth = 1.6;
      context.strokeStyle = lifted ? "#D55E00" : "#0072B2";
      context.fillStyle = lifted ? "#ffffff" : "#0072B2";
      context.fill();
      context.stroke();
      if (lifted) {
        context.setLineDash([2, 2]);
        context.beginPath();
        context.moveTo(foot[0], foot[1]);
        context.lineTo(node[0], node[1]);
        context.stroke();
        context.setLineDash([]);
      } else if (force) {
        const tall = (46 * force[state.frame * contacts + c]) / 65535;
        if (tall > 3) {
          const tip = [node[0] + tall * push[0], node[1] + tall * push[1]];
          context.strokeStyle = "#00405f";
          context.lineWidth = contacts > 60 ? 1 : 2.2;
          context.beginPath();
          context.moveTo(node[0], node[1]);
          context.lineTo(tip[0], tip[1]);
          context.moveTo(tip[0] - 6 * push[0] + 3.5 * side[0], tip[1] - 6 * push[1] + 3.5 * side[1]);
          context.lineTo(tip[0], tip[1]);
          context.lineTo(tip[0] - 6 * push[0] - 3.5 * side[0], tip[1] - 6 * push[1] - 3.5 * side[1]);
          context.stroke();
        }
      }
    }
  }

  function show(frame, tell) {
    state.frame = Math.min(Math.max(frame, 0), n - 1);
    slider.value = state.frame;
    paint();
    for (const listener of listeners) listener(state.frame);
    if (tell) clock.set(data.times[state.frame]);
  }

  function stop() {
    state.playing = false;
    play.textContent = "Play";
    play.setAttribute("aria-pressed", "false");
  }

  function start() {
    state.playing = true;
    play.textContent = "Pause";
    play.setAttribute("aria-pressed", "true");
    if (state.frame === n - 1) state.frame = 0;
    state.begun = performance.now();
    state.from = data.times[state.frame];
    requestAnimationFrame(advance);
  }

  function advance(instant) {
    if (!state.playing) return;
    const time = state.from + (Math.max(instant - state.begun, 0) / 1000) * Number(speed.value);
    let frame = nearest(data.times, time);
    if (time >= data.times[n - 1]) frame = n - 1;
    if (frame !== state.frame) show(frame, true);
    if (frame === n - 1) stop();
    else requestAnimationFrame(advance);
  }

  play.addEventListener("click", () => (state.playing ? stop() : start()));
  slider.addEventListener("input", () => { stop(); show(Number(slider.value), true); });
  factor.addEventListener("input", paint);
  speed.addEventListener("change", () => {
    state.begun = performance.now();
    state.from = data.times[state.frame];
  });
  if (!data.flat) {
    let held = null;
    canvas.style.cursor = "grab";
    canvas.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY, state.yaw, state.pitch];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      state.yaw = held[2] + (event.clientX - held[0]) * 0.01;
      state.pitch = Math.min(1.5, Math.max(-0.3, held[3] + (event.clientY - held[1]) * 0.01));
      paint();
    });
    canvas.addEventListener("pointerup", () => { held = null; });
  }
  clock.listeners.push((time) => {
    const frame = nearest(data.times, time);
    if (frame !== state.frame) { stop(); show(frame, false); }
  });
  new ResizeObserver(paint).observe(canvas);
  for (const name of ["beforeprint", "afterprint"]) window.addEventListener(name, paint);
  const forces = (frame) => {
    const values = [];
    for (let c = 0; c < contacts; c++) values.push(force ? (force[frame * contacts + c] / 65535) * data.strongest : 0);
    return values;
  };
  return { show, forces, onFrame: (listener) => listeners.push(listener) };
}

const shownFilm = DATA.film ? film(DATA.film) : null;
for (const [k, spec] of (DATA.lines || []).entries()) {
  const follow = pressureChart(document.getElementById(`pressure-${k}`), spec, shownFilm && DATA.film.force ? shownFilm.forces : null);
  if (shownFilm) shownFilm.onFrame(follow);
}
if (shownFilm) shownFilm.show(DATA.film.start, true);
document.documentElement.dataset.ready = "yes";
