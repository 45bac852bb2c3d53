// Surfaces: the light of probes by the look-up above, or what leaks of it. Vertex, then fragment shader.
uniform mat4 viewProjection;
#ifdef VERTEX
in vec3 position;
in vec4 normal; // w: 0 where the vertex has none
out vec3 place;
out vec3 shading;
flat out int triangle;
// Depths of both passes are equal.
invariant gl_Position;

void main() {
  place = position;
  shading = normal.xyz * normal.w;
  triangle = gl_VertexID / 3;
  gl_Position = viewProjection * vec4(position, 1.0);
}
#else
in vec3 place;
in vec3 shading;
flat in int triangle;
uniform usampler2D charts; // RGBA32UI, two texels a triangle
uniform usampler2D texels; // RGBA8UI: square roots of albedo, mask of exact visibility
uniform sampler2D own; // radiance that probes have no part in
uniform sampler2D lit0;
uniform sampler2D lit1;
uniform sampler2D lit2;
uniform sampler2D colormap;
uniform vec3 eye;
uniform float texelSide;
uniform float nudge;
uniform float gain;
uniform float cut;
uniform int visibility;
uniform int show; // 0 light, 1 irradiance of probes alone, 2 leak
uniform vec2 ranges;
out vec4 color;

vec3 developed(vec3 radiance) {
  vec3 x = clamp(radiance * gain, 0.0, 16.0);
  vec3 toned = min(vec3(1.0), x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
  return mix(1.055 * pow(toned, vec3(1.0 / 2.4)) - 0.055, 12.92 * toned, vec3(lessThanEqual(toned, vec3(0.0031308))));
}

float luminance(vec3 light) {
  return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

void main() {
  uvec4 chart = texelFetch(charts, placeOf(2 * triangle), 0);
  vec4 plane = uintBitsToFloat(texelFetch(charts, placeOf(2 * triangle + 1), 0));
  bool isDouble = ((chart.x >> 30) & 1u) != 0u;
  vec3 view = normalize(eye - place);
  bool isFront = dot(plane.xyz, view) >= 0.0;
  if ((!isFront && !isDouble) || place.y > cut) discard;
#ifdef DEPTH_ONLY
  color = vec4(0.0);
#else
  vec3 geometric = isFront ? plane.xyz : -plane.xyz;
  vec3 bent = dot(shading, shading) > 0.01 ? normalize(shading) : geometric;
  if (dot(bent, geometric) < 0.0) bent = -bent;
  // The texel, and the cell that its mask is of.
  int axis = int((chart.x >> 28) & 3u), u = (axis + 1) % 3, v = (axis + 2) % 3;
  ivec2 size = ivec2(int(chart.y & 0xffffu), int(chart.y >> 16));
  vec2 low = uintBitsToFloat(chart.zw);
  ivec2 at = clamp(ivec2((vec2(place[u], place[v]) - low) / texelSide), ivec2(0), size - 1);
  int texel = int(chart.x & 0x0fffffffu) + (isFront ? 0 : size.x * size.y) + at.y * size.x + at.x;
  vec3 centre;
  centre[u] = low.x + (float(at.x) + 0.5) * texelSide;
  centre[v] = low.y + (float(at.y) + 0.5) * texelSide;
  centre[axis] = (plane.w - plane[u] * centre[u] - plane[v] * centre[v]) / plane[axis];
  uvec4 known = texelFetch(texels, placeOf(texel), 0);
  int mask = int(known.w);
#ifdef BAKED
  vec3 exact = texelFetch(lit2, placeOf(texel), 0).rgb;
  vec3 light = visibility == 0 ? texelFetch(lit0, placeOf(texel), 0).rgb
    : visibility == 1 ? texelFetch(lit1, placeOf(texel), 0).rgb : exact;
#else
  // Where surfaces meet, rounding shows points a hair behind the other one, which no probe lights.
  Asker asker = Asker(place + view * nudge, bent, geometric, view);
  vec3 exact = vec3(0.0), light = vec3(0.0);
  if (visibility == VISIBILITY_EXACT || show == 2) {
    ivec3 cell = askedCell(Asker(centre + geometric * nudge, geometric, geometric, geometric));
    exact = blend(asker, weigh(asker, cell, VISIBILITY_EXACT, mask));
  }
  light = visibility == VISIBILITY_EXACT ? exact : irradiance(asker, visibility, 255);
#endif
  if (show == 2) {
    float end = visibility == 0 ? ranges.x : ranges.y;
    float share = clamp(0.5 + 0.5 * (luminance(light) - luminance(exact)) / end, 0.0, 1.0);
    color = mask == 0 ? vec4(vec3(0.5), 1.0) : texelFetch(colormap, ivec2(int(share * 255.0 + 0.5), 0), 0);
    // A little shape, so that surfaces of one colour are told apart.
    color.rgb *= 0.82 + 0.18 * abs(dot(bent, view));
    color.a = 1.0;
    return;
  }
  vec3 albedo = vec3(known.rgb) / 255.0;
  albedo *= albedo;
  vec3 radiance = light / 3.14159265;
  if (show == 0) radiance = texelFetch(own, placeOf(texel), 0).rgb + albedo * radiance;
  color = vec4(developed(radiance), 1.0);
#endif
}
#endif
