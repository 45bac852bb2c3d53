//! The largest and the mean emission over a part of a triangle, from pyramids over its texture.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use super::material::Wrap;
use super::{AlphaMode, Scene, Texture, TextureIndex, TextureRef, TriangleIndex};
use crate::math::color::luminance;

/// Texels per side up to which a pyramid's finest level has one cell per texel. Larger textures have larger cells.
const FINEST: u32 = 2048;

/// Cells along each side that a question about a region reads at most: it goes up to the level where that is enough.
const MOST_CELLS: usize = 4;

/// What a part of a surface emits: luminance, W·m⁻²·sr⁻¹.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmissionRange {
    /// Nowhere more than this.
    pub most: f32,
    /// About.
    pub mean: f32,
    /// Whether the part is about as small as a texel, so that a smaller one is not known better.
    pub is_smallest: bool,
}

/// Answers for all triangles of a scene. Pyramids are built when they are first asked for.
#[derive(Default)]
pub struct TextureRange {
    pyramids: HashMap<(TextureIndex, Quantity), Pyramid>,
    /// Largest vertex colour in every channel, 1 without colours.
    brightest_color: Vec4,
}

/// What a pyramid is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Quantity {
    /// Luminance of the texels times a factor, given by its bits.
    Luminance([u32; 3]),
    Alpha,
}

/// Means and maxima over squares of texels, each level of half the resolution of the one before.
struct Pyramid {
    levels: Vec<Level>,
    /// Texels per cell of the finest level.
    texels_per_cell: f32,
    size: Vec2,
    wrap: [Wrap; 2],
}

struct Level {
    columns: usize,
    rows: usize,
    /// Largest and mean luminance.
    cells: Vec<(f32, f32)>,
}

impl TextureRange {
    pub fn new(scene: &Scene) -> TextureRange {
        let brightest = scene.mesh.colors.iter().copied().reduce(Vec4::max).unwrap_or(Vec4::ONE);
        TextureRange { pyramids: HashMap::new(), brightest_color: brightest.max(Vec4::ZERO) }
    }

    /// Emission × opacity over the part of a triangle between three points, given in its barycentric coordinates.
    pub fn emission(&mut self, scene: &Scene, triangle: TriangleIndex, corners: &[Vec2; 3]) -> EmissionRange {
        let material = scene.material(triangle);
        let (factor, texture) = match material.unlit {
            true => (material.base_color * self.brightest_color, material.base_color_texture),
            false => (material.emission.extend(1.0), material.emission_texture),
        };
        let factor = factor.truncate().max(Vec3::ZERO);
        let emitted = match texture.filter(|_| factor != Vec3::ZERO) {
            None => EmissionRange::constant(luminance(factor)),
            Some(texture) => {
                self.over(scene, texture, Quantity::Luminance(factor.to_array().map(f32::to_bits)), triangle, corners)
            }
        };
        let opaque = self.opacity(scene, triangle, corners);
        EmissionRange {
            most: emitted.most * opaque.most,
            mean: emitted.mean * opaque.mean,
            is_smallest: emitted.is_smallest && opaque.is_smallest,
        }
    }

    fn opacity(&mut self, scene: &Scene, triangle: TriangleIndex, corners: &[Vec2; 3]) -> EmissionRange {
        let material = scene.material(triangle);
        if material.alpha_mode == AlphaMode::Opaque {
            return EmissionRange::constant(1.0);
        }
        let factor = material.base_color.w * self.brightest_color.w;
        let alpha = match material.base_color_texture {
            None => EmissionRange::constant(1.0),
            Some(texture) => self.over(scene, texture, Quantity::Alpha, triangle, corners),
        };
        let (most, mean) = ((alpha.most * factor).clamp(0.0, 1.0), (alpha.mean * factor).clamp(0.0, 1.0));
        match material.alpha_mode {
            AlphaMode::Mask { cutoff } => EmissionRange { most: f32::from(most >= cutoff), mean, ..alpha },
            _ => EmissionRange { most, mean, ..alpha },
        }
    }

    fn over(
        &mut self,
        scene: &Scene,
        reference: TextureRef,
        quantity: Quantity,
        triangle: TriangleIndex,
        corners: &[Vec2; 3],
    ) -> EmissionRange {
        let texture = &scene.textures[reference.texture.0 as usize];
        let pyramid = self.pyramids.entry((reference.texture, quantity)).or_insert_with(|| match quantity {
            Quantity::Luminance(factor) => {
                let factor = Vec3::from_array(factor.map(f32::from_bits));
                Pyramid::new(texture, |texel| luminance(factor * texel.truncate()))
            }
            Quantity::Alpha => Pyramid::new(texture, |texel| texel.w),
        });
        let uvs = &scene.mesh.uvs[reference.uv_set];
        pyramid.over(&corners.map(|p| reference.transform(scene.mesh.interpolate(uvs, triangle, p))))
    }
}

