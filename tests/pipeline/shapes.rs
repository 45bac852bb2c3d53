//! Scenes built of quads, and what the tests compute about them.

use std::f64::consts::PI;

use serde_json::{Value, json};

use crate::common::{Folder, Gltf};
use crate::probe_file::{ProbeFile, Vector};
use std::path::PathBuf;

/// A material of this diffuse colour that emits this radiance.
pub fn diffuse(albedo: [f64; 3], emission: [f64; 3]) -> Value {
    let strength = emission.iter().copied().fold(1.0, f64::max);
    json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [albedo[0], albedo[1], albedo[2], 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0,
        },
        "emissiveFactor": emission.map(|e| e / strength),
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
    })
}

/// A parallelogram of n × n × 2 triangles; its front is where u × v points.
pub fn quad(corner: [f32; 3], u: [f32; 3], v: [f32; 3], n: u32) -> Vec<[f32; 3]> {
    let at = |i: u32, j: u32| {
        let (s, t) = (i as f32 / n as f32, j as f32 / n as f32);
        std::array::from_fn(|k| corner[k] + s * u[k] + t * v[k])
    };
    let cell = |c: u32| {
        let (i, j) = (c % n, c / n);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [a, b, c, a, c, d]
    };
    (0..n * n).flat_map(cell).collect()
}

/// The inside of the cube [−1, 1]³, every face of n × n × 2 triangles.
pub fn room(n: u32) -> Vec<[f32; 3]> {
    let axes = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    let face = |k: usize| {
        let (u, v) = (axes[(k + 1) % 3], axes[(k + 2) % 3]);
        let mut far = [-1.0; 3];
        far[k] = 1.0;
        // u × v is +k: inwards on the low face, and with both swapped on the high one.
        [quad([-1.0; 3], u, v, n), quad(far, v, u, n)].concat()
    };
    (0..3).flat_map(face).collect()
}

/// Adds a mesh of these triangles with a material of its own, on a node at the root.
pub fn add(gltf: &mut Gltf, triangles: &[[f32; 3]], material: Value) -> usize {
    let material = gltf.push("materials", material);
    let positions = gltf.vec3(triangles);
    let primitive = json!({ "attributes": { "POSITION": positions }, "material": material });
    let mesh = gltf.push("meshes", json!({ "primitives": [primitive] }));
    gltf.root(json!({ "mesh": mesh }))
}

/// Adds a punctual light on a node; the node looks along −Z before it is turned.
pub fn add_light(gltf: &mut Gltf, light: Value, mut node: Value) {
    if gltf.json.get("extensions").is_none() {
        gltf.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [] } });
    }
    let lights = gltf.json["extensions"]["KHR_lights_punctual"]["lights"].as_array_mut().expect("a list");
    lights.push(light);
    node["extensions"] = json!({ "KHR_lights_punctual": { "light": lights.len() - 1 } });
    gltf.root(node);
}

/// Declares the extensions that these scenes use and saves the scene.
pub fn save(mut gltf: Gltf, folder: &Folder, name: &str) -> PathBuf {
    gltf.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "KHR_lights_punctual"]);
    folder.write(&format!("{name}.glb"), gltf.glb())
}

