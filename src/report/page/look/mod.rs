//! The page to look at a bake: the scene's triangles and its probes in three dimensions, lit by the look-up itself.
//!
//! Surfaces ask the probes in a shader, by the text that `probe/query` keeps for engines. What a shader cannot find out, what a
//! place sees by exact rays, is traced here at texels ([`crate::shade::texels`]).

mod blocks;
mod figures;
mod mesh;

use std::f32::consts::PI;

use glam::Vec3;
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use self::blocks::Block;
pub use self::figures::{Figures, leaks};
pub use self::mesh::{MOST_TRIANGLES, Shown};
use super::data::PageError;
use super::visible::visible;
use super::{THEME, view};
use crate::export::bevy::rgb9e5;
use crate::math::color::luminance;
use crate::probe::query::{LOOK_UP, Query, Shader};
use crate::probe::store::textures::{Bound, Numbers, Texture};
use crate::report::heatmap::range_of;
use crate::scene::camera::Projection;
use crate::scene::{Camera, Scene};
use crate::shade::spheres::{INSIDE_COLOR, RADIUS, RIM_COLOR, UNSAMPLED_COLOR};
use crate::shade::texels::{Charts, NUDGE, Texel};

const SCRIPTS: [&str; 6] = [
    include_str!("../../assets/page/codec.js"),
    THEME,
    include_str!("../../assets/page/look/data.js"),
    include_str!("../../assets/page/look/camera.js"),
    include_str!("../../assets/page/look/draw.js"),
    include_str!("../../assets/page/look/look.js"),
];
const STYLE: &str = include_str!("../../assets/page/look/look.css");
const SURFACE: &str = include_str!("../../assets/page/look/surface.glsl");
const STAND_IN: &str = include_str!("../../assets/page/look/standin.glsl");
const SPHERES: &str = include_str!("../../assets/page/look/spheres.glsl");

/// Most bytes of the textures of a look-up, as they are in memory there. What has more is shown as the tool looked it up.
const MOST_TEXTURE_BYTES: usize = 16 << 20;

/// What a page is of.
pub struct Look<'a> {
    pub scene: &'a Scene,
    pub query: &'a Query<'a>,
    pub cameras: &'a [Camera],
    pub charts: &'a Charts,
    pub texels: &'a [Texel],
    pub exposure_ev: f32,
    /// Names and values of the table of figures.
    pub figures: &'a [(String, String)],
    /// Sentences about what is not as it should be.
    pub notes: Vec<String>,
}

/// What the scripts read, beside the blocks.
#[derive(Serialize)]
struct Data<'a> {
    blocks: &'a [Block],
    quantised: mesh::Quantised,
    /// Adds up to world space.
    origin_world: [f64; 3],
    texel_m: f64,
    nudge_m: f32,
    exposure_ev: f32,
    /// Ends of the leak maps without visibility and with it, W·m⁻².
    ranges: [f32; 2],
    grid_origin: [f32; 3],
    grid_spacing: [f32; 3],
    grid_points: [u32; 3],
    probes: usize,
    radius_m: f32,
    header: String,
    is_baked: bool,
    colors: Colors,
    states: Vec<u8>,
    cameras: Vec<View>,
}

#[derive(Serialize)]
struct Colors {
    inside: [u8; 3],
    unsampled: [u8; 3],
    rim: [u8; 3],
}

#[derive(Serialize)]
struct View {
    name: String,
    position: [f32; 3],
    forward: [f32; 3],
    fov_y_rad: f32,
}

