// Probes as spheres, and lines and marks of the point that was picked. Vertex, then fragment shader.
uniform mat4 viewProjection;
uniform vec3 eye;
uniform float gain;
uniform float radius; // of a probe of the finest cells, metres
uniform int chosen[8];
uniform int marks[8]; // 1 counts, 2 hidden, 3 not active
uniform vec3 markColors[4];
#ifdef SPHERES
#ifdef VERTEX
uniform vec3 up;
uniform int onlyChosen;
in float state;
flat out int probe;
flat out int mark;
flat out int kind;
flat out vec4 sphere;
out vec3 corner;

void main() {
  probe = gl_InstanceID;
  kind = int(state);
  mark = 0;
  for (int i = 0; i < 8; i++) if (chosen[i] == probe) mark = marks[i];
  vec4 texel = probeTexel(probe);
  float far = distance(eye, texel.xyz);
  // Close ones are not to hide what is behind them.
  sphere = vec4(texel.xyz, min(radius * abs(texel.w) * (mark > 0 ? 1.25 : 1.0), 0.04 * far));
  vec2 at = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2.0 - 1.0;
  // Seen in perspective a sphere covers a little more than its radius.
  float reach = sphere.w * far / sqrt(max(far * far - sphere.w * sphere.w, 1e-6 * far * far));
  vec3 across = normalize(cross(up, sphere.xyz - eye)), along = normalize(cross(sphere.xyz - eye, across));
  corner = sphere.xyz + (across * at.x + along * at.y) * reach;
  gl_Position = viewProjection * vec4(corner, 1.0);
  if (onlyChosen == 1 && mark == 0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}
#else
flat in int probe;
flat in int mark;
flat in int kind;
flat in vec4 sphere;
in vec3 corner;
uniform vec3 stateColors[3];
uniform float pixel; // angle of a pixel
uniform float cut;
out vec4 color;

vec3 developed(vec3 radiance) {
  vec3 x = clamp(radiance * gain, 0.0, 16.0);
  vec3 toned = min(vec3(1.0), x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
  return mix(1.055 * pow(toned, vec3(1.0 / 2.4)) - 0.055, 12.92 * toned, vec3(lessThanEqual(toned, vec3(0.0031308))));
}

void main() {
  vec3 way = normalize(corner - eye), to = sphere.xyz - eye;
  float along = dot(to, way);
  vec3 miss = to - way * along;
  float left = sphere.w * sphere.w - dot(miss, miss);
  if (left < 0.0 || sphere.y > cut) discard;
  vec3 hit = eye + way * (along - sqrt(left));
  vec3 normal = (hit - sphere.xyz) / sphere.w;
  float edge = 1.0 - length(miss) / sphere.w;
  float rim = min(mark > 0 ? 0.4 : 0.25, (mark > 0 ? 2.5 : 1.2) * pixel * length(to) / sphere.w);
  vec3 shown = kind == 0 ? developed(probeIrradiance(probe, normal) / 3.14159265)
    : stateColors[kind] * (0.45 + 0.55 * max(dot(normal, -way), 0.0));
  color = vec4(edge < rim ? (mark > 0 ? markColors[mark] : stateColors[0]) : shown, 1.0);
  vec4 clip = viewProjection * vec4(hit, 1.0);
  gl_FragDepth = 0.5 * clip.z / clip.w + 0.5;
}
#endif
#endif

#ifdef LINES
uniform vec3 point;
uniform vec3 boxLow;
uniform vec3 boxSides;
uniform vec2 viewport;
uniform float near;
uniform int what; // 0 lines to the probes, 1 edges of the cell, 2 the point
uniform float width;
#ifdef VERTEX
flat out int mark;
out float along;
out vec2 at;

void main() {
  vec3 ends[2];
  mark = 0;
  if (what == 0) {
    ends[0] = point;
    ends[1] = probeTexel(chosen[gl_InstanceID]).xyz;
    mark = marks[gl_InstanceID];
  } else {
    int axis = gl_InstanceID >> 2, one = (axis + 1) % 3, other = (axis + 2) % 3;
    ends[0] = vec3(0.0);
    ends[0][one] = float(gl_InstanceID & 1);
    ends[0][other] = float((gl_InstanceID >> 1) & 1);
    ends[1] = ends[0];
    ends[1][axis] = 1.0;
    for (int i = 0; i < 2; i++) ends[i] = what == 1 ? boxLow + boxSides * ends[i] : point;
  }
  vec4 a = viewProjection * vec4(ends[0], 1.0), b = viewProjection * vec4(ends[1], 1.0);
  at = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2.0 - 1.0;
  along = at.x > 0.0 ? distance(ends[0], ends[1]) : 0.0;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (a.w < near && b.w < near) return;
  if (what == 2) {
    gl_Position = a + vec4(at * width / viewport * a.w, 0.0, 0.0);
    return;
  }
  if (a.w < near) a = mix(a, b, (near - a.w) / (b.w - a.w));
  if (b.w < near) b = mix(b, a, (near - b.w) / (a.w - b.w));
  vec2 way = (b.xy / b.w - a.xy / a.w) * viewport;
  float far = length(way);
  way = far > 0.0 ? way / far : vec2(1.0, 0.0);
  gl_Position = at.x > 0.0 ? b : a;
  gl_Position.xy += vec2(-way.y, way.x) * at.y * width / viewport * gl_Position.w;
}
#else
flat in int mark;
in float along;
in vec2 at;
out vec4 color;

void main() {
  if (what == 2) {
    float far = length(at);
    if (far > 1.0) discard;
    color = far > 0.72 ? vec4(0.0, 0.0, 0.0, 1.0) : far > 0.36 ? vec4(1.0) : vec4(0.0, 0.0, 0.0, 1.0);
    return;
  }
  // Hidden ones are dashed.
  if (mark >= 2 && fract(along / (2.0 * radius)) > 0.5) discard;
  color = vec4(what == 1 ? vec3(0.75) : markColors[mark], 1.0);
}
#endif
#endif

#ifdef ASKS
// One point a vertex: what the look-up makes of it, for transform feedback.
#ifdef VERTEX
in vec3 askPosition;
in vec3 askNormal;
in vec3 askGeometric;
in vec3 askView;
in vec3 askCentre; // whose cell the mask is of
in float askMask;
out vec3 lightOff;
out vec3 lightOn;
out vec3 lightExact;
flat out ivec4 probesLow;
flat out ivec4 probesHigh;
out vec4 offLow;
out vec4 offHigh;
out vec4 onLow;
out vec4 onHigh;
out vec4 givenLow;
out vec4 givenHigh;
flat out ivec4 told; // bits of corners that the mask says are seen, and of those that it knows of; lowest corner's cell number
void main() {
  Asker asker = Asker(askPosition, askNormal, askGeometric, askView);
  ivec3 cell = askedCell(asker);
  ivec3 exactCell = askedCell(Asker(askCentre, askGeometric, askGeometric, askGeometric));
  int mask = int(askMask + 0.5);
  Corners off = weigh(asker, cell, VISIBILITY_OFF, 255);
  Corners on = weigh(asker, cell, VISIBILITY_STORED, 255);
  Corners exact = weigh(asker, exactCell, VISIBILITY_EXACT, mask);
  lightOff = blend(asker, off);
  lightOn = blend(asker, on);
  lightExact = blend(asker, exact);
  told = ivec4(0, 0, on.probe[0], 0);
  float given8[8];
  for (int i = 0; i < 8; i++) {
    given8[i] = dot(given(asker, off.probe[i]), vec3(0.2126, 0.7152, 0.0722));
    for (int j = 0; j < 8; j++) {
      if (exact.probe[j] != off.probe[i]) continue;
      told.y |= 1 << i;
      if (((mask >> j) & 1) != 0) told.x |= 1 << i;
    }
  }
  probesLow = ivec4(off.probe[0], off.probe[1], off.probe[2], off.probe[3]);
  probesHigh = ivec4(off.probe[4], off.probe[5], off.probe[6], off.probe[7]);
  offLow = vec4(off.weight[0], off.weight[1], off.weight[2], off.weight[3]);
  offHigh = vec4(off.weight[4], off.weight[5], off.weight[6], off.weight[7]);
  onLow = vec4(on.weight[0], on.weight[1], on.weight[2], on.weight[3]);
  onHigh = vec4(on.weight[4], on.weight[5], on.weight[6], on.weight[7]);
  givenLow = vec4(given8[0], given8[1], given8[2], given8[3]);
  givenHigh = vec4(given8[4], given8[5], given8[6], given8[7]);
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
}
#else
out vec4 color;
void main() {
  color = vec4(0.0);
}
#endif
#endif
