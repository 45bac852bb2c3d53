//! The materials in use, with their textures. Alpha modes without effect become opaque.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Vec3, Vec4};
use gltf::json::Material as Definition;
use gltf::json::material::AlphaMode as DefinedAlpha;
use gltf::json::validation::Checked;
use serde_json::Value;

use super::document::Document;
use super::draws::Draws;
use super::flatten::MaterialOf;
use super::primitive::Primitive;
use super::text::{label, short};
use super::texture_slot::{Slot, slot};
use super::textures::Textures;
use crate::scene::error::{RE_EXPORT, SceneError};
use crate::scene::{AlphaMode, Material, MaterialIndex, TextureRef};

/// The materials of all draws.
pub(super) struct Materials {
    pub materials: Vec<Material>,
    /// From the glTF index, where `None` is the default material.
    indices: BTreeMap<Option<usize>, MaterialIndex>,
}

impl MaterialOf for Materials {
    fn of(&self, primitive: &Primitive) -> (MaterialIndex, bool) {
        let index = self.indices[&primitive.material];
        (index, self.materials[index.0 as usize].alpha_mode != AlphaMode::Opaque)
    }
}

impl Materials {
    /// Reads the materials that the draws use, in the order of the file.
    pub fn load(
        document: &Document,
        draws: &Draws,
        textures: &mut Textures,
        warnings: &mut Vec<String>,
    ) -> Result<Materials, SceneError> {
        let mut used: BTreeMap<Option<usize>, f32> = BTreeMap::new();
        for primitive in &draws.primitives {
            let least = primitive.colors.iter().map(|c| c.w).fold(1.0, f32::min);
            let known = used.entry(primitive.material).or_insert(1.0);
            *known = known.min(least);
        }
        if used.contains_key(&None) {
            warnings.push(
                "some meshes have no material; glTF's default is a white metal, which reflects no diffuse light"
                    .to_owned(),
            );
        }
        let mut notes = Notes::default();
        let mut materials = Materials { materials: Vec::new(), indices: BTreeMap::new() };
        for (&index, &least_vertex_alpha) in &used {
            let material = match index {
                None => read(document, &Definition::default(), "default material", textures, &mut notes)?,
                Some(number) => {
                    let Some(definition) = document.materials.get(number) else {
                        let place = draws.primitives.iter().find(|p| p.material == index).map_or("", |p| &p.place);
                        let what = format!("material {number} does not exist");
                        return Err(document.invalid(place, what, RE_EXPORT));
                    };
                    let place = label("material", number, definition.name.as_deref());
                    read(document, definition, &place, textures, &mut notes)?
                }
            };
            let alpha_mode = simplest_alpha(&material, least_vertex_alpha, textures);
            materials.indices.insert(index, MaterialIndex(materials.materials.len() as u32));
            materials.materials.push(Material { alpha_mode, ..material });
        }
        notes.report(warnings);
        Ok(materials)
    }
}

