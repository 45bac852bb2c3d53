//! One material: its factors, checked and clamped, and those of its texture slots that a command looks at.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Vec3, Vec4};
use gltf::json::Material as Definition;
use gltf::json::material::AlphaMode as DefinedAlpha;
use gltf::json::validation::Checked;
use serde_json::Value;

use super::document::Document;
use super::text::{label, short};
use super::texture_slot::{Slot, slot};
use crate::scene::error::{RE_EXPORT, SceneError};
use crate::scene::light::LIGHT_MAX;
use crate::scene::{AlphaMode, Detail, Material, TextureRef, Unassigned};

/// A texture slot of a material.
#[derive(Clone, Copy)]
pub(super) struct Of {
    /// Its key in glTF.
    pub name: &'static str,
    pub srgb: bool,
    pub field: fn(&mut Material) -> &mut Option<TextureRef>,
    /// Whether no diffuse light depends on it.
    pub for_pictures: bool,
}

impl Of {
    const BASE_COLOR: Of =
        Of { name: "baseColorTexture", srgb: true, field: |m| &mut m.base_color_texture, for_pictures: false };
    const METALLIC_ROUGHNESS: Of = Of {
        name: "metallicRoughnessTexture",
        srgb: false,
        field: |m| &mut m.metallic_roughness_texture,
        for_pictures: false,
    };
    const EMISSION: Of =
        Of { name: "emissiveTexture", srgb: true, field: |m| &mut m.emission_texture, for_pictures: false };
    const NORMAL: Of = Of { name: "normalTexture", srgb: false, field: |m| &mut m.normal_texture, for_pictures: true };
}

/// A material without its textures, and the slots of those that are looked at.
pub(super) struct Read {
    pub material: Material,
    /// Its text in messages.
    pub place: String,
    pub wanted: Vec<(Of, Slot)>,
}

impl Read {
    pub fn unassigned(unassigned: Unassigned) -> Read {
        let (albedo, metallic) = match unassigned {
            Unassigned::Diffuse { albedo } => (albedo, 0.0),
            Unassigned::Gltf => (1.0, 1.0),
        };
        let place = "no material".to_owned();
        let material = Material {
            name: place.clone(),
            base_color: Vec3::splat(albedo).extend(1.0),
            base_color_texture: None,
            metallic,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
        };
        Read { material, place, wanted: Vec::new() }
    }

    /// Reads material `number`, whose JSON is `value`. Slots that are not looked at are not even parsed.
    pub fn new(
        document: &Document,
        number: usize,
        value: &Value,
        detail: Detail,
        notes: &mut Notes,
    ) -> Result<Read, SceneError> {
        let definition: Definition =
            document.parse_element(&document.materials, number, &without_textures(value.clone()))?;
        let place = label("material", number, definition.name.as_deref());
        let extensions = definition.extensions.as_ref();
        for (extension, note) in UNMODELLED {
            if extensions.is_some_and(|e| e.others.contains_key(*extension)) {
                notes.add(note, &place);
            }
        }
        let base = BaseLayer::read(&definition, value, &place, notes);
        let normal = value.get("normalTexture").filter(|_| detail.normal_maps);
        let normal = normal.map(|normal| Slot::of_normal(document, normal, &place)).transpose()?;
        let material = Material {
            normal_scale: normal.as_ref().map_or(1.0, |(_, scale)| *scale),
            ..without_slots(document, &definition, &base, &place, notes)?
        };
        let mut wanted = Vec::new();
        let mut want = |of: Of, object: &Value, key: &str, [light, pictures]: [bool; 2]| -> Result<(), SceneError> {
            if light || pictures {
                let slot = slot(document, object, key, &place)?;
                wanted.extend(slot.map(|slot| (Of { for_pictures: !light, ..of }, slot)));
            }
            Ok(())
        };
        let Material { metallic, unlit, emission, .. } = material;
        let has_color = material.base_color.truncate() != Vec3::ZERO;
        // A metal without a texture of metalness reflects no diffuse light, whatever its colour.
        let shows_color = has_color && (unlit || metallic < 1.0 || base.has_metallic_texture());
        let base_color = [shows_color || material.alpha_mode != AlphaMode::Opaque, has_color && detail.gloss];
        want(Of::BASE_COLOR, base.object, base.color_key, base_color)?;
        let metallic = [has_color && metallic > 0.0, detail.gloss].map(|wanted| wanted && !unlit);
        if let Some(key) = base.metallic_roughness_key {
            want(Of::METALLIC_ROUGHNESS, base.object, key, metallic)?;
        }
        want(Of::EMISSION, value, "emissiveTexture", [emission != Vec3::ZERO && !unlit, false])?;
        wanted.extend(normal.map(|(slot, _)| (Of::NORMAL, slot)));
        Ok(Read { material, place, wanted })
    }
}

/// The JSON of a material without its texture slots, which are parsed one by one.
fn without_textures(mut material: Value) -> Value {
    let remove = |object: Option<&mut Value>, keys: &[&str]| {
        if let Some(Value::Object(object)) = object {
            keys.iter().for_each(|key| drop(object.remove(*key)));
        }
    };
    remove(Some(&mut material), &["normalTexture", "occlusionTexture", "emissiveTexture"]);
    remove(material.get_mut("pbrMetallicRoughness"), &["baseColorTexture", "metallicRoughnessTexture"]);
    material
}

