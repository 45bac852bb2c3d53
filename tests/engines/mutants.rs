//! Exports with one rule of their layout broken: what a test of pixels has to notice.

use std::f32::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

use half::f16;
use serde_json::{Value, json};

/// A volume's record and its file.
pub struct Volume {
    record: Value,
    bytes: Vec<u8>,
}

pub struct Mutant {
    pub name: &'static str,
    change: fn(&mut Volume),
}

/// Writes a mutant of each kind of an export with one volume into folders within `into`.
pub fn write(mutants: &[Mutant], export: &Path, into: &Path) -> Vec<PathBuf> {
    let text = fs::read_to_string(export.join("probes.json")).expect("a record");
    let record: Value = serde_json::from_str(&text).expect("JSON");
    let file = record["volumes"][0]["file"].as_str().expect("a file").to_owned();
    let of = |mutant: &Mutant| {
        let bytes = fs::read(export.join(&file)).expect("a volume");
        let mut volume = Volume { record: record["volumes"][0].clone(), bytes };
        (mutant.change)(&mut volume);
        let folder = into.join(mutant.name.replace(|c: char| !c.is_ascii_alphanumeric(), "_"));
        fs::create_dir_all(&folder).expect("a folder");
        let mut changed = record.clone();
        changed["volumes"] = json!([volume.record]);
        fs::write(folder.join("probes.json"), changed.to_string()).expect("a record is written");
        fs::write(folder.join(&file), volume.bytes).expect("a volume is written");
        folder
    };
    mutants.iter().map(of).collect()
}

/// The same export with its volumes in the opposite order.
pub fn write_reversed(export: &Path, into: &Path) -> PathBuf {
    let text = fs::read_to_string(export.join("probes.json")).expect("a record");
    let mut record: Value = serde_json::from_str(&text).expect("JSON");
    let volumes = record["volumes"].as_array_mut().expect("volumes");
    assert!(volumes.len() > 1, "there is an order");
    volumes.reverse();
    let folder = into.join("reversed");
    fs::create_dir_all(&folder).expect("a folder");
    for (priority, volume) in volumes.iter_mut().enumerate() {
        volume["priority"] = json!(priority);
        let file = volume["file"].as_str().expect("a file");
        fs::copy(export.join(file), folder.join(file)).expect("a volume is copied");
    }
    fs::write(folder.join("probes.json"), record.to_string()).expect("a record is written");
    folder
}

type Texel = [usize; 3];

impl Volume {
    fn resolution(&self) -> Texel {
        [0, 1, 2].map(|axis| self.record["resolution"][axis].as_u64().expect("a number") as usize)
    }

    fn corner(&self, key: &str) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.record[key][axis].as_f64().expect("a number"))
    }

    /// Spacing of its probes.
    fn spacing(&self) -> [f64; 3] {
        let (low, high, n) = (self.corner("min"), self.corner("max"), self.resolution());
        [0, 1, 2].map(|axis| (high[axis] - low[axis]) / n[axis] as f64)
    }

    /// Another box, in the terms of all engines.
    fn place(&mut self, low: [f64; 3], high: [f64; 3]) {
        let each = |of: fn(f64, f64) -> f64| [0, 1, 2].map(|axis| of(low[axis], high[axis]));
        (self.record["min"], self.record["max"]) = (json!(low), json!(high));
        if !self.record["engine"]["scale"].is_null() {
            self.record["engine"]["translation"] = json!(each(|low, high| 0.5 * (low + high)));
            self.record["engine"]["scale"] = json!(each(|low, high| high - low));
        }
    }

    /// Each texel becomes that of another place: `source` of its own.
    fn texels_from(&mut self, start: usize, width: usize, size: Texel, source: impl Fn(Texel) -> Texel) {
        let old = self.bytes.clone();
        let at = |[x, y, z]: Texel| start + width * (x + size[0] * (y + size[1] * z));
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let (to, from) = (at([x, y, z]), at(source([x, y, z])));
                    self.bytes[to..to + width].copy_from_slice(&old[from..from + width]);
                }
            }
        }
    }

    /// The probe that stands where another one is expected when z runs fastest.
    fn transposed(n: Texel, [x, y, z]: Texel) -> Texel {
        let i = x + n[0] * (y + n[1] * z);
        [i / (n[2] * n[1]), i / n[2] % n[1], i % n[2]]
    }
}