/// For each change that the loader made to materials, the names of those materials.
#[derive(Default)]
struct Notes(BTreeMap<&'static str, BTreeSet<String>>);

impl Notes {
    fn add(&mut self, what: &'static str, material: &str) {
        self.0.entry(what).or_default().insert(material.to_owned());
    }

    fn report(self, warnings: &mut Vec<String>) {
        const NAMED: usize = 3;
        for (what, materials) in self.0 {
            let named: Vec<_> = materials.iter().take(NAMED).map(String::as_str).collect();
            let more = materials.len() - named.len();
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            warnings.push(format!("{what}: {}{more}", named.join(", ")));
        }
    }
}

fn read(
    document: &Document,
    definition: &Definition,
    place: &str,
    textures: &mut Textures,
    notes: &mut Notes,
) -> Result<Material, SceneError> {
    let mut load = |slot: Option<Slot>, srgb: bool, name: &str| -> Result<Option<TextureRef>, SceneError> {
        slot.map(|slot| slot.load(document, textures, srgb, &format!("{place} {name}"))).transpose()
    };
    let others = definition.extensions.as_ref().map(|e| &e.others);
    for (extension, note) in UNMODELLED {
        if others.is_some_and(|others| others.contains_key(*extension)) {
            notes.add(note, place);
        }
    }
    let base = BaseLayer::read(document, definition, place, notes)?;
    let BaseLayer { color, metallic, roughness, .. } = base;
    let strength = definition.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
    let emission = Vec3::from_array(definition.emissive_factor.0) * strength.map_or(1.0, |s| s.emissive_strength.0);
    let normal = definition.normal_texture.as_ref();
    let normal_scale = normal.map_or(1.0, |n| n.scale);
    let cutoff = definition.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
    let factors = [metallic, roughness, normal_scale, cutoff];
    if !(color.is_finite() && emission.is_finite() && factors.iter().all(|f| f.is_finite())) {
        return Err(document.invalid(place, "one of its factors is not finite", "correct the material"));
    }
    let in_range = |x: f32| (0.0..=1.0).contains(&x);
    if !(color.to_array().into_iter().chain([metallic, roughness]).all(in_range) && emission.min_element() >= 0.0) {
        notes.add("factors outside their range are clamped to it", place);
    }
    let emission = emission.max(Vec3::ZERO);
    // A texture whose factor is zero is never looked up, so it need not exist.
    let emission_slot = definition.emissive_texture.as_ref().filter(|_| emission != Vec3::ZERO).map(Slot::from);
    let normal_slot = normal.map(|n| Slot::from_normal(document, n, place)).transpose()?;
    let alpha_mode = alpha_mode(document, definition, cutoff, place)?;
    Ok(Material {
        name: definition.name.as_deref().map_or_else(|| place.to_owned(), short),
        base_color: color.clamp(Vec4::ZERO, Vec4::ONE),
        base_color_texture: load(base.color_slot, true, "baseColorTexture")?,
        metallic: metallic.clamp(0.0, 1.0),
        roughness: roughness.clamp(0.0, 1.0),
        metallic_roughness_texture: load(base.metallic_roughness_slot, false, "metallicRoughnessTexture")?,
        emission,
        emission_texture: load(emission_slot, true, "emissiveTexture")?,
        normal_texture: load(normal_slot, false, "normalTexture")?,
        normal_scale,
        alpha_mode,
        double_sided: definition.double_sided,
        unlit: definition.extensions.as_ref().is_some_and(|e| e.unlit.is_some()),
    })
}

/// Base colour, metalness and roughness of a material, as they stand in the file.
struct BaseLayer {
    color: Vec4,
    color_slot: Option<Slot>,
    metallic: f32,
    roughness: f32,
    metallic_roughness_slot: Option<Slot>,
}

impl BaseLayer {
    /// `KHR_materials_pbrSpecularGlossiness` replaces the metallic-roughness parameters if a material has it.
    fn read(
        document: &Document,
        definition: &Definition,
        place: &str,
        notes: &mut Notes,
    ) -> Result<BaseLayer, SceneError> {
        let others = definition.extensions.as_ref().map(|e| &e.others);
        if let Some(glossiness) = others.and_then(|others| others.get("KHR_materials_pbrSpecularGlossiness")) {
            notes.add("KHR_materials_pbrSpecularGlossiness is read as diffuse colour and roughness alone", place);
            return Ok(BaseLayer {
                color: Vec4::from_array(numbers(glossiness, "diffuseFactor").unwrap_or([1.0; 4])),
                color_slot: slot(document, glossiness, "diffuseTexture", place)?,
                metallic: 0.0,
                roughness: 1.0 - numbers::<1>(glossiness, "glossinessFactor").map_or(1.0, |[g]| g),
                metallic_roughness_slot: None,
            });
        }
        let pbr = &definition.pbr_metallic_roughness;
        Ok(BaseLayer {
            color: Vec4::from_array(pbr.base_color_factor.0),
            color_slot: pbr.base_color_texture.as_ref().map(Slot::from),
            metallic: pbr.metallic_factor.0,
            roughness: pbr.roughness_factor.0,
            metallic_roughness_slot: pbr.metallic_roughness_texture.as_ref().map(Slot::from),
        })
    }
}

fn alpha_mode(document: &Document, definition: &Definition, cutoff: f32, place: &str) -> Result<AlphaMode, SceneError> {
    match definition.alpha_mode {
        Checked::Valid(DefinedAlpha::Opaque) => Ok(AlphaMode::Opaque),
        Checked::Valid(DefinedAlpha::Mask) => Ok(AlphaMode::Mask { cutoff }),
        Checked::Valid(DefinedAlpha::Blend) => Ok(AlphaMode::Blend),
        Checked::Invalid => Err(document.invalid(place, "glTF does not define its alphaMode", RE_EXPORT)),
    }
}

/// Extensions that let light pass through a material, which is not modelled; each with its warning.
const UNMODELLED: &[(&str, &str)] = &[
    ("KHR_materials_transmission", "KHR_materials_transmission is not modelled; no light passes these materials"),
    (
        "KHR_materials_diffuse_transmission",
        "KHR_materials_diffuse_transmission is not modelled; no light passes these materials",
    ),
];

/// The `N` numbers under `key`. They are a list, or for N = 1 a single number.
fn numbers<const N: usize>(object: &Value, key: &str) -> Option<[f32; N]> {
    let value = object.get(key)?;
    let mut out = [0.0; N];
    match value.as_array() {
        Some(list) if list.len() == N => {
            for (out, value) in out.iter_mut().zip(list) {
                *out = value.as_f64()? as f32;
            }
        }
        None if N == 1 => out[0] = value.as_f64()? as f32,
        _ => return None,
    }
    Some(out)
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
