//! Which cameras were meant.

use anyhow::{Context, Result};
use glam::{DVec3, Vec3};

use super::Console;
use crate::cli::{LookAt, ViewArgs};
use crate::light::World;
use crate::scene::Camera;
use crate::shade::framing::frame;

/// The cameras that the arguments ask for.
pub fn cameras(args: &ViewArgs, world: &World, console: &Console) -> Result<Vec<Camera>> {
    let scene = world.scene;
    if let Some(LookAt { origin, target, fov_y_deg }) = args.look_at {
        let local = |p: [f64; 3]| (DVec3::from(p) - scene.origin_world).as_vec3();
        return Ok(vec![Camera::look_at("look-at", local(origin), local(target), fov_y_deg.to_radians())]);
    }
    let known = || scene.cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    match args.camera.as_deref() {
        Some(name) if !scene.cameras.is_empty() || (name != "all" && name != "0") => {
            if name == "all" {
                return Ok(scene.cameras.clone());
            }
            let by_index = || name.parse::<usize>().ok().and_then(|i| scene.cameras.get(i));
            let camera = scene.cameras.iter().find(|c| c.name == name).or_else(by_index);
            let camera = camera.with_context(|| match scene.cameras.len() {
                0 => format!("--camera {name}: the scene has no cameras; leave it out or use --look-at"),
                n => format!("--camera {name}: the scene has the cameras {} (numbers 0 to {})", known(), n - 1),
            })?;
            Ok(vec![camera.clone()])
        }
        _ => Ok(vec![match scene.cameras.first() {
            Some(camera) => camera.clone(),
            None => {
                let bounds = scene.mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
                let (camera, inside) = frame(world, bounds, args.size.width as f32 / args.size.height as f32);
                let from = if inside { "from inside" } else { "from outside" };
                console.warn(format!("the scene has no camera: framed it {from}; use --look-at for another view"));
                camera
            }
        }]),
    }
}
