'use strict';
// Charts of a sweep on logarithmic axes. Every mark tells its configuration, and shows its picture when it is chosen.
(() => {
  document.documentElement.classList.add('scripts');
  const data = JSON.parse(document.getElementById('data').textContent);
  const SVG = 'http://www.w3.org/2000/svg';
  const SIZE = { width: 560, height: 380, left: 62, right: 14, top: 12, bottom: 46 };
  const COLORS = 8;
  const tip = document.getElementById('tip');
  const shown = document.getElementById('shown');
  const color = (ladder) => `var(--c${ladder % COLORS})`;

  const make = (parent, name, attributes, text) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== undefined) element.textContent = text;
    parent.append(element);
    return element;
  };

  // Round values from the least to the most: 1, 2 and 5 times powers of ten, fewer where there are many, more where there are few.
  const rounds = (low, high, steps) => {
    const all = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const step of steps) all.push(step * 10 ** power);
    }
    return all.filter((value) => value >= low && value <= high);
  };

  const ticks = (low, high) => {
    let inside = rounds(low, high, [1, 2, 5]);
    if (inside.length < 3) inside = rounds(low, high, [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8]);
    const tens = inside.filter((value) => Math.abs(Math.log10(value) - Math.round(Math.log10(value))) < 1e-9);
    return inside.length > 9 && tens.length > 1 ? tens : inside;
  };

  const written = (value) => (value >= 1e5 || value < 1e-3 ? value.toExponential(0) : String(Number(value.toPrecision(3))));

  const axis = (values, from, to) => {
    const low = Math.min(...values) / 1.25;
    const high = Math.max(...values) * 1.25;
    const at = (value) => from + ((Math.log(value) - Math.log(low)) / (Math.log(high) - Math.log(low))) * (to - from);
    return { at, ticks: ticks(low, high) };
  };

  const tell = (point, configuration) => {
    tip.textContent = [configuration.label, data.ladders[configuration.ladder],
      ...data.figures.map((figure, i) => `${figure.name}: ${configuration.texts[i]}`)].join('\n');
    tip.hidden = false;
    const mark = point.getBoundingClientRect();
    const left = Math.min(mark.right + 8, document.documentElement.clientWidth - tip.offsetWidth - 8);
    tip.style.left = `${Math.max(left, 4) + scrollX}px`;
    tip.style.top = `${mark.bottom + 8 + scrollY}px`;
  };

  const choose = (index) => {
    const configuration = data.configurations[index];
    for (const mark of document.querySelectorAll('.mark')) mark.classList.toggle('chosen', Number(mark.dataset.index) === index);
    shown.hidden = false;
    shown.querySelector('h2').textContent = `${data.ladders[configuration.ladder]}: ${configuration.label}`;
    const pictures = shown.querySelectorAll('img');
    [configuration.picture, data.reference, configuration.difference].forEach((source, i) => {
      pictures[i].closest('figure').hidden = !source;
      if (source) pictures[i].src = source;
    });
    shown.querySelector('tbody').replaceChildren(...data.figures.map((figure, i) => {
      const row = document.createElement('tr');
      const name = document.createElement('th');
      name.scope = 'row';
      name.textContent = figure.name;
      const value = document.createElement('td');
      value.className = 'number';
      value.textContent = configuration.texts[i];
      row.append(name, value);
      return row;
    }));
    shown.querySelector('pre').textContent = configuration.config;
  };

  const chart = ({ title, x, y, front }) => {
    const points = data.configurations
      .map((configuration, index) => ({ configuration, index, x: configuration.values[x], y: configuration.values[y] }))
      .filter((point) => point.x > 0 && point.y > 0);
    const figure = document.createElement('figure');
    const caption = document.createElement('figcaption');
    const zero = data.configurations.filter(({ values }) => values[x] === 0 || values[y] === 0).length;
    caption.textContent = zero ? `${title} (${zero} at 0 not shown: the axes are logarithmic)` : title;
    figure.append(caption);
    if (!points.length) return figure;
    const svg = make(figure, 'svg', { viewBox: `0 0 ${SIZE.width} ${SIZE.height}`, role: 'group', 'aria-label': title });
    const bottom = SIZE.height - SIZE.bottom;
    const along = axis(points.map((p) => p.x), SIZE.left, SIZE.width - SIZE.right);
    const up = axis(points.map((p) => p.y), bottom, SIZE.top);
    for (const value of along.ticks) {
      make(svg, 'path', { class: 'grid', d: `M${along.at(value)} ${SIZE.top}V${bottom}` });
      make(svg, 'text', { class: 'tick', x: along.at(value), y: bottom + 16, 'text-anchor': 'middle' }, written(value));
    }
    for (const value of up.ticks) {
      make(svg, 'path', { class: 'grid', d: `M${SIZE.left} ${up.at(value)}H${SIZE.width - SIZE.right}` });
      make(svg, 'text', { class: 'tick', x: SIZE.left - 6, y: up.at(value) + 4, 'text-anchor': 'end' }, written(value));
    }
    make(svg, 'text', { x: (SIZE.left + SIZE.width) / 2, y: SIZE.height - 8, 'text-anchor': 'middle' }, data.axes[x]);
    make(svg, 'text', { transform: `translate(13 ${(SIZE.top + bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, data.axes[y]);
    data.ladders.forEach((_, ladder) => {
      const curve = points.filter((p) => p.configuration.ladder === ladder).sort((a, b) => a.x - b.x);
      if (curve.length > 1) make(svg, 'path', { class: 'curve', stroke: color(ladder), d: `M${curve.map((p) => `${along.at(p.x)} ${up.at(p.y)}`).join('L')}` });
    });
    // Boxes of text: left end, baseline, width. No name lies on a mark.
    const taken = points.map((point) => [along.at(point.x) - 8, up.at(point.y) + 4, 16]);
    for (const point of points) {
      const { configuration, index } = point;
      const [px, py] = [along.at(point.x), up.at(point.y)];
      const mark = make(svg, 'circle', { class: 'mark', cx: px, cy: py, r: 6, tabindex: 0, role: 'button', stroke: color(configuration.ladder),
        fill: configuration.fronts[front] ? color(configuration.ladder) : 'var(--paper)', 'aria-label': configuration.label });
      mark.dataset.index = index;
      for (const event of ['mouseenter', 'focus']) mark.addEventListener(event, () => tell(mark, configuration));
      for (const event of ['mouseleave', 'blur']) mark.addEventListener(event, () => { tip.hidden = true; });
      mark.addEventListener('click', () => choose(index));
      mark.addEventListener('keydown', (event) => {
        if (event.key !== 'Enter' && event.key !== ' ') return;
        event.preventDefault();
        choose(index);
      });
      // Names stand beside their marks where nothing stands yet.
      const width = configuration.short.length * 6 + 4;
      const fits = (at) => at[0] >= SIZE.left && at[0] + width <= SIZE.width &&
        taken.every((other) => at[0] + width < other[0] || other[0] + other[2] < at[0] || Math.abs(at[1] - other[1]) > 11);
      const place = [[px + 9, py + 4], [px - 9 - width, py + 4], [px - width / 2, py - 10], [px - width / 2, py + 18]].find(fits);
      if (place) {
        make(svg, 'text', { class: 'name', x: place[0], y: place[1] }, configuration.short);
        taken.push([...place, width]);
      }
    }
    return figure;
  };

  const key = document.createElement('p');
  key.className = 'key';
  data.ladders.forEach((name, ladder) => {
    const item = document.createElement('span');
    const dot = document.createElement('i');
    dot.style.background = color(ladder);
    item.append(dot, name);
    key.append(item);
  });
  const charts = document.getElementById('charts');
  charts.before(key);
  charts.append(...data.charts.map(chart));
})();