fn from_probe_to_probe(volume: &mut Volume) {
    let (low, high, spacing) = (volume.corner("min"), volume.corner("max"), volume.spacing());
    let moved = |corner: [f64; 3], by: f64| [0, 1, 2].map(|axis| corner[axis] + by * spacing[axis]);
    volume.place(moved(low, 0.5), moved(high, -0.5));
}

fn shifted(volume: &mut Volume) {
    let (low, high, spacing) = (volume.corner("min"), volume.corner("max"), volume.spacing());
    let moved = |corner: [f64; 3]| [0, 1, 2].map(|axis| corner[axis] + 0.5 * spacing[axis]);
    volume.place(moved(low), moved(high));
}

/// Sub-volumes of an atlas for three.js, and slices beside each.
const TEXELS: usize = 7;
const PADDING: usize = 2;

/// Changes the texture of an atlas by the place of its texels: sub-volume and probe, the two padding slices being `z` = −1 and nz.
fn three_texels(volume: &mut Volume, source: impl Fn(Texel, usize, [isize; 3]) -> (usize, [isize; 3])) {
    let n = volume.resolution();
    let slices = n[2] + PADDING;
    let size = [n[0], n[1], TEXELS * slices];
    volume.texels_from(0, 8, size, |[x, y, slice]| {
        let place = [x as isize, y as isize, (slice % slices) as isize - 1];
        let (t, [x, y, z]) = source(n, slice / slices, place);
        [x as usize, y as usize, (t * slices) + (z + 1) as usize]
    });
}

/// Changes the 28 numbers of each probe, and of its copies in the padding.
fn three_numbers(volume: &mut Volume, change: impl Fn([f32; 28]) -> [f32; 28]) {
    let [nx, ny, nz] = volume.resolution();
    let slices = nz + PADDING;
    let at = |i: usize, n: usize| {
        let (slice, in_layer) = (i / (nx * ny), i % (nx * ny));
        2 * (4 * (((n / 4) * slices + slice) * nx * ny + in_layer) + n % 4)
    };
    for i in 0..nx * ny * slices {
        let read = |n: usize| f16::from_le_bytes([volume.bytes[at(i, n)], volume.bytes[at(i, n) + 1]]).to_f32();
        let changed = change(std::array::from_fn(read));
        for (n, number) in changed.into_iter().enumerate() {
            volume.bytes[at(i, n)..][..2].copy_from_slice(&f16::from_f32(number).to_le_bytes());
        }
    }
}

/// Of which coefficient a number is.
fn coefficient(n: usize) -> usize {
    n / 3
}

/// What the padding slices hold is not among them: the shader clamps to the centres of texels, and never reads it.
pub const OF_THREE: [Mutant; 10] = [
    Mutant { name: "irradiance in place of irradiance / pi", change: |v| three_numbers(v, |c| c.map(|c| PI * c)) },
    Mutant {
        name: "cosine lobe in the coefficients too",
        change: |v| {
            let lobe = |n: usize| [1.0, 2.0 / 3.0, 0.25][coefficient(n).min(8).isqrt()];
            three_numbers(v, |c| std::array::from_fn(|n| lobe(n) * c[n]));
        },
    },
    Mutant {
        name: "linear band as x, y, z",
        change: |v| {
            let from = |j: usize| [0, 3, 1, 2].get(j).copied().unwrap_or(j);
            three_numbers(v, |c| std::array::from_fn(|n| c[3 * from(coefficient(n)) + n % 3]));
        },
    },
    Mutant {
        name: "signs of Condon and Shortley",
        change: |v| {
            let sign = |j: usize| if [1, 3, 5, 7].contains(&j) { -1.0 } else { 1.0 };
            three_numbers(v, |c| std::array::from_fn(|n| sign(coefficient(n)) * c[n]));
        },
    },
    Mutant {
        name: "one colour after the other",
        change: |v| three_numbers(v, |c| std::array::from_fn(|n| if n < 27 { c[3 * (n % 9) + n / 9] } else { 0.0 })),
    },
    Mutant {
        name: "no padding",
        change: |v| {
            // Slice after slice without gaps, and what is left over at the end.
            three_texels(v, |n, t, [x, y, z]| {
                let slice = (t * (n[2] + PADDING)) as isize + z + 1;
                let (t, z) = (slice as usize / n[2], slice as usize % n[2]);
                (t.min(TEXELS - 1), [x, y, z as isize])
            });
        },
    },
    Mutant {
        name: "sub-volumes texel by texel",
        change: |v| {
            three_texels(v, |n, t, [x, y, z]| {
                let slice = t * n[2] + z.clamp(0, n[2] as isize - 1) as usize;
                (slice % TEXELS, [x, y, (slice / TEXELS) as isize])
            });
        },
    },
    Mutant {
        name: "z runs fastest",
        change: |v| {
            three_texels(v, |n, t, [x, y, z]| {
                let z = z.clamp(0, n[2] as isize - 1);
                (t, Volume::transposed(n, [x as usize, y as usize, z as usize]).map(|i| i as isize))
            });
        },
    },
    Mutant { name: "box from probe to probe", change: from_probe_to_probe },
    Mutant { name: "shift by half a spacing", change: shifted },
];

