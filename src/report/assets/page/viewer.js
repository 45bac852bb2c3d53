'use strict';
// One pair of pictures: decoded when it comes into view, developed at any exposure, zoomed and panned together with its heat map.
const viewers = (() => {
  const LARGEST_PIXEL = 64; // of the page for one of the picture
  const ZOOM_STEP = 1.5;
  const KEY_PAN = 0.1; // of the view
  const KEY_SPLIT = 0.02; // of the view
  const HANDLE = 22; // reach of the divide's handle, pixels of the page
  const MOST_DECODED = 4; // pairs kept in memory, of about 60 bytes a pixel each
  const MOST_MARKS = 200; // rings around pixels that are no numbers
  const SCROLL_PAUSE = 250; // ms after a scroll in which the wheel belongs to the page
  const MARK = [255, 0, 255];
  const MISSING = [128, 128, 128];
  const littleEndian = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;
  const packed = ([red, green, blue]) =>
    littleEndian ? ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0 : ((red << 24) | (green << 16) | (blue << 8) | 255) >>> 0;
  const colors = codec.bytesOf(document.body.dataset.colors);
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const signed = (value, digits) => (value < 0 ? '−' : '+') + Math.abs(value).toFixed(digits);

  // Three digits; powers of ten as report/format.rs has them.
  const figure = (value) => {
    if (Number.isNaN(value)) return 'no number';
    if (!Number.isFinite(value)) return value < 0 ? '−∞' : '∞';
    if (value === 0) return '0';
    const magnitude = Math.abs(value);
    const exponent = Number(magnitude.toExponential(2).split('e')[1]);
    const text = exponent >= -4 && exponent < 6 ? Number(magnitude.toPrecision(3)).toFixed(Math.max(0, 2 - exponent)) : magnitude.toExponential(2);
    return (value < 0 ? '−' : '') + text;
  };

  let lastScroll = -Infinity;
  addEventListener('scroll', () => { lastScroll = performance.now(); }, { passive: true });
  let queue = Promise.resolve();
  const decoded = [];

  class Viewer {
    constructor(section) {
      const data = section.dataset;
      this.section = section;
      this.isDisplay = 'display' in data;
      this.isRelative = 'relative' in data;
      this.width = +data.shownWidth;
      this.height = +data.shownHeight;
      this.factor = +data.factor;
      this.range = +data.range;
      this.scale = +data.scale;
      this.unit = data.unit;
      this.baseExposure = +data.exposure;
      this.exposure = this.baseExposure;
      this.worst = data.worst ? data.worst.split(',').map((at) => Math.floor(+at / this.factor)) : null;
      this.compare = section.querySelector('canvas.compare');
      this.heat = section.querySelector('canvas.heat');
      this.range_input = section.querySelector('.divide input');
      this.exposure_input = section.querySelector('.exposure input');
      this.zoom = 1;
      this.centre = [this.width / 2, this.height / 2];
      this.split = 0.5;
      this.pointers = new Map();
      this.codes = null;
      for (const canvas of [this.compare, this.heat]) {
        canvas.parentElement.style.aspectRatio = `${this.width} / ${this.height}`;
        this.listen(canvas);
      }
      this.range_input.addEventListener('input', () => this.setSplit(this.range_input.value / 100));
      if (this.exposure_input) {
        // Around the base's exposure, whatever the unit of its light.
        this.exposure_input.min = (this.baseExposure - 10).toFixed(2);
        this.exposure_input.max = (this.baseExposure + 10).toFixed(2);
        this.exposure_input.value = this.baseExposure.toFixed(2);
        this.exposure_input.addEventListener('input', () => this.setExposure(+this.exposure_input.value));
      }
      section.querySelector('.viewer').addEventListener('click', (event) => {
        const name = event.target.closest('[data-do]')?.dataset.do;
        if (name) this.actions()[name]();
      });
      new ResizeObserver(() => this.draw()).observe(this.compare.parentElement);
      this.tell();
    }

    actions() {
      return {
        in: () => this.zoomBy(ZOOM_STEP),
        out: () => this.zoomBy(1 / ZOOM_STEP),
        fit: () => this.setView(1, [this.width / 2, this.height / 2]),
        pixels: () => this.setView(1 / (this.fit() * devicePixelRatio), this.centre),
        worst: () => {
          const at = this.worst.map((index) => index + 0.5);
          this.setView(Math.max(this.zoom, 12 / this.fit()), at);
          this.read(...at);
        },
        exposure: () => {
          this.exposure_input.value = this.baseExposure.toFixed(2);
          this.setExposure(this.baseExposure);
        },
      };
    }

    // ---- Decoding ----

    async decode() {
      const text = (name) => document.getElementById(`${this.section.id}-${name}`).textContent;
      const planes = (name, count) => codec.planes(text(name), count, this.width, this.height);
      const base = await planes('base', 3);
      const candidate = await planes('candidate', 3);
      const [difference] = await planes('difference', 1);
      const size = this.width * this.height;
      if (this.isRelative) {
        for (let p = 0; p < 3; p++) for (let i = 0; i < size; i++) candidate[p][i] += base[p][i];
      }
      // Stored as G, R − G, B − G.
      for (const [green, red, blue] of [base, candidate]) {
        for (let i = 0; i < size; i++) { red[i] += green[i]; blue[i] += green[i]; }
      }
      const bad = ([green, red, blue]) => {
        const found = [];
        for (let i = 0; i < size; i++) if (!codec.isFinite(red[i]) || !codec.isFinite(green[i]) || !codec.isFinite(blue[i])) found.push(i);
        return found;
      };
      this.codes = { base, candidate, difference };
      this.bad = { base: bad(base), candidate: bad(candidate) };
      const sheet = () => Object.assign(document.createElement('canvas'), { width: this.width, height: this.height });
      this.sheets = { base: sheet(), candidate: sheet(), heat: sheet() };
      this.paintHeat();
      this.develop();
    }

    release() {
      this.codes = null;
      for (const sheet of Object.values(this.sheets)) sheet.width = 0;
      this.sheets = null;
      this.section.dataset.state = 'released';
    }

    develop() {
      const shown = codec.developed(this.exposure, this.isDisplay);
      for (const side of ['base', 'candidate']) {
        const [green, red, blue] = this.codes[side];
        const context = this.sheets[side].getContext('2d');
        const image = context.createImageData(this.width, this.height);
        const words = new Uint32Array(image.data.buffer);
        const [r, g, b, a] = littleEndian ? [0, 8, 16, 255 << 24] : [24, 16, 8, 255];
        for (let i = 0; i < words.length; i++) {
          words[i] = (shown[32768 + red[i]] << r) | (shown[32768 + green[i]] << g) | (shown[32768 + blue[i]] << b) | a;
        }
        for (const i of this.bad[side]) words[i] = packed(MARK);
        context.putImageData(image, 0, 0);
      }
      this.draw();
    }

    paintHeat() {
      const { difference } = this.codes;
      const table = new Uint32Array(65536);
      const seen = new Uint8Array(65536);
      const context = this.sheets.heat.getContext('2d');
      const image = context.createImageData(this.width, this.height);
      const words = new Uint32Array(image.data.buffer);
      for (let i = 0; i < words.length; i++) {
        const at = 32768 + difference[i];
        if (!seen[at]) {
          seen[at] = 1;
          const value = codec.difference(difference[i], this.scale);
          const index = 3 * Math.round(255 * clamp(0.5 * (value / this.range + 1), 0, 1));
          table[at] = packed(difference[i] === codec.NAN ? MISSING : colors.subarray(index, index + 3));
        }
        words[i] = table[at];
      }
      context.putImageData(image, 0, 0);
    }

    // ---- View ----

    // Pixels of the page for one of the picture, when the whole picture fits.
    fit() {
      return Math.min(this.compare.clientWidth / this.width, this.compare.clientHeight / this.height) || 1;
    }

    setView(zoom, centre) {
      const fit = this.fit();
      this.zoom = clamp(zoom, 1, Math.max(1, LARGEST_PIXEL / fit));
      const half = [this.compare.clientWidth, this.compare.clientHeight].map((length) => length / (2 * fit * this.zoom));
      const keep = (at, half, size) => (2 * half >= size ? size / 2 : clamp(at, half, size - half));
      this.centre = [keep(centre[0], half[0], this.width), keep(centre[1], half[1], this.height)];
      this.draw();
    }

    // `about`: a point of the picture that stays where it is.
    zoomBy(factor, about = this.centre) {
      const before = this.zoom;
      const after = clamp(before * factor, 1, Math.max(1, LARGEST_PIXEL / this.fit()));
      this.setView(after, this.centre.map((at, axis) => about[axis] + ((at - about[axis]) * before) / after));
    }

    panBy(dx, dy) {
      const scale = this.fit() * this.zoom;
      this.setView(this.zoom, [this.centre[0] - dx / scale, this.centre[1] - dy / scale]);
    }

    setSplit(split) {
      this.split = clamp(split, 0, 1);
      this.draw();
    }

    setExposure(exposure) {
      this.exposure = exposure;
      this.tell();
      if (!this.codes || this.developing) return;
      this.developing = requestAnimationFrame(() => {
        this.developing = 0;
        if (this.codes) this.develop();
      });
    }

    // A point of the picture from a point of a canvas.
    pictureFromView(canvas, x, y) {
      const scale = this.fit() * this.zoom;
      return [this.centre[0] + (x - canvas.clientWidth / 2) / scale, this.centre[1] + (y - canvas.clientHeight / 2) / scale];
    }

    draw() {
      if (!this.codes) return;
      this.drawing ||= requestAnimationFrame(() => {
        this.drawing = 0;
        if (!this.codes) return;
        this.drawNow();
        this.tell();
      });
    }

    drawNow() {
      const views = [[this.compare, [['base', 0, this.split], ['candidate', this.split, 1]]], [this.heat, [['heat', 0, 1]]]];
      for (const [canvas, parts] of views) {
        const ratio = Math.min(devicePixelRatio || 1, 2);
        const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
        const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
        if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
        const context = canvas.getContext('2d');
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.clearRect(0, 0, width, height);
        const scale = this.fit() * this.zoom * ratio;
        const left = width / 2 - this.centre[0] * scale, top = height / 2 - this.centre[1] * scale;
        context.imageSmoothingEnabled = scale < 1;
        context.imageSmoothingQuality = 'medium';
        for (const [name, from, to] of parts) {
          context.save();
          context.beginPath();
          context.rect(Math.round(from * width), 0, Math.round(to * width) - Math.round(from * width), height);
          context.clip();
          context.drawImage(this.sheets[name], left, top, this.width * scale, this.height * scale);
          if (name !== 'heat') this.ring(context, this.bad[name], scale, left, top, ratio, 'rgb(255 0 255)');
          context.restore();
        }
        if (this.worst) this.ring(context, [this.worst[1] * this.width + this.worst[0]], scale, left, top, ratio, '#000', true);
        if (this.pointed && this.pointed.canvas !== canvas) {
          this.ring(context, [this.pointed.index], scale, left, top, ratio, '#000');
        }
        if (canvas === this.compare) this.drawDivide(context, Math.round(this.split * width), height, ratio);
      }
      Object.assign(this.section.dataset, { state: 'ready', zoom: this.zoom, split: this.split, ev: this.exposure, centre: this.centre.join(',') });
    }

    // A frame around single pixels, large enough to be seen at any zoom.
    ring(context, indices, scale, left, top, ratio, color, round = false) {
      const size = Math.max(scale, 0) + 8 * ratio;
      for (const index of indices.slice(0, MOST_MARKS)) {
        const x = left + ((index % this.width) + 0.5) * scale, y = top + (Math.floor(index / this.width) + 0.5) * scale;
        for (const [style, line] of [['#fff', 3], [color, 1.5]]) {
          context.strokeStyle = style;
          context.lineWidth = line * ratio;
          context.beginPath();
          if (round) context.arc(x, y, size * 0.75, 0, 2 * Math.PI);
          else context.rect(x - size / 2, y - size / 2, size, size);
          context.stroke();
        }
      }
    }

    drawDivide(context, x, height, ratio) {
      const y = height / 2, reach = 12 * ratio;
      context.fillStyle = '#000';
      context.fillRect(x - 1.5 * ratio, 0, 3 * ratio, height);
      context.fillStyle = '#fff';
      context.fillRect(x - 0.75 * ratio, 0, 1.5 * ratio, height);
      context.beginPath();
      context.arc(x, y, reach, 0, 2 * Math.PI);
      context.fill();
      context.strokeStyle = '#000';
      context.lineWidth = ratio;
      context.stroke();
      context.fillStyle = '#000';
      for (const side of [-1, 1]) {
        context.beginPath();
        context.moveTo(x + side * 8 * ratio, y);
        context.lineTo(x + side * 3 * ratio, y - 4 * ratio);
        context.lineTo(x + side * 3 * ratio, y + 4 * ratio);
        context.fill();
      }
    }

    // What controls and labels say.
    tell() {
      const percent = Math.round(this.split * 1000) / 10;
      if (+this.range_input.value !== percent) this.range_input.value = percent;
      this.range_input.setAttribute('aria-valuetext', `${Math.round(percent)} % base`);
      this.section.querySelector('output.zoom').textContent = `${this.zoom < 10 ? this.zoom.toFixed(1).replace(/\.0$/, '') : Math.round(this.zoom)}×`;
      this.section.querySelector('.tag.left').classList.toggle('gone', this.split < 0.12);
      this.section.querySelector('.tag.right').classList.toggle('gone', this.split > 0.8);
      for (const canvas of [this.compare, this.heat]) canvas.classList.toggle('zoomed', this.zoom > 1);
      if (this.exposure_input) {
        const text = `${signed(this.exposure, 2)} EV`;
        this.section.querySelector('.exposure output').textContent = text;
        this.exposure_input.setAttribute('aria-valuetext', text);
      }
    }

    // The pixel at a point of the picture, in words.
    read(x, y) {
      const column = Math.floor(x), row = Math.floor(y);
      if (!this.codes || column < 0 || row < 0 || column >= this.width || row >= this.height) return;
      const i = row * this.width + column;
      const span = (at, size) => (this.factor === 1 ? `${at}` : `${at * this.factor}–${Math.min((at + 1) * this.factor, size) - 1}`);
      const rgb = ([green, red, blue]) =>
        [red, green, blue].map((plane) => (this.isDisplay ? (plane[i] === codec.NAN ? 'no number' : `${plane[i]}`) : figure(codec.radiance(plane[i])))).join(', ');
      const difference = codec.difference(this.codes.difference[i], this.scale);
      const { width, height } = this.section.dataset;
      const parts = [
        ['base', `(${rgb(this.codes.base)})`],
        ['candidate', `(${rgb(this.codes.candidate)})`],
        ['difference', `${difference > 0 ? '+' : ''}${figure(difference)}${this.unit ? ` ${this.unit}` : ''}`],
      ];
      this.section.querySelector('.where').textContent = `x ${span(column, +width)}, y ${span(row, +height)}`;
      this.section.querySelector('.what').replaceChildren(...parts.map(([label, value]) => {
        const span = document.createElement('span');
        const name = document.createElement('b');
        name.textContent = label;
        span.append(name, ` ${value}`);
        return span;
      }));
      return i;
    }

    // ---- Pointer, wheel, keys ----

    listen(canvas) {
      const at = (event) => {
        const box = canvas.getBoundingClientRect();
        return [event.clientX - box.left, event.clientY - box.top];
      };
      canvas.addEventListener('pointerdown', (event) => {
        if (event.button !== 0) return;
        canvas.setPointerCapture(event.pointerId);
        this.pointers.set(event.pointerId, at(event));
        const nearHandle = Math.abs(at(event)[0] - this.split * canvas.clientWidth) < HANDLE;
        this.grip = canvas === this.compare && (this.zoom === 1 || nearHandle) ? 'split' : 'pan';
        if (this.grip === 'split' && event.pointerType === 'mouse') this.setSplit(at(event)[0] / canvas.clientWidth);
      });
      canvas.addEventListener('pointermove', (event) => {
        const point = at(event);
        this.point(canvas, point);
        const before = this.pointers.get(event.pointerId);
        if (!before) return;
        if (this.pointers.size === 2) {
          const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
          const distance = (from) => Math.max(1, Math.hypot(from[0] - other[0], from[1] - other[1]));
          const middle = [(point[0] + other[0]) / 2, (point[1] + other[1]) / 2];
          this.zoomBy(distance(point) / distance(before), this.pictureFromView(canvas, ...middle));
          this.panBy((point[0] - before[0]) / 2, (point[1] - before[1]) / 2);
        } else if (this.grip === 'split') {
          this.setSplit(point[0] / canvas.clientWidth);
        } else {
          this.panBy(point[0] - before[0], point[1] - before[1]);
        }
        this.pointers.set(event.pointerId, point);
      });
      for (const name of ['pointerup', 'pointercancel']) {
        canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
      }
      canvas.addEventListener('pointerleave', () => {
        this.pointed = null;
        this.draw();
      });
      canvas.addEventListener('wheel', (event) => {
        // A scroll that began elsewhere goes on, and so does one that has nothing more to zoom out.
        const scrolling = performance.now() - lastScroll < SCROLL_PAUSE;
        if (event.deltaY === 0 || scrolling || (event.deltaY > 0 && this.zoom === 1)) return;
        event.preventDefault();
        const lines = event.deltaMode === 1 ? 33 : event.deltaMode === 2 ? 400 : 1;
        this.zoomBy(2 ** clamp((-event.deltaY * lines) / 250, -1, 1), this.pictureFromView(canvas, ...at(event)));
        this.point(canvas, at(event));
      }, { passive: false });
      canvas.addEventListener('keydown', (event) => this.key(canvas, event));
    }

    point(canvas, point) {
      const index = this.read(...this.pictureFromView(canvas, ...point));
      this.pointed = index === undefined ? null : { canvas, index };
      this.draw();
    }

    key(canvas, event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const arrows = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      const arrow = arrows[event.key];
      const actions = this.actions();
      if (arrow && canvas === this.compare && !event.shiftKey) {
        if (arrow[0] === 0) return;
        this.setSplit(this.split - arrow[0] * KEY_SPLIT);
      } else if (arrow) {
        this.panBy(arrow[0] * KEY_PAN * canvas.clientWidth, arrow[1] * KEY_PAN * canvas.clientHeight);
        this.read(...this.centre);
      } else if (event.key === '+' || event.key === '=') {
        actions.in();
        this.read(...this.centre);
      } else if (event.key === '-' || event.key === '_' || event.key === '−') {
        actions.out();
        this.read(...this.centre);
      } else if (event.key === '0') {
        actions.fit();
      } else if (canvas === this.compare && (event.key === 'Home' || event.key === 'End')) {
        this.setSplit(event.key === 'Home' ? 0 : 1);
      } else {
        return;
      }
      event.preventDefault();
    }
  }

  // One pair after the other, so that the page answers in between; the one seen longest ago is forgotten.
  const show = (viewer) => {
    viewer.isNear = true;
    queue = queue.then(async () => {
      const at = decoded.indexOf(viewer);
      if (at >= 0) decoded.splice(at, 1);
      decoded.unshift(viewer);
      if (viewer.codes) return;
      await viewer.decode();
      for (let i = decoded.length - 1; i >= MOST_DECODED; i--) {
        if (!decoded[i].isNear) decoded.splice(i, 1)[0].release();
      }
    }).catch((error) => {
      viewer.section.dataset.state = 'failed';
      viewer.section.querySelector('.stills').classList.remove('stand-in');
      viewer.section.querySelector('.viewer').remove();
      console.error(error);
    });
  };

  const all = new Map();
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const viewer = all.get(target);
      viewer.isNear = isIntersecting;
      if (isIntersecting) show(viewer);
    }
  }, { rootMargin: '300px' });
  if ('DecompressionStream' in window) {
    for (const section of document.querySelectorAll('.picture[data-factor]')) {
      all.set(section, new Viewer(section));
      observer.observe(section);
    }
  } else {
    // An old browser: the small pictures stay.
    for (const viewer of document.querySelectorAll('.viewer')) viewer.remove();
    for (const stills of document.querySelectorAll('.stand-in')) stills.classList.remove('stand-in');
  }
  return all;
})();
