//! Irradiance as nine coefficients of spherical harmonics a probe.
//!
//! `E(n) = Σ c_j·Y_j(n)` with the functions of [`harmonics`]. The solver's unknowns are `c_j·Y₀`: the first is the mean
//! irradiance, and all have its unit. Where it is presampled, shading reads an octahedral map of the sum instead, of
//! R11G11B10F texels with a border of one: values below 0, which nine coefficients give beside bright lights, become 0.
//!
//! With a gradient ([`gradient`]) a point beside the probe adds the change of the mean on its way there.

mod file;
mod gradient;
mod numbers;

use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use self::gradient::FARTHEST;
use self::gradient::Gradient;
use super::encode::ColorFormat;
use super::map::{OctahedralMaps, fill_with_border};
use crate::math::harmonics::{self, COUNT, Y0};
use crate::math::octahedral::{direction_from_oct, texel_direction};
use crate::probe::container::Container;

/// How coefficients are stored and read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShStore {
    /// `F16` or `F32`.
    pub format: ColorFormat,
    /// Interior texels per side of the maps that shading reads; `None`: it evaluates the functions.
    pub presampled: Option<usize>,
    /// Whether each probe also holds the gradient of its mean irradiance: a fit fills it, and without one it is 0.
    pub gradient: bool,
}

impl Default for ShStore {
    fn default() -> Self {
        ShStore { format: ColorFormat::F32, presampled: None, gradient: false }
    }
}

/// Texels around the maps that shading reads.
const BORDER: usize = 1;

/// Format of the maps that shading reads.
const PRESAMPLED: ColorFormat = ColorFormat::R11G11B10F;

/// ∫|K| ÷ ∫K of the kernel K = 3/32 + x/2 + 15/32·x² that the bands 0 to 2 leave of a clamped cosine: it is negative
/// between the cosines −0.824 and −0.243, and 1.0615 is rounded up. No irradiance is larger than this times π times the
/// largest radiance.
const OVERSHOOT: f32 = 1.062;

impl ShStore {
    /// Bytes of one probe in the layout that shading uses.
    pub fn runtime_bytes(&self) -> usize {
        match self.presampled {
            Some(resolution) => (resolution + 2 * BORDER).pow(2) * PRESAMPLED.bytes_per_texel(),
            None => (COUNT + if self.gradient { gradient::AXES } else { 0 }) * self.format.bytes_per_texel(),
        }
    }

    /// Most memory that one probe takes while it is baked and encoded.
    pub fn working_bytes(&self) -> u64 {
        let texels = COUNT + self.presampled.map_or(0, |resolution| (resolution + 2 * BORDER).pow(2));
        // Four floats each, and as many of an iteration's result.
        (texels * 2 * size_of::<Vec3A>()) as u64
    }

    /// Largest relative error of what shading reads.
    pub fn rounding(&self) -> f64 {
        self.presampled.map_or(self.format, |_| PRESAMPLED).rounding()
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let (key, format) = ("store.irradiance.sh9.format", self.format);
        rule(key, format.name().to_owned(), !format.is_packed(), "coefficients have signs: use f16 or f32");
        if let Some(n) = self.presampled {
            let holds = (1..=most_texels).contains(&n);
            rule("store.irradiance.sh9.presampled", n.to_string(), holds, "use 1 to 1024 texels, or None");
            rule(
                "store.irradiance.sh9.presampled",
                n.to_string(),
                !self.gradient,
                "maps hold no gradient: use None with one",
            );
        }
    }
}

/// Coefficients of all probes.
#[derive(Debug, Clone, PartialEq)]
pub struct ShIrradiance {
    /// [`COUNT`] a probe, W·m⁻².
    coefficients: Vec<Vec3A>,
    /// That of the file.
    format: ColorFormat,
    /// What shading reads, W·m⁻².
    presampled: Option<OctahedralMaps<Vec3A>>,
    gradient: Option<Gradient>,
}

/// A direction, made ready once for all probes that are asked around it.
#[derive(Debug, Clone, Copy)]
pub struct Functions(pub [f32; COUNT]);

impl ShIrradiance {
    pub fn zeros(store: &ShStore, probes: usize) -> ShIrradiance {
        let maps = |resolution| OctahedralMaps::new(probes, resolution, BORDER, Vec3A::ZERO);
        let presampled = store.presampled.map(maps);
        let gradient = store.gradient.then(|| Gradient::zeros(probes));
        ShIrradiance { coefficients: vec![Vec3A::ZERO; COUNT * probes], format: store.format, presampled, gradient }
    }

    pub fn store(&self) -> ShStore {
        let presampled = self.presampled.as_ref().map(|maps| maps.resolution);
        ShStore { format: self.format, presampled, gradient: self.gradient.is_some() }
    }

    /// Most by which irradiance may exceed π times the largest radiance, as a factor.
    pub fn overshoot(&self) -> f32 {
        OVERSHOOT
    }

    fn of_probe(&self, probe: usize) -> &[Vec3A] {
        &self.coefficients[probe * COUNT..(probe + 1) * COUNT]
    }

