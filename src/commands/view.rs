//! `lightprobe view`: scene + probes → a page to look at the bake.

use std::io::Write;
use std::time::Instant;

use anyhow::{Result, ensure};
use glam::Vec3;
use serde_json::json;

use super::session::{Opening, Probes, Session};
use super::{Console, kinds, tell};
use crate::cli::LookArgs;
use crate::image::Picture;
use crate::light::World;
use crate::probe::file::{self, ProbeFile};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Query, Visibility};
use crate::report::page::look::{self, Figures, Look, MOST_TRIANGLES, Shown, leaks};
use crate::scene::{Camera, Detail};
use crate::shade::framing::{USUAL_ASPECT, frame};
use crate::shade::layers::beauty;
use crate::shade::points::see;
use crate::shade::texels::{self, Charts};
use crate::system::format;
use crate::system::output::{Named, write_atomically};

pub fn run(args: &LookArgs, console: &Console) -> Result<()> {
    let usage = "view SCENE PROBES -o FILE.html";
    kinds::expect_scene(&args.scene, usage)?;
    kinds::expect_probes(&args.probes, usage)?;
    let probes = file::read(&args.probes)?;
    let session = Session::open(opening(args, &probes), console)?;
    let scene = &session.scene;
    ensure!(
        !scene.mesh.triangles.is_empty(),
        "{}: the scene has no triangles to show; give one with a mesh",
        args.scene.display()
    );
    let (world, _) = session.world()?;
    tell::probes(console, &args.probes, &probes);
    let volume = probes.volume_as_planned(scene.origin_world);
    let query = Query { volume: &volume, settings: &probes.query.weights };
    let shown = Shown::of(scene);
    let charts = Charts::new(scene, &shown.triangles, &volume.grid);
    let started = Instant::now();
    let texels = texels::light(&world, &query, &charts, session.seed);
    let texels_s = started.elapsed().as_secs_f64();
    let leaks = leaks(&texels);
    let cameras = cameras(&world);
    let exposure_ev = args.exposure.unwrap_or_else(|| exposure(&world, &query, &cameras[0], session.seed));
    let left_out = (shown.left_out > 0).then(|| {
        format!(
            "The page shows the largest {} triangles: {} smaller ones, {} of the area, are left out.",
            format::count(MOST_TRIANGLES as u64),
            format::count(shown.left_out as u64),
            format::percent(shown.left_out_area)
        )
    });
    left_out.iter().for_each(|note| console.warn(note));
    const CHANGED: &str = "The scene is not the one of the bake: its files or its sky have changed since.";
    let changed = session.scene_changed.then(|| CHANGED.to_owned());
    let notes = left_out.into_iter().chain(changed).collect();
    let html = look::render(Look {
        scene,
        query: &query,
        cameras: &cameras,
        charts: &charts,
        texels: &texels,
        exposure_ev,
        figures: &figures(&session, &probes, &query, (&shown, &charts), &leaks),
        notes,
    })?;
    write_atomically(&args.output, |file| file.write_all(html.as_bytes()))?;
    let report = json!({
        "schema": "lightprobe-view/1",
        "bytes": html.len(),
        "triangles": shown.triangles.len(),
        "triangles_left_out": shown.left_out,
        "texels": charts.count,
        "texel_m": charts.side_m,
        "exposure_ev": exposure_ev,
        "leak": { "visibility_off": leaks[0], "visibility_on": leaks[1] },
        "time_s": { "load": session.load_s, "texels": texels_s, "total": session.elapsed_s() },
    });
    session.print(&report, || {
        format!(
            "{} and {} of {:.1} cm in {} · leak of light {} without visibility, {} with\nwrote {}, {}",
            format::counted(shown.triangles.len() as u64, "triangle", "triangles"),
            format::counted(charts.count as u64, "texel", "texels"),
            100.0 * charts.side_m,
            format::seconds(session.elapsed_s()),
            format::or_undefined(leaks[0].light, format::percent),
            format::or_undefined(leaks[1].light, format::percent),
            args.output.display(),
            format::bytes(html.len() as u64),
        )
    })
}

fn opening<'a>(args: &'a LookArgs, probes: &'a ProbeFile) -> Opening<'a> {
    Opening {
        scene: &args.scene,
        trace: &args.trace,
        light: probes.query.light,
        probes: Some(Probes::of(&args.probes, probes, args.allow_scene_change)),
        detail: Detail::LIGHT,
        keep_images: false,
        inputs: vec![Named::new("the probe file", &args.probes)],
        outputs: vec![Named::new("-o", &args.output)],
    }
}

/// The scene's cameras, or the one that pictures of a scene without any have.
fn cameras(world: &World) -> Vec<Camera> {
    let scene = world.scene;
    if !scene.cameras.is_empty() {
        return scene.cameras.clone();
    }
    vec![frame(world, scene.mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE)), USUAL_ASPECT).0]
}

/// The exposure that shows what a camera sees at mid grey, as pictures of `render` without a reference have it.
fn exposure(world: &World, query: &Query, camera: &Camera, seed: u64) -> f32 {
    // As coarse as a mean allows.
    const SIZE: (u32, u32) = (96, 54);
    let view = see(world, camera, SIZE.0, SIZE.1, seed);
    let pixels: Vec<Vec3> =
        view.points.iter().map(|point| beauty(point, query.irradiance(&point.query, Visibility::Stored))).collect();
    if pixels.is_empty() { 0.0 } else { Picture::from_pixels(pixels.len() as u32, 1, pixels).auto_exposure_ev() }
}

/// The page's table.
fn figures(
    session: &Session,
    probes: &ProbeFile,
    query: &Query,
    (shown, charts): (&Shown, &Charts),
    leaks: &[Figures; 2],
) -> Vec<(String, String)> {
    let volume = query.volume;
    let of_state = |state| format::count(volume.states.iter().filter(|&&s| s == state).count() as u64);
    let leak = |of: &Figures| {
        let [light, dark] = [of.light, of.dark].map(|share| format::or_undefined(share, format::percent));
        format!("light {light}, dark {dark}; {} of the area sees no probe", format::percent(of.unseen))
    };
    let rows = [
        ("Grid", volume.grid.describe()),
        ("Spacing", format!("{} m", volume.grid.spacing().to_array().map(|s| s.to_string()).join(" × "))),
        (
            "Probes",
            format!(
                "{} active, {} inside geometry, {} that nothing samples",
                of_state(ProbeState::Active),
                of_state(ProbeState::InsideGeometry),
                of_state(ProbeState::NeverSampled)
            ),
        ),
        ("Irradiance", volume.irradiance.describe()),
        ("Visibility", volume.occlusion.describe().into_owned()),
        ("Bytes per probe", format::bytes(probes.runtime_bytes() as u64)),
        (
            "Values",
            if probes.fit.is_some() { "fitted with visibility" } else { "as light is where probes stand" }.to_owned(),
        ),
        ("Triangles", format::count(shown.triangles.len() as u64)),
        ("Texels", format!("{} of {:.1} cm", format::count(charts.count as u64), 100.0 * charts.side_m)),
        ("Leaks over all surfaces, visibility off", leak(&leaks[0])),
        ("Leaks over all surfaces, visibility on", leak(&leaks[1])),
        ("Scene", format!("BLAKE3 {:.16} …", session.scene.blake3)),
    ];
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}
