// Irradiance from probes at a point: the look-up of lightprobe in GLSL ES 3.00 (WebGL 2), for vertex and fragment shaders.
// What it binds, and the names that it is compiled with: README.md of the folder above.

precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;

// Texels of all textures lie row by row, 2^ROW_SHIFT a row.
#ifndef ROW_SHIFT
#define ROW_SHIFT 11
#endif

uniform vec3 gridOrigin; // point (0,0,0), in the space of the positions that ask
uniform vec3 gridSpacing;
uniform ivec3 gridPoints;
uniform sampler2D probes; // RGBA: place; width of the probe's cell in the finest, negative where the probe is not active
uniform sampler2D light; // RGB: HARMONICS a probe, or the maps
#ifdef VOXELS
uniform usampler2D roots; // R32UI, one a cell
uniform usampler2D words; // R16UI
#endif
#ifdef DISTANCE_RESOLUTION
uniform sampler2D distances; // RG: mean and deviation
#endif
#ifdef MIXED_LEVELS
uniform usampler2D gridIndex; // R32UI
#endif

// Where the visibility factor comes from.
const int VISIBILITY_OFF = 0;
const int VISIBILITY_STORED = 1;
const int VISIBILITY_EXACT = 2; // bit i of a mask: corner i is visible

// What asks. All directions are unit; geometric and view lie on the viewer's side of the surface.
struct Asker {
  vec3 position;
  vec3 normal; // shading normal: irradiance is asked for around it
  vec3 geometric;
  vec3 view; // towards the viewer
};

// Lowest corner, and the place within the cell, each in [0,1].
struct Cell {
  ivec3 base;
  vec3 fraction;
};

// Bit 0 of a corner's number is +x, bit 1 is +y, bit 2 is +z. Weights are not normalised.
struct Corners {
  int probe[8];
  float weight[8];
};

ivec2 placeOf(int texel) {
  return ivec2(texel & ((1 << ROW_SHIFT) - 1), texel >> ROW_SHIFT);
}

// ---- The grid ----

vec3 gridFromScene(vec3 position) {
  return (position - gridOrigin) / gridSpacing;
}

ivec3 cellsAlong() {
  return max(gridPoints - 1, ivec3(1));
}

// 0 along axes with a single layer of probes.
ivec3 layered() {
  return min(gridPoints, ivec3(2)) - 1;
}

vec3 fractionIn(ivec3 base, vec3 position) {
  return clamp(gridFromScene(position) - vec3(base), 0.0, 1.0) * vec3(layered());
}

// The cell of a point; points outside use the nearest cell, at its face.
ivec3 cellOf(vec3 position) {
  return ivec3(clamp(gridFromScene(position), vec3(0.0), vec3(cellsAlong() - 1)));
}

int probeAt(ivec3 point) {
#ifdef MIXED_LEVELS
  ivec3 bases = gridPoints >> MIXED_LEVELS;
  ivec3 low = point >> MIXED_LEVELS;
  int at = low.x + bases.x * (low.y + bases.y * low.z);
  int subdivided = bases.x * bases.y * bases.z;
  for (int level = MIXED_LEVELS - 1; level >= 0; level--) {
    int entry = int(texelFetch(gridIndex, placeOf(at), 0).r);
    if (entry < PROBES) return entry;
    ivec3 child = (point >> level) & 1;
    at = subdivided + (entry - PROBES) * 8 + child.x + 2 * child.y + 4 * child.z;
  }
  return int(texelFetch(gridIndex, placeOf(at), 0).r);
#else
  return point.x + gridPoints.x * (point.y + gridPoints.y * point.z);
#endif
}

int cornerOf(ivec3 base, int corner) {
  return probeAt(base + layered() * ivec3(corner & 1, (corner >> 1) & 1, corner >> 2));
}

vec4 probeTexel(int probe) {
  return texelFetch(probes, placeOf(probe), 0);
}

// ---- Maps ----

