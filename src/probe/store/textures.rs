//! What a look-up on a graphics card reads of the store: numbers as they are in memory here, and the names by which
//! `query/lookup.glsl` tells how they lie.

use super::map::OctahedralMaps;

/// Numbers of a texture, texel after texel.
#[derive(Debug, Clone, PartialEq)]
pub enum Numbers {
    F32(Vec<f32>),
    U32(Vec<u32>),
    U16(Vec<u16>),
}

/// One texture.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// Of the sampler.
    pub name: &'static str,
    /// Numbers a texel.
    pub channels: usize,
    pub numbers: Numbers,
}

/// Names that the shader's text is compiled with, each with its value, and the textures that it then reads.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bound {
    pub defines: Vec<(&'static str, String)>,
    pub textures: Vec<Texture>,
}

impl Bound {
    pub fn define(&mut self, name: &'static str, value: impl ToString) {
        self.defines.push((name, value.to_string()));
    }

    /// How the maps of [`OctahedralMaps`] lie: the names of interior texels per side and of the border.
    pub fn define_sides<T: Copy>(&mut self, [resolution, border]: [&'static str; 2], maps: &OctahedralMaps<T>) {
        self.define(resolution, maps.resolution);
        self.define(border, maps.border);
    }

    /// Adds what another part binds.
    pub fn add(&mut self, other: Bound) {
        self.defines.extend(other.defines);
        self.textures.extend(other.textures);
    }

    /// Bytes of all textures.
    pub fn bytes(&self) -> usize {
        self.textures.iter().map(|texture| texture.numbers.bytes()).sum()
    }
}

impl Numbers {
    pub fn bytes(&self) -> usize {
        match self {
            Numbers::F32(numbers) => 4 * numbers.len(),
            Numbers::U32(numbers) => 4 * numbers.len(),
            Numbers::U16(numbers) => 2 * numbers.len(),
        }
    }
}
