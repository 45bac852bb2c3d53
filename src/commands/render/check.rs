//! What can be said before a picture is made: that it cannot be written, will not fit, or shows nothing.

use std::path::Path;

use anyhow::{Context, Result};

use crate::cli::{PictureSize, RenderArgs};
use crate::commands::{Console, check_picture_memory};
use crate::export::Target;
use crate::light::World;
use crate::scene::Camera;
use crate::shade::outlook::Outlook;
use crate::shade::points::has_blend;
use crate::system::output::{Named, check_apart, check_folder, check_outputs};

/// Memory that a render takes at its peak, per pixel and per point in the picture: the slope of peak memory over the
/// number of pixels, which is 579 B where there is only sky and 758 B where each pixel shows one point, rounded up.
const PIXEL_BYTES: f64 = 600.0;
const POINT_BYTES: f64 = 200.0;
/// Points beyond the first of a pixel stand in lists that grow by doubling.
const FURTHER_POINT_BYTES: f64 = 700.0;

/// What a traced reference takes besides: 718 B without variances, 857 B with them, rounded up.
const REFERENCE_PIXEL_BYTES: f64 = 900.0;
/// The same with translucent surfaces, where all layers are accumulated: 1583 B, rounded up.
const LAYERED_REFERENCE_PIXEL_BYTES: f64 = 1700.0;

/// Files that a camera's folder gets.
const PICTURES: &[&str] = &[
    "visibility_off.exr",
    "visibility_off.png",
    "visibility_on.exr",
    "visibility_on.png",
    "visibility_ray.exr",
    "visibility_ray.png",
    "glossy.png",
    "leak.exr",
    "leak.png",
    "probes.png",
    REPORT,
];

/// All figures. Last to be written.
pub const REPORT: &str = "report.json";

/// Those that it gets besides where there is a reference.
const COMPARISONS: &[&str] = &["error_off.exr", "error_off.png", "error_on.exr", "error_on.png", "reference.png"];

/// Pictures of engines' look-ups.
const OF_ENGINES: &[Target] = &[Target::Three, Target::Bevy, Target::Ddgi];

/// A reference that is there may stay in its place: it is copied onto itself.
const REFERENCE: &str = "reference.exr";

/// All that a camera's folder will hold.
pub fn pictures(args: &RenderArgs, folder: &Path) -> Vec<Named> {
    let compared = args.reference.is_some() || args.reference_image.is_some();
    let comparisons = COMPARISONS.iter().chain([&REFERENCE]).filter(|_| compared);
    let of_engine = args.engine.iter().flat_map(|engine| {
        let name = Target::from(*engine).method();
        ["exr", "png"].map(|extension| Named::new("-o", folder.join(format!("{name}.{extension}"))))
    });
    let own = PICTURES.iter().chain(comparisons).map(|name| Named::new("-o", folder.join(name)));
    own.chain(of_engine).collect()
}

/// Removes what an earlier render left in the folder and this one does not replace: a reference and maps of errors beside
/// pictures that they are not of. Folders that no render wrote are left alone.
pub fn remove_stale(args: &RenderArgs, folder: &Path) -> Result<()> {
    let report = folder.join(REPORT);
    let is_ours = std::fs::read_to_string(&report).is_ok_and(|text| {
        let report: Result<serde_json::Value, _> = serde_json::from_str(&text);
        report.is_ok_and(|report| report["command"] == "render")
    });
    if !is_ours {
        return Ok(());
    }
    let of_engines =
        OF_ENGINES.iter().flat_map(|engine| ["exr", "png"].map(|kind| format!("{}.{kind}", engine.method())));
    let all = COMPARISONS.iter().chain([&REFERENCE]).map(|name| (*name).to_owned()).chain(of_engines);
    let new = pictures(args, folder);
    // The report goes first: without it the folder is no result.
    let stale = all.map(|name| folder.join(name)).filter(|path| new.iter().all(|picture| picture.path != *path));
    for path in [report].into_iter().chain(stale) {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("cannot remove {} of an earlier render", path.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Refuses a folder in which not all pictures can be written, before any is made.
pub fn check_pictures(args: &RenderArgs, folder: &Path, inputs: &[Named]) -> Result<()> {
    check_folder(folder)?;
    // In a folder that is not there nothing is in the way.
    if !folder.is_dir() {
        return Ok(());
    }
    let mut pictures = pictures(args, folder);
    check_outputs(&pictures, inputs)?;
    pictures.retain(|picture| !picture.path.ends_with(REFERENCE));
    let reference = args.reference_image.as_ref().map(|file| Named::new("the reference", file));
    Ok(check_apart(&pictures, reference.as_slice())?)
}

/// Warns of cameras that show nothing of use, and refuses pictures that do not fit into memory.
pub fn check_view(args: &RenderArgs, world: &World, camera: &Camera, console: &Console) -> Result<()> {
    let PictureSize { width, height } = args.view.size;
    let outlook = Outlook::new(world, camera, width, height, args.trace.seed);
    if let Some(warning) = outlook.warning() {
        console.warn(format!("camera {}: {warning}", camera.name));
    }
    let points = f64::from(outlook.points_per_pixel);
    let of_points = points.min(1.0) * POINT_BYTES + (points - 1.0).max(0.0) * FURTHER_POINT_BYTES;
    let of_reference = match args.reference {
        None => 0.0,
        Some(_) if has_blend(world) => LAYERED_REFERENCE_PIXEL_BYTES * points.max(1.0),
        Some(_) => REFERENCE_PIXEL_BYTES,
    };
    Ok(check_picture_memory(args.view.size, PIXEL_BYTES + of_points + of_reference)?)
}