    /// Irradiance of a probe around the direction `oct` where it stands, W·m⁻².
    pub fn at(&self, probe: usize, oct: Vec2) -> Vec3A {
        self.sum(oct, [(probe, 1.0)].into_iter(), |_| Vec3::ZERO, |e| e)
    }

    /// Σ weight · forward(irradiance around `oct`) over some probes; `offset` tells how far a probe is from the point, in its
    /// spacings.
    #[inline]
    pub fn sum(
        &self,
        oct: Vec2,
        parts: impl Iterator<Item = (usize, f32)>,
        offset: impl Fn(usize) -> Vec3,
        forward: impl Fn(Vec3A) -> Vec3A,
    ) -> Vec3A {
        match &self.presampled {
            Some(maps) => {
                let taps = maps.taps(oct);
                parts.map(|(probe, weight)| forward(maps.sample(probe, &taps)) * weight).sum()
            }
            None => {
                let functions = Functions(harmonics::basis(direction_from_oct(oct)));
                let at = |probe| evaluate(self.of_probe(probe), &functions);
                match &self.gradient {
                    None => parts.map(|(probe, weight)| forward(at(probe)) * weight).sum(),
                    Some(gradient) => {
                        let there = |probe| at(probe) + gradient.change(probe, offset(probe));
                        parts.map(|(probe, weight)| forward(there(probe)) * weight).sum()
                    }
                }
            }
        }
    }

    /// What a look-up takes of the unknowns, by its direction.
    pub fn shares(&self) -> Shares {
        let maps = |(maps, functions): (&OctahedralMaps<Vec3A>, Vec<Functions>)| {
            let mut table = OctahedralMaps::new(1, maps.resolution, BORDER, Functions([0.0; COUNT]));
            table.probe_mut(0).copy_from_slice(&functions);
            table
        };
        Shares { presampled: self.presampled().map(maps) }
    }

    /// One of a probe's unknowns, W·m⁻².
    #[inline]
    pub fn unknown(&self, probe: usize, j: usize) -> Vec3A {
        self.coefficients[probe * COUNT + j] * Y0
    }

    /// The functions that shading reads at the texels of its maps, borders included; `None`: it evaluates them itself.
    pub fn presampled(&self) -> Option<(&OctahedralMaps<Vec3A>, Vec<Functions>)> {
        let maps = self.presampled.as_ref()?;
        let interior = texel_functions(maps.resolution);
        let mut all = vec![Functions([0.0; COUNT]); maps.texels_per_probe()];
        fill_with_border(&interior, maps.resolution, BORDER, &mut all);
        Some((maps, all))
    }

    /// Unknowns of a fit of one probe: its coefficients and, with a gradient, the three of that.
    pub fn fitted_unknowns(&self) -> usize {
        COUNT + if self.gradient.is_some() { gradient::AXES } else { 0 }
    }

    /// These of a probe, W·m⁻²: all times Y₀.
    pub fn fitted(&self, probe: usize) -> Vec<Vec3A> {
        let gradient = self.gradient.iter().flat_map(|gradient| gradient.of(probe).map(|g| g * Y0));
        self.probe(probe).chain(gradient).collect()
    }

    /// Sets them.
    pub fn set_fitted(&mut self, probe: usize, values: &[Vec3A]) {
        let (coefficients, slopes) = values.split_at(COUNT);
        self.set_probe(probe, coefficients);
        if let (Some(gradient), [x, y, z]) = (&mut self.gradient, slopes) {
            gradient.set(probe, [x, y, z].map(|g| *g / Y0));
        }
    }