impl EmissionRange {
    /// No smaller part is known better.
    fn constant(value: f32) -> EmissionRange {
        EmissionRange { most: value, mean: value, is_smallest: true }
    }
}

impl Pyramid {
    fn new(texture: &Texture, value: impl Fn(Vec4) -> f32) -> Pyramid {
        let step = texture.width.max(texture.height).div_ceil(FINEST);
        let (columns, rows) = (texture.width.div_ceil(step), texture.height.div_ceil(step));
        let cell = |i: u32| {
            let (x, y) = (i % columns * step, i / columns * step);
            let (x1, y1) = ((x + step).min(texture.width), (y + step).min(texture.height));
            let texels = (y..y1).flat_map(|y| (x..x1).map(move |x| (x, y)));
            let (mut most, mut sum, mut count) = (0.0f32, 0.0, 0.0);
            for (x, y) in texels {
                let value = value(texture.texel(x, y));
                (most, sum, count) = (most.max(value), sum + value, count + 1.0);
            }
            (most, sum / count)
        };
        let finest =
            Level { columns: columns as usize, rows: rows as usize, cells: (0..columns * rows).map(cell).collect() };
        let mut levels = vec![finest];
        while let Some(last) = levels.last().filter(|level| level.cells.len() > 1) {
            levels.push(last.halved());
        }
        let size = Vec2::new(texture.width as f32, texture.height as f32);
        Pyramid { levels, texels_per_cell: step as f32, size, wrap: texture.wrap }
    }

    /// Over the smallest box around some points of the texture, and a texel more on every side: as far as interpolation
    /// reaches.
    fn over(&self, uvs: &[Vec2; 3]) -> EmissionRange {
        let texels = uvs.map(|uv| uv * self.size);
        let low = texels[0].min(texels[1]).min(texels[2]);
        let high = texels[0].max(texels[1]).max(texels[2]);
        let is_smallest = (high - low).max_element() <= self.texels_per_cell;
        let along = |axis: usize| within(self.wrap[axis], low[axis] - 1.0, high[axis] + 1.0, self.size[axis]);
        let spans = [along(0), along(1)];
        // Cells of a level that a span touches.
        let touched = |level: usize, axis: usize| {
            let cell = self.texels_per_cell * (1u32 << level) as f32;
            let count = [self.levels[level].columns, self.levels[level].rows][axis];
            // `as` saturates and sends NaN to 0.
            let [first, last] = spans[axis].map(|p| ((p / cell) as usize).min(count - 1));
            first..=last
        };
        let narrow = |level: &usize| (0..2).all(|axis| touched(*level, axis).count() <= MOST_CELLS);
        // The coarsest level has one cell.
        let level = (0..self.levels.len()).find(narrow).unwrap_or(self.levels.len() - 1);
        let cells = &self.levels[level];
        let (mut most, mut sum, mut count) = (0.0f32, 0.0, 0.0);
        for row in touched(level, 1) {
            for column in touched(level, 0) {
                let (cell_most, cell_mean) = cells.cells[row * cells.columns + column];
                (most, sum, count) = (most.max(cell_most), sum + cell_mean, count + 1.0);
            }
        }
        EmissionRange { most, mean: sum / count, is_smallest }
    }
}

impl Level {
    fn halved(&self) -> Level {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let cell = |i: usize| {
            let (x, y) = (i % columns * 2, i / columns * 2);
            let (mut most, mut sum, mut count) = (0.0f32, 0.0, 0.0);
            for y in y..(y + 2).min(self.rows) {
                for x in x..(x + 2).min(self.columns) {
                    let (cell_most, mean) = self.cells[y * self.columns + x];
                    (most, sum, count) = (most.max(cell_most), sum + mean, count + 1.0);
                }
            }
            (most, sum / count)
        };
        Level { columns, rows, cells: (0..columns * rows).map(cell).collect() }
    }
}

/// The texels of the image, from 0 to `size`, that the texels from `low` to `high` of the continued image come from; all
/// of them where the span crosses an edge at which the image is repeated.
fn within(mode: Wrap, low: f32, high: f32, size: f32) -> [f32; 2] {
    let period = (low / size).floor();
    let crosses = (high / size).floor() != period;
    match mode {
        Wrap::ClampToEdge => [low, high].map(|p| p.clamp(0.0, size)),
        // NaN crosses too.
        _ if crosses => [0.0, size],
        Wrap::MirroredRepeat if period.rem_euclid(2.0) == 1.0 => [high, low].map(|p| (period + 1.0) * size - p),
        _ => [low, high].map(|p| p - period * size),
    }
}
