//! A decoder of probe files written from the description of the format alone; nothing of the crate is used.
//!
//! Layout: header length (u64, little-endian), header (JSON), tensors. Axes of maps: row = v, column = u, octahedral
//! pole +Z, `oct = 2·uv − 1`.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use serde_json::Value;

pub type Vector = [f64; 3];

#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    pub dtype: String,
    pub shape: Vec<usize>,
    pub bytes: Vec<u8>,
}

#[derive(Debug, Clone)]
pub struct ProbeFile {
    pub metadata: BTreeMap<String, String>,
    pub tensors: BTreeMap<String, Tensor>,
}

impl ProbeFile {
    pub fn parse(bytes: &[u8]) -> ProbeFile {
        let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let header: Value = serde_json::from_slice(&bytes[8..8 + length]).expect("a JSON header");
        let data = &bytes[8 + length..];
        let mut file = ProbeFile { metadata: BTreeMap::new(), tensors: BTreeMap::new() };
        let mut end_of_data = 0;
        for (name, entry) in header.as_object().expect("an object") {
            if name == "__metadata__" {
                file.metadata = serde_json::from_value(entry.clone()).expect("strings");
                continue;
            }
            let shape: Vec<usize> = serde_json::from_value(entry["shape"].clone()).unwrap();
            let [from, to]: [usize; 2] = serde_json::from_value(entry["data_offsets"].clone()).unwrap();
            let dtype = entry["dtype"].as_str().unwrap().to_owned();
            let width = match dtype.as_str() {
                "U8" => 1,
                "U16" | "F16" => 2,
                "U32" | "I32" | "F32" => 4,
                other => panic!("tensor {name} is {other}"),
            };
            assert_eq!(to - from, width * shape.iter().product::<usize>(), "size of tensor {name}");
            end_of_data = end_of_data.max(to);
            file.tensors.insert(name.clone(), Tensor { dtype, shape, bytes: data[from..to].to_vec() });
        }
        assert_eq!(end_of_data, data.len(), "bytes behind the tensors");
        file
    }

    fn tensor(&self, name: &str) -> &Tensor {
        self.tensors.get(name).unwrap_or_else(|| panic!("no tensor {name}"))
    }

    pub fn grid(&self) -> Value {
        serde_json::from_str(&self.metadata["grid"]).expect("JSON under 'grid'")
    }

    pub fn states(&self) -> &[u8] {
        &self.tensor("state").bytes
    }

    pub fn active(&self) -> Vec<usize> {
        let states = self.states();
        (0..states.len()).filter(|&p| states[p] == 0).collect()
    }

    /// Position of a probe in the world, metres.
    pub fn position(&self, probe: usize) -> Vector {
        let origin: Vector = serde_json::from_value(self.grid()["origin"].clone()).unwrap();
        let bytes = &self.tensor("position").bytes[probe * 12..];
        std::array::from_fn(|i| origin[i] + f64::from(f32_at(&bytes[4 * i..])))
    }

    pub fn border(&self) -> usize {
        self.grid()["border"].as_u64().unwrap() as usize
    }

    /// Interior texels per side of the irradiance maps.
    pub fn resolution(&self) -> usize {
        self.tensor("irradiance").shape[1] - 2 * self.border()
    }

    /// A texel of the irradiance tensor as it is stored, its scale applied; row and column count the border.
    pub fn stored(&self, probe: usize, row: usize, column: usize) -> Vector {
        self.color("irradiance", probe, row, column)
    }

    /// The same of any tensor of colours.
    pub fn color(&self, name: &str, probe: usize, row: usize, column: usize) -> Vector {
        let tensor = self.tensor(name);
        let (rows, columns) = (tensor.shape[1], tensor.shape[2]);
        let texel = (probe * rows + row) * columns + column;
        let scale: f64 = self.metadata[&format!("scale.{name}")].parse().unwrap();
        let raw = match tensor.dtype.as_str() {
            "F32" => std::array::from_fn(|i| f64::from(f32_at(&tensor.bytes[texel * 12 + 4 * i..]))),
            "F16" => std::array::from_fn(|i| {
                let at = texel * 6 + 2 * i;
                let bits = u16::from_le_bytes([tensor.bytes[at], tensor.bytes[at + 1]]);
                assert_eq!(bits >> 15, 0, "negative {name}");
                small_float(u32::from(bits & 0x7FFF), 10)
            }),
            "U32" => {
                let bits = u32::from_le_bytes(tensor.bytes[texel * 4..texel * 4 + 4].try_into().unwrap());
                [small_float(bits & 0x7FF, 6), small_float(bits >> 11 & 0x7FF, 6), small_float(bits >> 22, 5)]
            }
            other => panic!("{name} is {other}"),
        };
        raw.map(|v| v * scale)
    }

    /// A number of a tensor of f16.
    pub fn half(&self, name: &str, index: usize) -> f64 {
        let tensor = self.tensor(name);
        assert_eq!(tensor.dtype, "F16");
        let bits = u16::from_le_bytes([tensor.bytes[2 * index], tensor.bytes[2 * index + 1]]);
        let size = small_float(u32::from(bits & 0x7FFF), 10);
        if bits >> 15 == 1 { -size } else { size }
    }