/// The page as HTML.
///
/// # Errors
/// None in practice: the templates are part of the program.
pub fn render(look: Look) -> Result<String, PageError> {
    let Look { scene, query, charts, texels, .. } = look;
    let grid = &query.volume.grid;
    let (mut blocks, quantised) = mesh::blocks(scene, charts)?;
    let mut notes = look.notes;
    let shader = shader(query);
    if let Err(what) = &shader {
        notes.push(format!(
            "The page's own look-up does not do {what}: surfaces show what lightprobe looked up at texels of {:.3} m, \
             and points have no list of probes.",
            charts.side_m
        ));
    }
    let is_baked = shader.is_err();
    let (header, bound) = match shader {
        Ok(shader) => (shader.header(), shader.bound),
        Err(_) => (String::from("#define BAKED 1\n"), baked(query)),
    };
    for texture in &bound.textures {
        blocks.push(Block::texture(texture)?);
    }
    blocks.extend(texel_blocks(texels, is_baked)?);
    let view = |camera: &Camera| View {
        name: visible(&camera.name),
        position: camera.position.to_array(),
        forward: (-camera.world_from_camera.z_axis).to_array(),
        fov_y_rad: match camera.projection {
            Projection::Perspective { fov_y_rad } => fov_y_rad,
            // The page has no parallel rays.
            Projection::Orthographic { .. } => PI / 3.0,
        },
    };
    let data = Data {
        blocks: &blocks,
        quantised,
        origin_world: scene.origin_world.to_array(),
        texel_m: charts.side_m,
        nudge_m: NUDGE * grid.spacing_min(),
        exposure_ev: look.exposure_ev,
        ranges: [0, 1].map(|mode| range_of(&differences(texels, mode))),
        grid_origin: grid.origin().to_array(),
        grid_spacing: grid.spacing().to_array(),
        grid_points: grid.divisions().to_array(),
        probes: query.volume.states.len(),
        radius_m: RADIUS * grid.spacing_min(),
        header,
        is_baked,
        colors: Colors { inside: INSIDE_COLOR, unsampled: UNSAMPLED_COLOR, rim: RIM_COLOR },
        states: query.volume.states.iter().map(|&state| state as u8).collect(),
        cameras: look.cameras.iter().map(view).collect(),
    };
    // No name from outside may end the element that it stands in.
    let json = serde_json::to_string(&data).map_err(std::io::Error::from)?.replace('<', "\\u003c");
    let view = context! {
        title => scene.name.as_str(),
        version => env!("CARGO_PKG_VERSION"),
        json,
        colors => view::colors(),
        blocks => blocks.iter().map(|b| context! { name => b.name.as_str(), text => b.text.as_str() }).collect::<Vec<_>>(),
        glsl => context! { look_up => if is_baked { STAND_IN } else { LOOK_UP }, surface => SURFACE, spheres => SPHERES },
        figures => Serde(look.figures),
        notes,
        texel => format!("{:.1}", 100.0 * charts.side_m),
        is_baked,
    };
    super::document("look.html", &view, STYLE, &SCRIPTS)
}

/// The look-up in a shader, where it has one that a page can hold.
fn shader(query: &Query) -> Result<Shader, String> {
    let shader = Shader::new(query)?;
    let bytes = shader.bound.bytes();
    match bytes <= MOST_TEXTURE_BYTES {
        true => Ok(shader),
        false => Err(format!("probes of {} in all", crate::system::format::bytes(bytes as u64))),
    }
}

/// What shows probes where the page cannot ask them: places, and irradiance along +x, −x, +y, −y, +z, −z.
fn baked(query: &Query) -> Bound {
    let of = |p: usize| Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).map(move |axis| (p, axis));
    let numbers = (0..query.volume.states.len()).flat_map(of);
    let light = |(p, axis)| query.volume.irradiance.of(p, axis).to_array();
    let numbers = Numbers::F32(numbers.flat_map(light).collect());
    let light = Texture { name: "light", channels: 3, numbers };
    Bound { defines: Vec::new(), textures: vec![query.places(), light] }
}

/// Albedo, mask, own light and, where that is needed, looked-up light of texels.
fn texel_blocks(texels: &[Texel], with_light: bool) -> std::io::Result<Vec<Block>> {
    let albedo =
        |texel: &Texel, channel: usize| (255.0 * texel.albedo[channel].max(0.0).sqrt()).round().min(255.0) as u32;
    let mut numbers: Vec<u32> = Vec::with_capacity(4 * texels.len());
    for channel in 0..3 {
        numbers.extend(texels.iter().map(|texel| albedo(texel, channel)));
    }
    numbers.extend(texels.iter().map(|texel| u32::from(texel.mask)));
    let light = |name, of: &dyn Fn(&Texel) -> Vec3| {
        Block::new(name, 4, true, &texels.iter().map(|texel| rgb9e5(of(texel))).collect::<Vec<_>>())
    };
    let mut blocks = vec![Block::new("texels", 1, false, &numbers)?, light("own", &|texel| texel.own)?];
    if with_light {
        for (mode, name) in ["lit0", "lit1", "lit2"].into_iter().enumerate() {
            blocks.push(light(name, &|texel| texel.irradiance[mode])?);
        }
    }
    Ok(blocks)
}

/// Luminance of a mode's irradiance minus the exact one, where any probe is seen.
fn differences(texels: &[Texel], mode: usize) -> Vec<f32> {
    let seen = texels.iter().filter(|texel| texel.mask != 0);
    seen.map(|texel| luminance(texel.irradiance[mode]) - luminance(texel.irradiance[2])).collect()
}