    /// The unknowns of one probe, W·m⁻².
    pub fn probe(&self, probe: usize) -> impl Iterator<Item = Vec3A> + '_ {
        self.of_probe(probe).iter().map(|c| *c * Y0)
    }

    /// Irradiance along `directions` from the unknowns of a probe.
    pub fn along<'d>(unknowns: &'d [Vec3A], directions: &'d [Vec3]) -> impl Iterator<Item = Vec3A> + 'd {
        directions.iter().map(|&d| evaluate(unknowns, &Functions(harmonics::basis(d))) / Y0)
    }

    /// The unknowns that directional samples give, each radiance ÷ density, W·m⁻².
    pub fn of_samples(samples: &[(Vec3, Vec3)]) -> Vec<Vec3A> {
        let mut unknowns = vec![Vec3A::ZERO; COUNT];
        for (direction, light) in samples {
            let y = harmonics::basis(*direction);
            for (j, unknown) in unknowns.iter_mut().enumerate() {
                *unknown += Vec3A::from(*light) * (y[j] * harmonics::COSINE[j] * Y0);
            }
        }
        unknowns
    }

    /// As [`super::Irradiance::set_each`].
    pub fn set_each<R: Send>(
        &mut self,
        values: impl Fn(usize, &mut dyn Iterator<Item = Vec3A>) -> Option<(Vec<Vec3A>, R)> + Sync,
    ) -> Vec<Option<R>> {
        let set = |(probe, coefficients): (usize, &mut [Vec3A])| {
            let before: Vec<Vec3A> = coefficients.iter().map(|c| *c * Y0).collect();
            let (values, result) = values(probe, &mut before.into_iter())?;
            coefficients.iter_mut().zip(values).for_each(|(c, value)| *c = value / Y0);
            Some(result)
        };
        let results: Vec<Option<R>> = self.coefficients.par_chunks_mut(COUNT).enumerate().map(set).collect();
        self.presample();
        // A gradient belongs to the coefficients that it was fitted with.
        if let Some(gradient) = &mut self.gradient {
            (0..results.len()).filter(|&p| results[p].is_some()).for_each(|p| gradient.set(p, Default::default()));
        }
        results
    }

    /// Sets the unknowns of one probe.
    pub fn set_probe(&mut self, probe: usize, values: &[Vec3A]) {
        let coefficients = &mut self.coefficients[probe * COUNT..(probe + 1) * COUNT];
        coefficients.iter_mut().zip(values).for_each(|(c, value)| *c = *value / Y0);
        if let Some(gradient) = &mut self.gradient {
            gradient.set(probe, Default::default());
        }
        if let Some(maps) = &mut self.presampled {
            let functions = texel_functions(maps.resolution);
            sample(coefficients, &functions, maps.resolution, maps.probe_mut(probe));
        }
    }

    /// Fills the maps that shading reads.
    fn presample(&mut self) {
        let Some(maps) = &mut self.presampled else { return };
        let (resolution, per_probe) = (maps.resolution, maps.texels_per_probe());
        let functions = texel_functions(resolution);
        let probes = maps.texels.par_chunks_mut(per_probe).zip(self.coefficients.par_chunks(COUNT));
        probes.for_each(|(map, coefficients)| sample(coefficients, &functions, resolution, map));
    }

    /// Those of some probes, in this order.
    pub fn of_probes(&self, probes: &[usize]) -> ShIrradiance {
        ShIrradiance {
            coefficients: probes.iter().flat_map(|&probe| self.of_probe(probe).iter().copied()).collect(),
            format: self.format,
            presampled: self.presampled.as_ref().map(|maps| maps.of_probes(probes)),
            gradient: self.gradient.as_ref().map(|gradient| gradient.of_probes(probes)),
        }
    }

    /// Coefficients, for checkpoints; inverse of [`Self::restore`]. Gradients come after the last of these.
    pub fn stored(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.coefficients.iter().map(|&c| c.into())
    }

    /// Puts back what [`Self::stored`] gave; false where it is of another volume.
    pub fn restore(&mut self, stored: &[Vec3]) -> bool {
        let fits = stored.len() == self.coefficients.len();
        if fits {
            self.coefficients = stored.iter().map(|&c| c.into()).collect();
            self.presample();
        }
        fits
    }

    /// In words.
    pub fn describe(&self) -> String {
        let read = match &self.presampled {
            Some(maps) => format!(", presampled to {0}×{0} texels, {1}", maps.resolution, PRESAMPLED.name()),
            None => String::new(),
        };
        let gradient = if self.gradient.is_some() { " and the gradient of the mean" } else { "" };
        format!("{COUNT} coefficients of spherical harmonics{gradient}, {}{read}", self.format.name())
    }
}

/// What look-ups take of the unknowns.
pub struct Shares {
    /// The functions where shading reads a map of them.
    presampled: Option<OctahedralMaps<Functions>>,
}

impl Shares {
    /// Of each unknown what a look-up around `oct` takes.
    pub fn around(&self, oct: Vec2) -> [f32; COUNT] {
        let mut shares = match &self.presampled {
            Some(maps) => {
                let taps = maps.taps(oct);
                let texel = |i: usize| maps.texels[taps.offset[i] as usize].0;
                std::array::from_fn(|j| (0..4).map(|i| texel(i)[j] * taps.weight[i]).sum())
            }
            None => harmonics::basis(direction_from_oct(oct)),
        };
        shares.iter_mut().for_each(|share| *share /= Y0);
        shares
    }
}

#[inline]
fn evaluate(coefficients: &[Vec3A], Functions(y): &Functions) -> Vec3A {
    coefficients.iter().zip(y).map(|(c, y)| *c * *y).sum()
}

/// The functions at the centres of a map's texels, row by row.
fn texel_functions(resolution: usize) -> Vec<Functions> {
    let direction = |o: usize| texel_direction(o % resolution, o / resolution, resolution);
    (0..resolution * resolution).map(|o| Functions(harmonics::basis(direction(o)))).collect()
}

fn sample(coefficients: &[Vec3A], functions: &[Functions], resolution: usize, map: &mut [Vec3A]) {
    let interior: Vec<Vec3A> = functions.iter().map(|functions| evaluate(coefficients, functions)).collect();
    fill_with_border(&interior, resolution, BORDER, map);
}

/// Name of the coefficients in the file.
const TENSOR: &str = "sh";

/// Whether a file holds coefficients.
pub fn is_in(container: &Container) -> bool {
    container.has(TENSOR)
}

#[cfg(test)]
mod tests;