// As vec3 |x| + |y| + |z| = 1 unfolds to [-1,1] squared, pole +Z; the sign of 0 is +.
vec2 octahedral(vec3 direction) {
  vec2 p = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
  if (direction.z >= 0.0) return p;
  return (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
}

// The four texels of a bilinear look-up in a map, and their weights.
void taps(vec2 oct, int resolution, int border, out ivec4 texels, out vec4 weights) {
  int side = resolution + 2 * border;
  vec2 p = clamp((oct * 0.5 + 0.5) * float(resolution) - 0.5 + float(border), 0.0, float(side - 1));
  ivec2 low = min(ivec2(p), ivec2(max(side - 2, 0)));
  ivec2 high = min(low + 1, ivec2(side - 1));
  vec2 f = p - vec2(low);
  texels = ivec4(low.y * side + low.x, low.y * side + high.x, high.y * side + low.x, high.y * side + high.x);
  weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
}

// ---- Light ----

#ifdef HARMONICS
// Real functions in the order 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y².
vec3 harmonics(int first, vec3 d) {
  const float y0 = 0.2820948, y1 = 0.4886025, y2 = 1.0925484, y20 = 0.31539157, y22 = 0.5462742;
  return texelFetch(light, placeOf(first), 0).rgb * y0
    + texelFetch(light, placeOf(first + 1), 0).rgb * (y1 * d.y)
    + texelFetch(light, placeOf(first + 2), 0).rgb * (y1 * d.z)
    + texelFetch(light, placeOf(first + 3), 0).rgb * (y1 * d.x)
    + texelFetch(light, placeOf(first + 4), 0).rgb * (y2 * d.x * d.y)
    + texelFetch(light, placeOf(first + 5), 0).rgb * (y2 * d.y * d.z)
    + texelFetch(light, placeOf(first + 6), 0).rgb * (y20 * (3.0 * d.z * d.z - 1.0))
    + texelFetch(light, placeOf(first + 7), 0).rgb * (y2 * d.x * d.z)
    + texelFetch(light, placeOf(first + 8), 0).rgb * (y22 * (d.x * d.x - d.y * d.y));
}
#endif

// A probe's irradiance around a direction where the probe stands; `offset`: how far from it, in its spacings, the light is asked
// for. May be negative with harmonics.
vec3 lightOf(int probe, vec3 direction, vec3 offset) {
#ifdef HARMONICS
  int first = probe * HARMONICS;
  vec3 sum = harmonics(first, direction);
#if HARMONICS == 12
  // The gradient of the mean.
  vec3 change = texelFetch(light, placeOf(first + 9), 0).rgb * offset.x
    + texelFetch(light, placeOf(first + 10), 0).rgb * offset.y
    + texelFetch(light, placeOf(first + 11), 0).rgb * offset.z;
  sum += change * 0.2820948;
#endif
  return sum;
#else
  ivec4 at;
  vec4 weights;
  taps(octahedral(direction), LIGHT_RESOLUTION, LIGHT_BORDER, at, weights);
  const int side = LIGHT_RESOLUTION + 2 * LIGHT_BORDER;
  int first = probe * side * side;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < 4; i++) sum += texelFetch(light, placeOf(first + at[i]), 0).rgb * weights[i];
#ifdef LIGHT_GAMMA5
  vec3 squared = sum * sum;
  return squared * squared * sum * 6.2831853;
#else
  return sum;
#endif
#endif
}

// A probe's own irradiance around a direction, W/m².
vec3 probeIrradiance(int probe, vec3 direction) {
  return max(lightOf(probe, direction, vec3(0.0)), 0.0);
}

// ---- Visibility ----

#ifdef DISTANCE_RESOLUTION
#ifdef TILES
// The way from a probe along a unit direction to the faces of its box.
float wayToBox(float width, vec3 direction) {
  vec3 ways = gridSpacing * width / abs(direction);
  return min(ways.x, min(ways.y, ways.z));
}
#endif

// Mean and deviation of four texels, and their weights.
void distanceTaps(int probe, vec3 direction, out vec2 found[4], out vec4 weights) {
  ivec4 at;
  taps(octahedral(direction), DISTANCE_RESOLUTION, DISTANCE_BORDER, at, weights);
  const int side = DISTANCE_RESOLUTION + 2 * DISTANCE_BORDER;
  int first = probe * side * side;
  for (int i = 0; i < 4; i++) found[i] = texelFetch(distances, placeOf(first + at[i]), 0).rg;
}

// Mean distance that a probe knows along a unit direction.
float meanDistance(int probe, float width, vec3 direction) {
  vec2 found[4];
  vec4 weights;
  distanceTaps(probe, direction, found, weights);
  float mean = 0.0;
  for (int i = 0; i < 4; i++) mean += found[i].x * weights[i];
#ifdef TILES
  mean *= wayToBox(width, direction);
#endif
  return mean;
}