/// The JSON of a binary glTF changed by `edit`, its buffer kept.
pub fn edited(glb: &[u8], edit: impl FnOnce(&mut Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut json: Value = serde_json::from_slice(&glb[20..20 + length]).expect("a JSON chunk");
    edit(&mut json);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &glb[20 + length..];
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend(rest);
    out
}

/// The scene under one more root node with this translation.
pub fn moved(glb: &[u8], translation: [f64; 3]) -> Vec<u8> {
    edited(glb, |json| {
        let scene = json["scene"].as_u64().unwrap_or(0) as usize;
        let roots = json["scenes"][scene]["nodes"].take();
        let nodes = json["nodes"].as_array_mut().expect("a list");
        nodes.push(json!({ "translation": translation, "children": roots }));
        json["scenes"][scene]["nodes"] = json!([nodes.len() - 1]);
    })
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Irradiance around every one of `normals` under the radiance `radiance(ω)`, by the midpoint rule over the sphere in
/// bands of equal height.
pub fn irradiance_under(normals: &[Vector], radiance: impl Fn(Vector) -> f64) -> Vec<f64> {
    const BANDS: usize = 240;
    const SECTORS: usize = 480;
    let mut sums = vec![0.0; normals.len()];
    for band in 0..BANDS {
        let y = (band as f64 + 0.5) / BANDS as f64 * 2.0 - 1.0;
        let r = (1.0 - y * y).sqrt();
        for sector in 0..SECTORS {
            let phi = (sector as f64 + 0.5) / SECTORS as f64 * 2.0 * PI;
            let direction = [r * phi.cos(), y, r * phi.sin()];
            let light = radiance(direction);
            if light > 0.0 {
                sums.iter_mut().zip(normals).for_each(|(sum, n)| *sum += light * dot(*n, direction).max(0.0));
            }
        }
    }
    sums.iter().map(|sum| sum * 4.0 * PI / (BANDS * SECTORS) as f64).collect()
}

/// Irradiance at `point` around `normal` from an emitting parallelogram of radiance 1, by the midpoint rule; only its
/// front emits.
pub fn irradiance_from_quad(point: Vector, normal: Vector, [corner, u, v]: [Vector; 3], steps: usize) -> f64 {
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let mut sum = 0.0;
    for i in 0..steps * steps {
        let (s, t) = ((i % steps) as f64 + 0.5, (i / steps) as f64 + 0.5);
        let to: Vector =
            std::array::from_fn(|k| corner[k] + u[k] * s / steps as f64 + v[k] * t / steps as f64 - point[k]);
        let squared = dot(to, to);
        // cos·cos′·dA/r², with both cosines still multiplied by r and `cross` by the whole area.
        sum += dot(normal, to).max(0.0) * (-dot(cross, to)).max(0.0) / (squared * squared);
    }
    sum / (steps * steps) as f64
}

/// Values of the same quantities under several seeds.
pub struct Samples {
    /// `[seed][quantity]`.
    pub values: Vec<Vec<f64>>,
}

impl Samples {
    /// One channel of all texels of these probes in every file.
    pub fn of(files: &[ProbeFile], probes: &[usize], channel: usize) -> Samples {
        let texels = |file: &ProbeFile| {
            probes.iter().flat_map(|&p| file.texels(p)).map(|(_, _, irradiance)| irradiance[channel]).collect()
        };
        Samples { values: files.iter().map(texels).collect() }
    }

    /// Checks that every mean over the seeds lies within five standard errors and `floor` of what is expected.
    ///
    /// Five: 6e-7 of a normal distribution lies outside, and a few thousand quantities are asked. A standard deviation
    /// from a few seeds may come out far too small by chance; it is taken for no less than the pooled one of all
    /// quantities together.
    pub fn check(&self, expected: &[f64], floor: f64, what: &str) {
        let seeds = self.values.len() as f64;
        let quantities = self.values[0].len();
        assert_eq!(quantities, expected.len());
        let mean = |q: usize| self.values.iter().map(|v| v[q]).sum::<f64>() / seeds;
        let variance = |q: usize| self.values.iter().map(|v| (v[q] - mean(q)).powi(2)).sum::<f64>() / (seeds - 1.0);
        let pooled = (0..quantities).map(variance).sum::<f64>() / quantities as f64;
        for (q, &expected) in expected.iter().enumerate() {
            let error = (variance(q).max(pooled) / seeds).sqrt();
            let found = mean(q);
            assert!(
                (found - expected).abs() <= 5.0 * error + floor,
                "{what}, quantity {q}: {found} instead of {expected}, standard error {error}, floor {floor}"
            );
        }
    }

    /// Standard error of the mean of one quantity, pooled over all of them.
    pub fn pooled_error(&self) -> f64 {
        let seeds = self.values.len() as f64;
        let quantities = self.values[0].len();
        let mean = |q: usize| self.values.iter().map(|v| v[q]).sum::<f64>() / seeds;
        let scatter = |q: usize| self.values.iter().map(|v| (v[q] - mean(q)).powi(2)).sum::<f64>() / (seeds - 1.0);
        ((0..quantities).map(scatter).sum::<f64>() / quantities as f64 / seeds).sqrt()
    }
}