    /// Irradiance of a stored value, W·m⁻².
    fn physical(&self, stored: Vector) -> Vector {
        match self.metadata["encoding.irradiance"].as_str() {
            "linear" => stored,
            "gamma5_over_2pi" => stored.map(|v| v.powi(5) * 2.0 * PI),
            other => panic!("encoding {other}"),
        }
    }

    /// Irradiance of a probe around a direction: bilinear among the stored values, then decoded.
    pub fn irradiance(&self, probe: usize, direction: Vector) -> Vector {
        let (resolution, border) = (self.resolution() as f64, self.border() as f64);
        let side = self.tensor("irradiance").shape[1];
        let oct = oct_of(direction);
        let place = oct.map(|c| {
            let uv = (c + 1.0) / 2.0;
            // With a border the UV is scale 1 − 2t, offset t; texel centres lie half a texel in.
            (uv * resolution + border - 0.5).clamp(0.0, side as f64 - 1.0)
        });
        let low = place.map(|p| (p.floor() as usize).min(side.saturating_sub(2)));
        let share = [place[0] - low[0] as f64, place[1] - low[1] as f64];
        let mut sum = [0.0; 3];
        for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let weight =
                (if dx == 1 { share[0] } else { 1.0 - share[0] }) * (if dy == 1 { share[1] } else { 1.0 - share[1] });
            let texel = self.stored(probe, (low[1] + dy).min(side - 1), (low[0] + dx).min(side - 1));
            sum = std::array::from_fn(|i| sum[i] + weight * texel[i]);
        }
        self.physical(sum)
    }

    /// Directions, relative solid angles and irradiances, W·m⁻², of a probe's interior texels.
    pub fn texels(&self, probe: usize) -> Vec<(Vector, f64, Vector)> {
        let (n, border) = (self.resolution(), self.border());
        let texel = |i: usize| {
            let (row, column) = (i / n, i % n);
            let centre = |k: usize| (k as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            let (direction, density) = direction_of([centre(column), centre(row)]);
            (direction, density, self.physical(self.stored(probe, row + border, column + border)))
        };
        (0..n * n).map(texel).collect()
    }

    /// Mean irradiance of a probe over all directions, W·m⁻².
    pub fn mean_irradiance(&self, probe: usize) -> Vector {
        let texels = self.texels(probe);
        let total: f64 = texels.iter().map(|t| t.1).sum();
        std::array::from_fn(|c| texels.iter().map(|t| t.1 * t.2[c]).sum::<f64>() / total)
    }

    /// Mean and standard deviation of distance in every interior texel, with its direction, metres.
    pub fn distances(&self, probe: usize) -> Vec<(Vector, f64, f64)> {
        let (tensor, border) = (self.tensor("distance"), self.border());
        let side = tensor.shape[1];
        let n = side - 2 * border;
        let scale = f64::from(f32_at(&self.tensor("distance_scale").bytes[probe * 4..]));
        let unit = |at: usize| f64::from(u16::from_le_bytes([tensor.bytes[at], tensor.bytes[at + 1]])) / 65_535.0;
        let texel = |i: usize| {
            let (row, column) = (i / n, i % n);
            let at = (((probe * side) + row + border) * side + column + border) * 4;
            let centre = |k: usize| (k as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            (direction_of([centre(column), centre(row)]).0, unit(at) * scale, unit(at + 2) * scale)
        };
        (0..n * n).map(texel).collect()
    }
}

fn f32_at(bytes: &[u8]) -> f32 {
    f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// An unsigned float with five bits of exponent, bias 15, above so many bits of mantissa.
fn small_float(code: u32, mantissa_bits: i32) -> f64 {
    let mantissa = f64::from(code & ((1 << mantissa_bits) - 1)) / f64::from(1 << mantissa_bits);
    match (code >> mantissa_bits) as i32 {
        0 => mantissa * 2f64.powi(-14),
        31 => panic!("an infinity or NaN is stored"),
        exponent => (1.0 + mantissa) * 2f64.powi(exponent - 15),
    }
}

fn sign(x: f64) -> f64 {
    if x >= 0.0 { 1.0 } else { -1.0 }
}

/// (u, v) of the octahedral square for a direction of any length (Cigolle et al. 2014).
pub fn oct_of(d: Vector) -> [f64; 2] {
    let length = d[0].abs() + d[1].abs() + d[2].abs();
    let (x, y) = (d[0] / length, d[1] / length);
    if d[2] >= 0.0 { [x, y] } else { [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)] }
}

/// Inverse of [`oct_of`], unit, and the solid angle per area of the square up to a factor.
pub fn direction_of([u, v]: [f64; 2]) -> (Vector, f64) {
    let z = 1.0 - u.abs() - v.abs();
    let (x, y) = if z >= 0.0 { (u, v) } else { ((1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)) };
    let length = (x * x + y * y + z * z).sqrt();
    ([x / length, y / length, z / length], length.powi(-3))
}