#ifdef TEST_POWER
// How far a probe sees the point at the end of `fromProbe`, 0 to 1.
float chebyshev(int probe, float width, vec3 fromProbe) {
  float far = length(fromProbe);
  if (far == 0.0) return 1.0;
  float shorter = DISTANCE_BIAS * BIAS_SPACING;
  vec2 found[4];
  vec4 weights;
  distanceTaps(probe, fromProbe / far, found, weights);
  float mean = 0.0, variance = 0.0;
  for (int i = 0; i < 4; i++) mean += found[i].x * weights[i];
#ifdef TILES
  float deviation = 0.0;
  for (int i = 0; i < 4; i++) deviation += found[i].y * weights[i];
  float way = wayToBox(width, fromProbe / far);
  float excess = width * (far - shorter - mean * way);
  variance = deviation * way * deviation * way;
#else
  float excess = far - shorter - mean;
  for (int i = 0; i < 4; i++) {
    variance += (found[i].y * found[i].y + (found[i].x - mean) * (found[i].x - mean)) * weights[i];
  }
#endif
  float seen = excess <= 0.0 ? 1.0 : variance / (variance + excess * excess);
  return max(TEST_POWER == 1.0 ? seen : pow(seen, TEST_POWER), TEST_FLOOR);
}
#endif
#endif

#ifdef VOXELS
uint wordAt(int i) {
  return texelFetch(words, placeOf(i), 0).r;
}

int numberAt(int i) {
  return int(wordAt(i) | (wordAt(i + 1) << 16));
}

// Main direction of a normal: 2·axis + (1 where negative).
int facingOf(vec3 normal) {
  vec3 a = abs(normal);
  int axis = a.y > a.x ? (a.z > a.y ? 2 : 1) : (a.z > a.x ? 2 : 0);
  return 2 * axis + (normal[axis] < 0.0 ? 1 : 0);
}

// What a point of a cell sees of its corners, by the cell's tree; a probe farther away that stands in for them, or −1.
int seenBy(ivec3 base, vec3 position, vec3 geometric, out int far) {
  ivec3 n = cellsAlong();
  int i = int(texelFetch(roots, placeOf(base.x + n.x * (base.y + n.y * base.z)), 0).r);
  vec3 fraction = fractionIn(base, position);
  ivec3 voxel = min(ivec3(fraction * float(VOXELS)), ivec3(VOXELS - 1));
  ivec4 at = ivec4(voxel, facingOf(geometric));
  far = -1;
  // No path is longer than a cell has planes, and four walls.
  for (int steps = 0; steps < 3 * VOXELS + 10; steps++) {
    uint word = wordAt(i);
    if ((word & 0x8000u) != 0u) {
      if ((word & 0x4000u) != 0u) far = numberAt(i + 1);
      return int(word & 0xffu);
    }
    int axis = int(word >> 13);
    int threshold = int((word >> 8) & 31u);
    int way = int(word & 0xffu);
    int head = 1;
    bool below = at[axis] < threshold;
    if (axis == 3 && threshold >= 8) {
      // A thin wall, and where it is. On it the facing tells.
      head = 2;
      float beyond = fraction[threshold - 8] - float(wordAt(i + 1)) / 65536.0;
      bool onWall = abs(beyond) <= 1.0 / 1024.0 && at.w / 2 == threshold - 8;
      below = onWall ? at.w % 2 == 1 : beyond < 0.0;
    }
    if (way == 0) i += below ? head + 2 : numberAt(i + head);
    else i += below ? head : way;
  }
  return 0;
}
#endif

// ---- Weights ----

vec3 weightNormal(Asker asker) {
#ifdef WEIGHT_GEOMETRIC
  return asker.geometric;
#else
  return asker.normal;
#endif
}

// The shifted point.
vec3 biased(Asker asker) {
#ifdef BIAS_SPACING
  return asker.position + (weightNormal(asker) * NORMAL_BIAS + asker.view * VIEW_BIAS) * BIAS_SPACING;
#else
  return asker.position;
#endif
}

// The cell whose corners a point asks.
ivec3 askedCell(Asker asker) {
#ifdef UNBIASED_CELL
  return cellOf(asker.position);
#else
  return cellOf(biased(asker));
#endif
}

float directionWeight(float c) {
#if DIRECTION == 1
  return max(c, DIRECTION_NUMBER);
#elif DIRECTION == 2
  return (0.5 * (c + 1.0)) * (0.5 * (c + 1.0)) + DIRECTION_NUMBER;
#elif DIRECTION == 3
  float across = 1.0 - max(1.0 - c * c, 0.0) * DIRECTION_NUMBER * DIRECTION_NUMBER;
  return (DIRECTION_NUMBER * c + sqrt(across)) / (DIRECTION_NUMBER + 1.0);
#else
  return 1.0;
#endif
}

