'use strict';
// Controls, keys, fingers, picking, and the table of a point.
const look = (() => {
  const canvas = document.getElementById('view');
  const stage = document.getElementById('stage');
  const message = document.getElementById('state');
  const { info } = data;
  const shown = { visibility: 1, show: 0, probes: true, exposure: info.exposure_ev, cut: Infinity };
  const VISIBILITY = ['off', 'on', 'exact'];
  const STATES = ['active', 'inside geometry', 'nothing samples it'];
  const AWAKE_MS = 180; // after the last move, before the picture is drawn at full resolution
  const PATIENT_MS = 40; // a frame that takes longer is drawn coarser while things move
  let held = null, picked = null, low = [0, 0, 0], high = [1, 1, 1], cost = 0, asked = false, moved = -Infinity, frames = 0;

  const say = (text) => { message.textContent = text; };

  // ---- Drawing, only when something has changed ----

  const paint = () => {
    asked = false;
    if (!held) return;
    const still = performance.now() - moved >= AWAKE_MS;
    const sharp = Math.min(devicePixelRatio || 1, 2);
    const coarse = cost > PATIENT_MS ? Math.max(0.25, Math.sqrt(PATIENT_MS / cost)) : 1;
    const before = performance.now();
    draw.frame(shown, picked, still ? sharp : sharp * coarse);
    if (still) {
      draw.wait();
      cost = performance.now() - before;
      frames++;
      stage.dataset.frames = frames;
      stage.dataset.state = 'ready';
      say('');
    } else setTimeout(ask, AWAKE_MS);
  };
  const ask = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(paint);
  };
  const move = () => {
    moved = performance.now();
    stage.dataset.state = 'moving';
    const { yaw, pitch, distance, target } = camera.state();
    Object.assign(stage.dataset, { yaw: yaw.toFixed(4), pitch: pitch.toFixed(4), distance: distance.toFixed(4), target: target.map((x) => x.toFixed(3)).join(',') });
    ask();
  };
  const change = () => {
    stage.dataset.state = 'changing';
    ask();
  };

  // ---- Picking ----

  // The nearest triangle along a ray that is shown, by trying all of them.
  const hit = ({ origin, way }) => {
    const { place, floats, charts, triangles } = held.mesh;
    let best = null, nearest = Infinity;
    const [ox, oy, oz] = origin, [dx, dy, dz] = way;
    for (let t = 0; t < triangles; t++) {
      const p = 9 * t, c = 8 * t;
      const facing = floats[c + 4] * dx + floats[c + 5] * dy + floats[c + 6] * dz;
      if (facing > 0 && !((charts[c] >>> 30) & 1)) continue;
      const ax = place[p], ay = place[p + 1], az = place[p + 2];
      const e1x = place[p + 3] - ax, e1y = place[p + 4] - ay, e1z = place[p + 5] - az;
      const e2x = place[p + 6] - ax, e2y = place[p + 7] - ay, e2z = place[p + 8] - az;
      const px = dy * e2z - dz * e2y, py = dz * e2x - dx * e2z, pz = dx * e2y - dy * e2x;
      const area = e1x * px + e1y * py + e1z * pz;
      if (area === 0) continue;
      const sx = ox - ax, sy = oy - ay, sz = oz - az;
      const u = (sx * px + sy * py + sz * pz) / area;
      if (u < 0 || u > 1) continue;
      const qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
      const v = (dx * qx + dy * qy + dz * qz) / area;
      if (v < 0 || u + v > 1) continue;
      const far = (e2x * qx + e2y * qy + e2z * qz) / area;
      if (far <= 0 || far >= nearest || oy + far * dy > shown.cut) continue;
      nearest = far;
      best = { triangle: t, far, weights: [1 - u - v, u, v], isFront: facing <= 0 };
    }
    return best && { ...best, place: vector.add(origin, vector.times(way, best.far)) };
  };

  // What a point of a surface asks with, as the shader of surfaces makes it.
  const asker = (found, way) => {
    const { floats, charts, normal, first } = held.mesh;
    const t = found.triangle, c = 8 * t;
    const plane = [floats[c + 4], floats[c + 5], floats[c + 6]];
    const geometric = found.isFront ? plane : vector.times(plane, -1);
    let bent = [0, 0, 0];
    for (let k = 0; k < 3; k++) {
      const at = 12 * t + 4 * k, weight = (found.weights[k] * normal[at + 3]) / 32767;
      bent = vector.add(bent, vector.times([normal[at], normal[at + 1], normal[at + 2]], weight));
    }
    bent = vector.length(bent) > 3000 ? vector.unit(bent) : geometric;
    if (vector.dot(bent, geometric) < 0) bent = vector.times(bent, -1);
    const axis = (charts[c] >>> 28) & 3, u = (axis + 1) % 3, v = (axis + 2) % 3;
    const size = [charts[c + 1] & 0xffff, charts[c + 1] >>> 16], side = info.texel_m;
    const at = [u, v].map((of, k) => Math.max(0, Math.min(size[k] - 1, Math.floor((found.place[of] - floats[c + 2 + k]) / side))));
    const texel = first[t] + (found.isFront ? 0 : size[0] * size[1]) + at[1] * size[0] + at[0];
    const centre = [0, 0, 0];
    centre[u] = floats[c + 2] + (at[0] + 0.5) * side;
    centre[v] = floats[c + 3] + (at[1] + 0.5) * side;
    centre[axis] = (floats[c + 7] - plane[u] * centre[u] - plane[v] * centre[v]) / plane[axis];
    return {
      position: found.place, normal: bent, geometric, view: vector.times(way, -1), texel,
      centre: vector.add(centre, vector.times(geometric, info.nudge_m)), mask: held.texels[4 * texel + 3],
    };
  };

  // Irradiance of a packed texel.
  const unpacked = (bits) => [0, 9, 18].map((shift) => ((bits >>> shift) & 511) * 2 ** ((bits >>> 27) - 24));
  const luminance = (light) => 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2];
  const figure = (value) => (value === 0 ? '0' : Math.abs(value) >= 1e-3 && Math.abs(value) < 1e5 ? value.toPrecision(4) : value.toExponential(2));
  const percent = (share) => `${(100 * share).toFixed(1)} %`;

  // Why the point is as bright as it is.
  const verdict = ([off, on, exact], probes, mask) => {
    if (mask === 0 && on === 0) return 'It sees none of its probes, so it gets no light.';
    if (on === 0 && exact === 0) return 'It is black because the probes that it sees hold no light: none reaches them.';
    if (on === 0) return 'The visibility of the file hides all of its probes, though rays reach some: light is lost.';
    const share = (on - exact) / Math.max(exact, 1e-3 * on);
    if (share > 0.02) return `Leak: ${percent(share)} more than with exact visibility.`;
    if (share < -0.02) return `Light lost: ${percent(-share)} less than with exact visibility.`;
    if (off > 1.1 * on) return 'Right with visibility; without it, hidden probes would add their light.';
    if (off < 0.9 * on) return 'Right with visibility; without it, hidden probes would dim it.';
    return 'Visibility changes next to nothing here.';
  };

  const tell = () => {
    const told = document.getElementById('told'), table = document.getElementById('probes-table');
    if (!picked) {
      told.textContent = 'None is picked.';
      table.hidden = true;
      return;
    }
    const { asked: point, light, rows } = picked;
    const world = point.position.map((x, k) => (x + info.origin_world[k]).toFixed(3)).join(', ');
    const lights = light.map(luminance);
    told.textContent = `At (${world}) m: ${figure(lights[0])} without visibility, ${figure(lights[1])} with it, `
      + `${figure(lights[2])} W·m⁻² with the exact one. ${verdict(lights, rows, point.mask)}`;
    table.hidden = !rows;
    if (!rows) return;
    const body = table.querySelector('tbody');
    body.replaceChildren(...rows.map((row) => {
      const line = document.createElement('tr');
      line.className = ['', 'counts', 'hides', 'idle'][row.mark];
      const cells = [`${row.probe}`, row.byFile, row.byRays, percent(row.on), percent(row.off), row.state ? '–' : figure(row.given), row.far.toFixed(3), STATES[row.state]];
      cells.forEach((text, k) => {
        const cell = document.createElement(k === 0 ? 'th' : 'td');
        if (k === 0) {
          cell.scope = 'row';
          const dot = document.createElement('span');
          dot.className = 'dot';
          cell.append(dot);
        } else if (k > 2 && k < 7) cell.className = 'number';
        cell.append(text);
        line.append(cell);
      });
      return line;
    }));
  };

  // Picks what lies at a place of the picture, in [-1,1] squared, y up.
  const pick = (x, y) => {
    const ray = camera.ray(x, y, canvas.clientWidth / canvas.clientHeight);
    const found = hit(ray);
    picked = null;
    if (found) {
      const point = asker(found, ray.way);
      if (info.is_baked) {
        picked = { place: found.place, asked: point, light: held.lit.map((texels) => unpacked(texels[point.texel])), rows: null };
      } else {
        const answer = draw.lookUp([point])[0];
        const sums = [answer.off, answer.on].map((weights) => weights.reduce((a, b) => a + b, 0) || 1);
        const rows = answer.probes.map((probe, i) => {
          const place = [...held.probes.subarray(4 * probe, 4 * probe + 3)], state = info.states[probe];
          const counts = answer.on[i] > 0, isFree = (answer.seen >> i) & 1, isKnown = (answer.known >> i) & 1;
          return {
            probe, state, far: vector.length(vector.minus(place, found.place)), given: answer.given[i],
            off: answer.off[i] / sums[0], on: answer.on[i] / sums[1], mark: state ? 3 : counts ? 1 : 2,
            byFile: state ? '–' : counts ? 'seen' : answer.off[i] > 0 ? 'hidden' : 'no weight',
            byRays: state || !isKnown ? '–' : isFree ? 'seen' : 'hidden',
          };
        });
        const sides = info.grid_spacing;
        const along = info.grid_points.map((n) => Math.max(1, n - 1));
        const low = found.place.map((p, k) => info.grid_origin[k] + sides[k] * Math.max(0, Math.min(along[k] - 1, Math.floor((p - info.grid_origin[k]) / sides[k]))));
        picked = {
          place: found.place, asked: point, light: answer.light, rows, probes: answer.probes, marks: rows.map((row) => row.mark),
          box: { low, sides: sides.map((side, k) => (info.grid_points[k] > 1 ? side : 0)) },
        };
      }
    }
    tell();
    change();
    return picked;
  };

  const drop = () => {
    picked = null;
    tell();
    change();
  };

  // ---- Controls ----

  const radios = (name) => [...document.querySelectorAll(`input[name="${name}"]`)];
  const legend = () => {
    const figure = document.getElementById('leaks'), end = info.ranges[shown.visibility === 0 ? 0 : 1];
    figure.hidden = shown.show !== 2;
    const texts = figure.querySelectorAll('span');
    const round = +end.toPrecision(2);
    [`−${round}`, '0', `+${round} W·m⁻²`].forEach((text, k) => { texts[k].textContent = text; });
  };
  const set = (name, value) => {
    shown[name] = value;
    for (const radio of radios(name)) radio.checked = +radio.value === value;
    stage.dataset[name] = name === 'visibility' ? VISIBILITY[value] : value;
    legend();
    change();
  };
  for (const name of ['visibility', 'show']) {
    for (const radio of radios(name)) radio.addEventListener('change', () => set(name, +radio.value));
  }
  const probes = document.getElementById('probes');
  const showProbes = (yes) => {
    shown.probes = yes;
    probes.checked = yes;
    change();
  };
  probes.addEventListener('change', () => showProbes(probes.checked));
  const exposure = document.getElementById('exposure');
  const expose = (ev) => {
    shown.exposure = ev;
    exposure.nextElementSibling.textContent = `${ev < 0 ? '−' : '+'}${Math.abs(ev).toFixed(1)} EV`;
    change();
  };
  const start = Math.round(10 * info.exposure_ev) / 10;
  Object.assign(exposure, { min: start - 10, max: start + 10, value: start });
  exposure.addEventListener('input', () => expose(+exposure.value));
  const cut = document.getElementById('cut');
  const cutAt = (share) => {
    cut.value = share;
    shown.cut = share >= 1 ? 1e30 : low[1] + share * (high[1] - low[1]);
    cut.nextElementSibling.textContent = share >= 1 ? 'none' : `${(shown.cut + info.origin_world[1]).toFixed(2)} m`;
    change();
  };
  cut.addEventListener('input', () => cutAt(+cut.value));

  // ---- Views ----

  const stand = (view) => {
    const far = hit({ origin: view.position, way: vector.unit(view.forward) })?.far ?? 0.3 * vector.length(vector.minus(high, low));
    cutAt(1);
    camera.stand(view.position, view.forward, far, view.fov_y_rad);
    move();
  };
  const oversee = () => {
    const middle = vector.times(vector.add(low, high), 0.5), radius = 0.5 * vector.length(vector.minus(high, low));
    const way = vector.unit([-0.45, -0.75, -0.55]);
    camera.stand(vector.minus(middle, vector.times(way, 2.5 * radius)), way, 2.5 * radius, 0.9);
    cutAt(0.6);
    move();
  };
  const views = () => {
    const group = document.getElementById('cameras');
    const button = (text, run) => {
      const made = document.createElement('button');
      made.type = 'button';
      made.textContent = text;
      made.addEventListener('click', run);
      group.append(made);
    };
    for (const view of info.cameras) button(view.name, () => stand(view));
    button('From above', oversee);
    if (info.cameras.length) stand(info.cameras[0]);
    else oversee();
  };

  // ---- Keys ----

  canvas.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = 0.06, arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const arrow = arrows[event.key];
    const keys = {
      '+': () => camera.near(0.87), '=': () => camera.near(0.87), '-': () => camera.near(1.15), '−': () => camera.near(1.15),
      1: () => set('visibility', 0), 2: () => set('visibility', 1), 3: () => set('visibility', 2),
      l: () => set('show', shown.show === 2 ? 0 : 2), p: () => showProbes(!shown.probes),
      0: () => (info.cameras.length ? stand(info.cameras[0]) : oversee()),
      Enter: () => pick(0, 0), Escape: drop,
    };
    if (arrow && event.shiftKey) camera.pan(-arrow[0] * step, -arrow[1] * step);
    else if (arrow) camera.turn(arrow[0] * step, arrow[1] * step);
    else if (keys[event.key.toLowerCase()] ?? keys[event.key]) (keys[event.key] ?? keys[event.key.toLowerCase()])();
    else return;
    event.preventDefault();
    if (arrow || '+=-−'.includes(event.key)) move();
  });

  // ---- Mouse and fingers ----

  const fingers = new Map();
  let begun = null;
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, far: Math.hypot(a.x - b.x, a.y - b.y) };
  };
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    begun = fingers.size === 1 ? { x: event.clientX, y: event.clientY, reach: event.pointerType === 'touch' ? 12 : 5 } : null;
  });
  canvas.addEventListener('pointermove', (event) => {
    const finger = fingers.get(event.pointerId);
    if (!finger) return;
    const before = fingers.size === 2 ? spread() : null;
    const [dx, dy] = [event.clientX - finger.x, event.clientY - finger.y];
    Object.assign(finger, { x: event.clientX, y: event.clientY });
    if (begun && Math.hypot(event.clientX - begun.x, event.clientY - begun.y) < begun.reach) return;
    begun = null;
    const height = canvas.clientHeight;
    if (before) {
      const after = spread();
      if (before.far > 0 && after.far > 0) camera.near(before.far / after.far);
      camera.pan((after.x - before.x) / height, (after.y - before.y) / height);
    } else if (fingers.size > 2) return;
    else if (event.shiftKey || event.buttons & 6) camera.pan(dx / height, dy / height);
    else camera.turn((-2.6 * dx) / height, (2.6 * dy) / height);
    move();
  });
  const lift = (event) => {
    fingers.delete(event.pointerId);
    if (event.type === 'pointerup' && begun && event.button === 0) {
      const box = canvas.getBoundingClientRect();
      pick((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    }
    begun = null;
  };
  for (const kind of ['pointerup', 'pointercancel']) canvas.addEventListener(kind, lift);
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  // A wheel that scrolls the page goes on to do so when the picture comes under it.
  let scrolled = -Infinity;
  addEventListener('scroll', () => { scrolled = performance.now(); }, { passive: true });
  canvas.addEventListener('wheel', (event) => {
    if (performance.now() - scrolled < 300) {
      scrolled = performance.now();
      return;
    }
    event.preventDefault();
    camera.near(Math.exp(Math.max(-0.6, Math.min(0.6, event.deltaY * (event.deltaMode ? 0.05 : 0.0015)))));
    move();
  }, { passive: false });
  new ResizeObserver(change).observe(canvas);
  canvas.addEventListener('webglcontextlost', () => {
    held = null;
    stage.dataset.state = 'lost';
    say('The browser has taken the picture’s memory away. Load the page again.');
  });

  const begin = async () => {
    const found = await draw.open(canvas);
    const { place } = found.mesh;
    low = [Infinity, Infinity, Infinity];
    high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < place.length; i++) {
      if (place[i] < low[i % 3]) low[i % 3] = place[i];
      if (place[i] > high[i % 3]) high[i % 3] = place[i];
    }
    held = found;
    camera.setReach(vector.length(vector.minus(high, low)) || 1);
    const ramp = document.querySelector('#leaks canvas').getContext('2d'), colors = codec.bytesOf(document.body.dataset.colors);
    for (let i = 0; i < 256; i++) {
      ramp.fillStyle = `rgb(${colors[3 * i]} ${colors[3 * i + 1]} ${colors[3 * i + 2]})`;
      ramp.fillRect(i, 0, 1, 1);
    }
    expose(start);
    for (const name of ['visibility', 'show']) set(name, shown[name]);
    say('Drawing …');
    views();
    moved = -Infinity;
  };
  begin().catch((error) => {
    stage.dataset.state = 'failed';
    say(`This picture cannot be drawn: ${error.message}.`);
  });

  return { pick, hit, shown, picked: () => picked };
})();
