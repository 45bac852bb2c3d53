// In place of the look-up where the page has none: probes in six directions.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#define ROW_SHIFT 11
uniform sampler2D probes;
uniform sampler2D light;

ivec2 placeOf(int texel) {
  return ivec2(texel & ((1 << ROW_SHIFT) - 1), texel >> ROW_SHIFT);
}

vec4 probeTexel(int probe) {
  return texelFetch(probes, placeOf(probe), 0);
}

vec3 probeIrradiance(int probe, vec3 direction) {
  vec3 sum = vec3(0.0);
  for (int axis = 0; axis < 3; axis++) {
    int side = direction[axis] < 0.0 ? 1 : 0;
    sum += texelFetch(light, placeOf(6 * probe + 2 * axis + side), 0).rgb * direction[axis] * direction[axis];
  }
  return sum;
}