// Weights of the eight probes of a cell, which is the asker's own or one beside it; inactive probes weigh nothing.
Corners weigh(Asker asker, ivec3 base, int visibility, int mask) {
  vec3 shifted = biased(asker);
#ifdef UNBIASED_CELL
  vec3 fraction = fractionIn(base, asker.position);
#else
  vec3 fraction = fractionIn(base, shifted);
#endif
  Corners corners;
  int seen = visibility == VISIBILITY_EXACT ? mask : 255;
  int far = -1;
#ifdef VOXELS
  if (visibility == VISIBILITY_STORED) seen = seenBy(base, shifted, asker.geometric, far);
#endif
  float largest = 0.0;
  for (int i = 0; i < 8; i++) {
    corners.probe[i] = cornerOf(base, i);
    corners.weight[i] = 0.0;
    vec3 along = mix(1.0 - fraction, fraction, vec3(float(i & 1), float((i >> 1) & 1), float(i >> 2)));
    along = max(along, TRILINEAR_FLOOR);
    float trilinear = along.x * along.y * along.z;
    vec4 probe = probeTexel(corners.probe[i]);
    if (trilinear <= 0.0 || ((seen >> i) & 1) == 0 || probe.w < 0.0) continue;
    vec3 way = probe.xyz - asker.position;
    float far2 = dot(way, way);
    float weight = directionWeight(far2 > 0.0 ? dot(way / sqrt(far2), weightNormal(asker)) : 0.0);
#if defined(DISTANCE_RESOLUTION) && defined(TEST_POWER)
    if (visibility == VISIBILITY_STORED) weight *= chebyshev(corners.probe[i], probe.w, shifted - probe.xyz);
#endif
    weight = max(weight, WEIGHT_FLOOR);
#ifdef CRUSH_BELOW
    if (weight < CRUSH_BELOW) weight *= weight * weight / (CRUSH_BELOW * CRUSH_BELOW);
#endif
    corners.weight[i] = weight * trilinear;
    largest = max(largest, corners.weight[i]);
  }
  if (far >= 0) {
    for (int i = 0; i < 8; i++) corners.weight[i] = 0.0;
    corners.probe[0] = far;
    corners.weight[0] = 1.0;
    return corners;
  }
#ifdef BLANK_BELOW
  if (largest < BLANK_BELOW) for (int i = 0; i < 8; i++) corners.weight[i] = 0.0;
#endif
  return corners;
}

// ---- The look-up ----

// What a probe gives to a point that asks, W/m².
vec3 given(Asker asker, int probe) {
  vec4 texel = probeTexel(probe);
  vec3 offset = clamp((asker.position - texel.xyz) / (gridSpacing * abs(texel.w)), -2.0, 2.0);
#ifdef TOWARDS
  vec3 target = biased(asker) - texel.xyz;
#ifdef DISTANCE_RESOLUTION
  target += meanDistance(probe, abs(texel.w), asker.normal) * asker.normal;
#endif
  float far = length(target);
  return lightOf(probe, far > 0.0 ? target / far : asker.normal, offset);
#else
  return lightOf(probe, asker.normal, offset);
#endif
}

// Irradiance around the asker's normal from these weights, W/m²; zero where no probe counts.
vec3 blend(Asker asker, Corners corners) {
  float total = 0.0;
  for (int i = 0; i < 8; i++) total += corners.weight[i];
  if (total <= 0.0) return vec3(0.0);
  vec3 sum = vec3(0.0), means = vec3(0.0);
  for (int i = 0; i < 8; i++) {
    if (corners.weight[i] <= 0.0) continue;
    float share = corners.weight[i] / total;
    vec3 part = given(asker, corners.probe[i]);
#ifdef BLEND_SQUARE_ROOT
    part = sqrt(max(part, 0.0));
#endif
    sum += part * share;
#if defined(HARMONICS) && defined(SUM_FLOOR)
    means += texelFetch(light, placeOf(corners.probe[i] * HARMONICS), 0).rgb * (0.2820948 * share);
#endif
  }
#ifdef BLEND_SQUARE_ROOT
  sum *= sum;
#endif
#if defined(HARMONICS) && defined(SUM_FLOOR)
  // Sums of harmonics dip below 0 beside bright lights.
  return max(sum, max(means * SUM_FLOOR, 0.0));
#else
  return max(sum, 0.0);
#endif
}

// The whole look-up. `mask` counts only with VISIBILITY_EXACT.
vec3 irradiance(Asker asker, int visibility, int mask) {
  return blend(asker, weigh(asker, askedCell(asker), visibility, mask));
}
