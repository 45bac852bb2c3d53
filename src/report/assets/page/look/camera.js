'use strict';
// Where the scene is looked at from: an eye that turns about a target.
const vector = {
  add: (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]],
  minus: (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
  times: (a, s) => [a[0] * s, a[1] * s, a[2] * s],
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  length: (a) => Math.hypot(a[0], a[1], a[2]),
  unit: (a) => vector.times(a, 1 / (vector.length(a) || 1)),
};

const camera = (() => {
  const STEEPEST = 1.55; // radians above or below the horizon
  let target = [0, 0, 0], yaw = 0, pitch = 0, distance = 1, fov = 1, reach = 1;

  const forward = () => [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), -Math.cos(yaw) * Math.cos(pitch)];
  const right = () => [Math.cos(yaw), 0, Math.sin(yaw)];
  const up = () => vector.cross(right(), forward());
  const eye = () => vector.minus(target, vector.times(forward(), distance));

  // Looks from a place along a direction; what lies `far` away stays in the middle when turning.
  const stand = (place, along, far, angle) => {
    const way = vector.unit(along);
    yaw = Math.atan2(way[0], -way[2]);
    pitch = Math.max(-STEEPEST, Math.min(STEEPEST, Math.asin(Math.max(-1, Math.min(1, way[1])))));
    distance = far;
    fov = angle;
    target = vector.add(place, vector.times(forward(), far));
  };

  const turn = (across, along) => {
    yaw += across;
    pitch = Math.max(-STEEPEST, Math.min(STEEPEST, pitch + along));
  };

  // Moves in the plane of the picture, in heights of it.
  const pan = (across, along) => {
    const height = 2 * distance * Math.tan(fov / 2);
    target = vector.add(target, vector.add(vector.times(right(), -across * height), vector.times(up(), along * height)));
  };

  const near = (factor) => {
    distance = Math.max(1e-3 * reach, Math.min(20 * reach, distance * factor));
  };

  const lens = () => {
    const nearest = Math.max(2e-4 * reach, 0.02 * Math.min(distance, reach));
    return { near: Math.min(nearest, 5e-3 * reach), far: distance + 8 * reach };
  };

  // Column by column.
  const viewProjection = (aspect) => {
    const planes = lens(), r = right(), u = up(), f = forward(), e = eye();
    // On tall screens the angle counts across.
    const half = Math.tan(fov / 2) / Math.min(1, Math.max(aspect, 0.6) / 1.2);
    const sx = 1 / (half * aspect), sy = 1 / half;
    const a = (planes.far + planes.near) / (planes.near - planes.far), b = (2 * planes.far * planes.near) / (planes.near - planes.far);
    const row = (v, s) => [v[0] * s, v[1] * s, v[2] * s, -vector.dot(v, e) * s];
    const x = row(r, sx), y = row(u, sy), depth = row(f, 1);
    const z = [-depth[0] * a, -depth[1] * a, -depth[2] * a, -depth[3] * a + b];
    return { matrix: [0, 1, 2, 3].flatMap((c) => [x[c], y[c], z[c], depth[c]]), half, near: planes.near };
  };

  // The ray through a place of the picture, in [-1,1] squared, y up.
  const ray = (x, y, aspect) => {
    const { half } = viewProjection(aspect);
    const way = vector.add(forward(), vector.add(vector.times(right(), x * half * aspect), vector.times(up(), y * half)));
    return { origin: eye(), way: vector.unit(way) };
  };

  return {
    stand, turn, pan, near, ray, viewProjection, eye, right, up, forward,
    setReach: (metres) => { reach = metres; },
    state: () => ({ target, yaw, pitch, distance }),
  };
})();