/// Where the texels of a KTX2 file begin: its first level.
fn first_level(bytes: &[u8]) -> usize {
    u64::from_le_bytes(bytes[80..88].try_into().expect("eight bytes")) as usize
}

/// Changes a Bevy volume by the place of its texels: of the probe, the axis of the face and 1 where it is negative.
fn bevy_texels(volume: &mut Volume, source: impl Fn(Texel, Texel, usize, usize) -> (Texel, usize, usize)) {
    let n = volume.resolution();
    let start = first_level(&volume.bytes);
    volume.texels_from(start, 4, [n[0], 2 * n[1], 3 * n[2]], |[x, y, z]| {
        let ([x, y, z], axis, negative) = source(n, [x, y % n[1], z % n[2]], z / n[2], y / n[1]);
        [x, y + negative * n[1], z + axis * n[2]]
    });
}

fn intensity(volume: &mut Volume, times: f32) {
    let own = volume.record["engine"]["intensity"].as_f64().expect("a number");
    volume.record["engine"]["intensity"] = json!(own * f64::from(times));
}

pub const OF_BEVY: [Mutant; 10] = [
    Mutant { name: "irradiance in place of irradiance / pi", change: |v| intensity(v, PI) },
    Mutant {
        name: "halves as the documentation has them",
        change: |v| bevy_texels(v, |_, p, axis, negative| (p, axis, 1 - negative)),
    },
    Mutant { name: "axes z, y, x", change: |v| bevy_texels(v, |_, p, axis, negative| (p, 2 - axis, negative)) },
    Mutant {
        name: "y and z exchanged",
        change: |v| bevy_texels(v, |_, p, axis, negative| (p, [0, 2, 1][axis], negative)),
    },
    Mutant {
        name: "faces of a probe side by side",
        change: |v| {
            bevy_texels(v, |n, [x, y, z], axis, negative| {
                let slice = axis * n[2] + z;
                ([x, y, slice / 3], slice % 3, negative)
            });
        },
    },
    Mutant {
        name: "z runs fastest",
        change: |v| bevy_texels(v, |n, p, axis, negative| (Volume::transposed(n, p), axis, negative)),
    },
    Mutant {
        name: "rows from top to bottom",
        change: |v| bevy_texels(v, |n, [x, y, z], axis, negative| ([x, n[1] - 1 - y, z], axis, negative)),
    },
    Mutant {
        name: "blue, green, red",
        change: |v| {
            let start = first_level(&v.bytes);
            for texel in v.bytes[start..].as_chunks_mut::<4>().0 {
                let bits = u32::from_le_bytes(*texel);
                let mixed = bits & !0x07FC_01FF | (bits & 511) << 18 | bits >> 18 & 511;
                *texel = mixed.to_le_bytes();
            }
        },
    },
    Mutant { name: "box from probe to probe", change: from_probe_to_probe },
    Mutant { name: "shift by half a spacing", change: shifted },
];
