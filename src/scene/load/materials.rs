//! The materials in use, with their textures. Alpha modes without effect become opaque.

use std::collections::{BTreeMap, BTreeSet};

use super::document::Document;
use super::draws::Draws;
use super::flatten::MaterialOf;
use super::material::{BRIGHT, Notes, Read};
use super::primitive::Primitive;
use super::textures::Textures;
use crate::scene::error::SceneError;
use crate::scene::{AlphaMode, LoadOptions, Material, MaterialIndex, Unassigned};

/// The materials of all draws.
pub(super) struct Materials {
    pub materials: Vec<Material>,
    /// Their texts in messages.
    places: Vec<String>,
    /// From the glTF index, where `None` stands for meshes without a material.
    indices: BTreeMap<Option<usize>, MaterialIndex>,
    /// The material of meshes without one, if there are such meshes.
    pub unassigned: Option<Unassigned>,
    /// Number of materials whose emission exceeds [`LIGHT_MAX`].
    pub light_clamped: u64,
}

impl MaterialOf for Materials {
    fn of(&self, primitive: &Primitive) -> (MaterialIndex, bool) {
        let index = self.indices[&primitive.material];
        (index, self.materials[index.0 as usize].alpha_mode != AlphaMode::Opaque)
    }
}

impl Materials {
    /// Reads the materials that the draws use, in the order of the file, and of their textures those that
    /// `options.detail` looks at. Textures that only pictures show come last, so that the hash of all others does not
    /// depend on them.
    pub fn load(
        document: &Document,
        draws: &Draws,
        textures: &mut Textures,
        options: &LoadOptions,
        warnings: &mut Vec<String>,
    ) -> Result<Materials, SceneError> {
        let mut used: BTreeMap<Option<usize>, f32> = BTreeMap::new();
        for primitive in &draws.primitives {
            let least = primitive.colors.iter().map(|c| c.w).fold(1.0, f32::min);
            let known = used.entry(primitive.material).or_insert(1.0);
            *known = known.min(least);
        }
        let mut notes = Notes::default();
        let mut read = Vec::new();
        for &index in used.keys() {
            read.push(match index {
                None => Read::unassigned(options.unassigned),
                Some(number) => {
                    let place = draws.primitives.iter().find(|p| p.material == index).map_or("", |p| &p.place);
                    let value = document.json(&document.materials, "material", number, &place)?;
                    Read::new(document, number, value, options.detail, &mut notes)?
                }
            });
        }
        for for_pictures in [false, true] {
            textures.for_pictures = for_pictures;
            for Read { material, place, wanted } in &mut read {
                for (of, slot) in wanted.extract_if(.., |(of, _)| of.for_pictures == for_pictures) {
                    let place = format!("{place} {}", of.name);
                    *(of.field)(material) = Some(slot.load(document, textures, of.srgb, &place)?);
                }
            }
        }
        let mut materials = Materials {
            materials: Vec::new(),
            places: Vec::new(),
            indices: BTreeMap::new(),
            unassigned: used.contains_key(&None).then_some(options.unassigned),
            light_clamped: notes.count(BRIGHT),
        };
        for ((&index, &least_vertex_alpha), Read { material, place, .. }) in used.iter().zip(read) {
            let alpha_mode = simplest_alpha(&material, least_vertex_alpha, textures);
            materials.indices.insert(index, MaterialIndex(materials.materials.len() as u32));
            materials.materials.push(Material { alpha_mode, ..material });
            materials.places.push(place);
        }
        warnings.extend(materials.unassigned.map(|unassigned| about_unassigned(draws, unassigned)));
        notes.report(warnings);
        Ok(materials)
    }

    /// The material of a primitive and its text in messages.
    pub fn of_primitive(&self, primitive: &Primitive) -> (&Material, &str) {
        let index = self.indices[&primitive.material].0 as usize;
        (&self.materials[index], &self.places[index])
    }
}

/// One line about the meshes without a material.
fn about_unassigned(draws: &Draws, unassigned: Unassigned) -> String {
    let count = |wanted: fn(&Primitive) -> bool| {
        draws.primitives.iter().filter(|p| wanted(p)).map(|p| p.mesh).collect::<BTreeSet<_>>().len()
    };
    let (without, all) = (count(|p| p.material.is_none()), count(|_| true));
    let which = match (without, all) {
        (1, 1) => "the only mesh has no material and is".to_owned(),
        (n, all) if n == all => format!("all {all} meshes have no material and are"),
        (1, all) => format!("1 of {all} meshes has no material and is"),
        (n, all) => format!("{n} of {all} meshes have no material and are"),
    };
    match unassigned {
        Unassigned::Diffuse { albedo } => format!("{which} given a diffuse albedo of {albedo} (materials.unassigned)"),
        Unassigned::Gltf => format!(
            "{which} white metal as glTF has it, which bakes black; --set materials.unassigned=diffuse(albedo: 0.8) makes \
             them diffuse"
        ),
    }
}

/// The material's alpha mode, or opaque if no point of it can be transparent. The product of the least values of
/// factor, vertices and texture is a lower bound, because interpolation never goes below the least value.
fn simplest_alpha(material: &Material, least_vertex_alpha: f32, textures: &Textures) -> AlphaMode {
    let texture = material.base_color_texture.map_or(1.0, |t| textures.least_alpha[t.texture.0 as usize]);
    let least = material.base_color.w * least_vertex_alpha * texture;
    match material.alpha_mode {
        AlphaMode::Mask { cutoff } if least >= cutoff => AlphaMode::Opaque,
        AlphaMode::Blend if least >= 1.0 => AlphaMode::Opaque,
        mode => mode,
    }
}
