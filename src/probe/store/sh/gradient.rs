//! How the mean irradiance of a probe changes on the way from it.
//!
//! With g the gradient of the first coefficient, a point at `x` gets `Y₀·g·(x − q)/s` more than the probe at `q` holds; the
//! way is measured in the probe's spacings `s` along each axis and clipped to ±[`FARTHEST`] of them.

use glam::{Vec3, Vec3A};
use safetensors::Dtype;

use crate::math::harmonics::Y0;
use crate::probe::container::Container;
use crate::probe::store::encode::{ColorFormat, decode_colors};

pub const AXES: usize = 3;

/// Spacings along an axis. Points of a probe's own cells are not farther, wherever in them it stands; those that ask from
/// beyond the grid get no more than at its rim.
pub const FARTHEST: f32 = 2.0;

/// Gradients of all probes, W·m⁻² by coefficient and spacing.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradient(Vec<[Vec3A; AXES]>);

impl Gradient {
    pub fn zeros(probes: usize) -> Gradient {
        Gradient(vec![[Vec3A::ZERO; AXES]; probes])
    }

    /// What a point gets more than the probe holds, W·m⁻²; `offset` in spacings, clipped.
    #[inline]
    pub fn change(&self, probe: usize, offset: Vec3) -> Vec3A {
        let [x, y, z] = self.0[probe];
        (x * offset.x + y * offset.y + z * offset.z) * Y0
    }

    /// Along x, y, z.
    pub fn of(&self, probe: usize) -> [Vec3A; AXES] {
        self.0[probe]
    }

    pub fn set(&mut self, probe: usize, gradient: [Vec3A; AXES]) {
        self.0[probe] = gradient;
    }

    /// Those of some probes, in this order.
    pub fn of_probes(&self, probes: &[usize]) -> Gradient {
        Gradient(probes.iter().map(|&probe| self.0[probe]).collect())
    }

    /// All of them, as the file has them.
    pub fn numbers(&self) -> impl Iterator<Item = &Vec3A> {
        self.0.as_flattened().iter()
    }

    /// Reads the tensor of the same type and scale as the coefficients.
    ///
    /// # Errors
    /// What is missing or out of range.
    pub fn read(container: &Container, probes: usize, dtype: Dtype, scale: f32) -> Result<Gradient, String> {
        let tensor = container.tensor(TENSOR, &[dtype], &[Some(probes), Some(AXES), Some(3)])?;
        let format = ColorFormat::of(dtype).ok_or_else(|| format!("tensor '{TENSOR}' has no colour format"))?;
        let numbers: Vec<Vec3A> = decode_colors(&tensor.bytes, format, scale).into_iter().map(Vec3A::from).collect();
        if numbers.iter().any(|g| !g.is_finite()) {
            return Err(format!("tensor '{TENSOR}' holds numbers that are not finite"));
        }
        Ok(Gradient(numbers.as_chunks::<AXES>().0.to_vec()))
    }
}

/// Name in the file.
pub const TENSOR: &str = "gradient";
