'use strict';
// What the page holds: the inverse of blocks.rs and mesh.rs.
const data = (() => {
  const info = JSON.parse(document.getElementById('data').textContent);
  const known = new Map(info.blocks.map((block) => [block.name, block]));

  // The numbers of a block; its text is gone afterwards.
  const numbers = async (name) => {
    const { count, width, is_difference, is_float } = known.get(name);
    const element = document.getElementById(`block-${name}`);
    const bytes = await codec.inflate(codec.bytesOf(element.textContent));
    element.remove();
    if (bytes.length !== count * width) throw new Error('the data in this page are damaged');
    if (width === 1 && !is_difference) return bytes;
    const found = width === 2 ? new Uint16Array(count) : new Uint32Array(count);
    for (let byte = 0; byte < width; byte++) {
      for (let i = 0, from = byte * count; i < count; i++) found[i] |= bytes[from + i] << (8 * byte);
    }
    if (is_difference) {
      let value = 0;
      for (let i = 0; i < count; i++) {
        value = (value + ((found[i] >>> 1) ^ -(found[i] & 1))) | 0;
        found[i] = value;
      }
    }
    return is_float ? new Float32Array(found.buffer) : found;
  };

  const sign = (x) => (x >= 0 ? 1 : -1);

  // Triangles one after another, each with vertices of its own, and their charts.
  const mesh = async () => {
    const [positions, normals, indices, sizes, kinds] = [
      await numbers('positions'), await numbers('normals'), await numbers('indices'), await numbers('sizes'), await numbers('kinds'),
    ];
    const vertices = positions.length / 3, triangles = kinds.length;
    const { low, step } = info.quantised;
    const place = new Float32Array(9 * triangles);
    const normal = new Int16Array(12 * triangles);
    const charts = new Uint32Array(8 * triangles);
    const floats = new Float32Array(charts.buffer);
    const first = new Uint32Array(triangles);
    let next = 0;
    for (let t = 0; t < triangles; t++) {
      for (let k = 0; k < 3; k++) {
        const vertex = indices[3 * t + k], at = 3 * t + k;
        for (let axis = 0; axis < 3; axis++) place[3 * at + axis] = low[axis] + positions[axis * vertices + vertex] * step[axis];
        const codes = [normals[vertex], normals[vertices + vertex]];
        if (codes[0] === 65535) continue;
        let [u, v] = codes.map((code) => (code / 65534) * 2 - 1);
        const z = 1 - Math.abs(u) - Math.abs(v);
        if (z < 0) [u, v] = [(1 - Math.abs(v)) * sign(u), (1 - Math.abs(u)) * sign(v)];
        const length = Math.hypot(u, v, z) || 1;
        normal.set([u / length * 32767, v / length * 32767, z / length * 32767, 32767], 4 * at);
      }
      const width = sizes[t], height = sizes[triangles + t], axis = kinds[t] & 3, isDouble = kinds[t] >> 2;
      const corner = (k, of) => place[9 * t + 3 * k + of];
      const edge = (k) => [0, 1, 2].map((of) => corner(k, of) - corner(0, of));
      const [a, b] = [edge(1), edge(2)];
      const across = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
      const size = Math.hypot(...across) || 1;
      const facing = across.map((x) => x / size);
      const least = (of) => Math.min(corner(0, of), corner(1, of), corner(2, of));
      charts[8 * t] = next | (axis << 28) | (isDouble << 30);
      charts[8 * t + 1] = width | (height << 16);
      floats[8 * t + 2] = least((axis + 1) % 3);
      floats[8 * t + 3] = least((axis + 2) % 3);
      floats.set(facing, 8 * t + 4);
      floats[8 * t + 7] = facing[0] * corner(0, 0) + facing[1] * corner(0, 1) + facing[2] * corner(0, 2);
      first[t] = next;
      next += width * height * (isDouble ? 2 : 1);
    }
    return { triangles, place, normal, charts, floats, first, texels: next };
  };

  // Albedo and masks of texels, RGBA.
  const texels = async (count) => {
    const planes = await numbers('texels');
    if (planes.length !== 4 * count) throw new Error('the data in this page are damaged');
    const found = new Uint8Array(4 * count);
    for (let i = 0; i < count; i++) for (let k = 0; k < 4; k++) found[4 * i + k] = planes[k * count + i];
    return found;
  };

  const has = (name) => known.has(name);
  const channels = (name) => known.get(name).channels;
  const text = (id) => document.getElementById(id).textContent;

  return { info, numbers, mesh, texels, has, channels, text };
})();