/// The note about emission above [`LIGHT_MAX`].
pub(super) const BRIGHT: &str = "emission beyond 1e30 is clamped to that";

/// A material's factors, checked and clamped to their ranges.
fn without_slots(
    document: &Document,
    definition: &Definition,
    base: &BaseLayer,
    place: &str,
    notes: &mut Notes,
) -> Result<Material, SceneError> {
    let BaseLayer { color, metallic, roughness, .. } = *base;
    let extensions = definition.extensions.as_ref();
    let strength = extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |s| s.emissive_strength.0);
    let emissive = Vec3::from_array(definition.emissive_factor.0);
    let cutoff = definition.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
    let finite = [
        ("base color factor", color.is_finite()),
        ("metallicFactor", metallic.is_finite()),
        ("roughness factor", roughness.is_finite()),
        ("emissiveFactor", emissive.is_finite()),
        ("emissiveStrength", strength.is_finite()),
        ("alphaCutoff", cutoff.is_finite()),
    ];
    if let Some((name, _)) = finite.iter().find(|(_, is_finite)| !is_finite) {
        return Err(document.invalid(place, format!("its {name} is not finite"), "correct the material"));
    }
    let in_range = |x: f32| (0.0..=1.0).contains(&x);
    let is_emission_valid = emissive.min_element() >= 0.0 && strength >= 0.0;
    if !(color.to_array().into_iter().chain([metallic, roughness]).all(in_range) && is_emission_valid) {
        notes.add("factors outside their range are clamped to it", place);
    }
    // Each factor by itself: the product of two negative ones would be light.
    let emission = emissive.max(Vec3::ZERO) * strength.max(0.0);
    if emission.max_element() > LIGHT_MAX {
        notes.add(BRIGHT, place);
    }
    Ok(Material {
        name: definition.name.as_deref().map_or_else(|| place.to_owned(), short),
        base_color: color.clamp(Vec4::ZERO, Vec4::ONE),
        base_color_texture: None,
        metallic: metallic.clamp(0.0, 1.0),
        roughness: roughness.clamp(0.0, 1.0),
        metallic_roughness_texture: None,
        emission: emission.min(Vec3::splat(LIGHT_MAX)),
        emission_texture: None,
        normal_texture: None,
        normal_scale: 1.0,
        alpha_mode: alpha_mode(document, definition, cutoff, place)?,
        double_sided: definition.double_sided,
        unlit: extensions.is_some_and(|e| e.unlit.is_some()),
    })
}

/// For each change that the loader made to materials, the names of those materials.
#[derive(Default)]
pub(super) struct Notes(BTreeMap<&'static str, BTreeSet<String>>);

impl Notes {
    fn add(&mut self, what: &'static str, material: &str) {
        self.0.entry(what).or_default().insert(material.to_owned());
    }

    /// Number of materials that were changed in this way.
    pub fn count(&self, what: &str) -> u64 {
        self.0.get(what).map_or(0, |materials| materials.len() as u64)
    }

    pub fn report(self, warnings: &mut Vec<String>) {
        const NAMED: usize = 3;
        for (what, materials) in self.0 {
            let named: Vec<_> = materials.iter().take(NAMED).map(String::as_str).collect();
            let more = materials.len() - named.len();
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            warnings.push(format!("{what}: {}{more}", named.join(", ")));
        }
    }
}

/// Base colour, metalness and roughness of a material, as they stand in the file.
struct BaseLayer<'v> {
    color: Vec4,
    metallic: f32,
    roughness: f32,
    /// The JSON in which the texture slots stand, and their keys.
    object: &'v Value,
    color_key: &'static str,
    metallic_roughness_key: Option<&'static str>,
}

impl<'v> BaseLayer<'v> {
    /// `KHR_materials_pbrSpecularGlossiness` replaces the metallic-roughness parameters if a material has it.
    fn read(definition: &Definition, value: &'v Value, place: &str, notes: &mut Notes) -> BaseLayer<'v> {
        const GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";
        if let Some(glossiness) = value.get("extensions").and_then(|e| e.get(GLOSSINESS)) {
            notes.add("KHR_materials_pbrSpecularGlossiness is read as diffuse colour and roughness alone", place);
            return BaseLayer {
                color: Vec4::from_array(numbers(glossiness, "diffuseFactor").unwrap_or([1.0; 4])),
                metallic: 0.0,
                roughness: 1.0 - numbers::<1>(glossiness, "glossinessFactor").map_or(1.0, |[g]| g),
                object: glossiness,
                color_key: "diffuseTexture",
                metallic_roughness_key: None,
            };
        }
        let pbr = &definition.pbr_metallic_roughness;
        BaseLayer {
            color: Vec4::from_array(pbr.base_color_factor.0),
            metallic: pbr.metallic_factor.0,
            roughness: pbr.roughness_factor.0,
            object: value.get("pbrMetallicRoughness").unwrap_or(&Value::Null),
            color_key: "baseColorTexture",
            metallic_roughness_key: Some("metallicRoughnessTexture"),
        }
    }

    fn has_metallic_texture(&self) -> bool {
        self.metallic_roughness_key.is_some_and(|key| self.object.get(key).is_some())
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
