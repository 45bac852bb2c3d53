// Loads an export of `lightprobe export --to three` into three.js 0.187.
//   for (const grid of await loadProbes('probes.json')) scene.add(grid);
// With WebGPURenderer pass LightProbeGrid of three/addons/lighting/LightProbeGrid.js as the second argument.
import { Data3DTexture, FloatType, HalfFloatType, LinearFilter, RGBAFormat } from 'three';
import { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';

export async function loadProbes(url, Grid = LightProbeGridWebGL) {
  const base = new URL(url, location.href);
  const { volumes } = await (await fetch(base)).json();
  return Promise.all(volumes.map(async ({ file, type, min, max, resolution, priority, engine }) => {
    const bytes = await (await fetch(new URL(file, base))).arrayBuffer();
    const grid = new Grid(...max.map((high, i) => high - min[i]), ...resolution);
    grid.position.set(...max.map((high, i) => (high + min[i]) / 2));
    grid.updateBoundingBox();
    grid.priority = priority;
    const data = type === 'half' ? new Uint16Array(bytes) : new Float32Array(bytes);
    grid.texture = Object.assign(new Data3DTexture(data, ...engine.textureSize), {
      format: RGBAFormat,
      type: type === 'half' ? HalfFloatType : FloatType,
      minFilter: LinearFilter,
      magFilter: LinearFilter,
      needsUpdate: true,
    });
    return grid;
  }));
}
