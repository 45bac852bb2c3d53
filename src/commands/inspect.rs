//! `lightprobe inspect`: what a probe file holds.

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail, ensure};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::{Console, kinds, tell};
use crate::cli::{InspectArgs, TraceRay};
use crate::plan::stage_in_words;
use crate::probe::file::published::threev8_bytes;
use crate::probe::file::{self, FORMAT, ProbeFile};
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::tree::Tree;
use crate::probe::query::QuerySettings;
use crate::probe::query::march::Step;
use crate::probe::query::trace::{End, Tracing};
use crate::probe::store::tiles::TileStore;
use crate::probe::{ProbeIndex, Volume};
use crate::report::ray_path::{self, Paths};
use crate::report::table::{Column, Table};
use crate::system::format;
use crate::system::output::{Named, check_outputs};

/// Significant digits of irradiance; the finest format, f32, holds about seven.
const DIGITS: usize = 6;

pub fn run(args: &InspectArgs, console: &Console) -> Result<()> {
    kinds::expect_probes(&args.probes, "inspect PROBES")?;
    let started = Instant::now();
    let file = file::read(&args.probes)?;
    tell::probes(console, &args.probes, &file);
    console.say(format!("read and checked in {}", format::seconds(started.elapsed().as_secs_f64())));
    let volume = file.volume_in_grid();
    if let Some(probe) = args.probe {
        let count = volume.states.len();
        ensure!((probe as usize) < count, "--probe {probe}: {} holds probes 0 to {}", args.probes.display(), count - 1);
    }
    if let (Some(ray), Some(output)) = (&args.trace, &args.output) {
        return draw_ray(args, volume, &file.query.weights, ray, output, console);
    }
    if console.json {
        return console.print(&serde_json::to_string_pretty(&to_json(&file, args.probe))?);
    }
    console.print(&to_text(&file, args.probe))
}

/// Most probes whose maps are drawn.
const MOST_DRAWN: usize = 8;

/// Traces a ray in the probes, or in one of them, draws its way and says where it ends.
fn draw_ray(
    args: &InspectArgs,
    volume: &Volume,
    weights: &QuerySettings,
    ray: &TraceRay,
    output: &Path,
    console: &Console,
) -> Result<()> {
    let probes = args.probes.display();
    let settings = weights.glossy.traced().copied().unwrap_or_default();
    let field = volume.radiance.light_field.as_ref();
    let Some((tracing, field)) = Tracing::new(volume, &settings).zip(field) else {
        bail!(
            "--trace: {probes} holds no light fields that rays march through; bake with --preset mcguire-2017, or with \
             store.light_field march(lowest: n)"
        );
    };
    check_outputs(&[Named::new("-o", output)], &[Named::new("the probe file", &args.probes)])?;
    let origin = (DVec3::from(ray.origin) - volume.grid.origin_world()).as_vec3();
    let direction = DVec3::from(ray.direction).normalize().as_vec3();
    let mut paths = Paths::default();
    let end = match args.probe {
        Some(probe) => {
            paths.0.push(ray_path::Path { probe: probe as usize, ..Default::default() });
            match tracing.ask(ProbeIndex(probe), origin, direction, 0.0, &mut paths) {
                Step::Hit { t, .. } => format!("probe {probe} sees a surface at {t} m"),
                Step::Miss => format!("probe {probe} sees all of the ray and no surface"),
                Step::Unknown { clear } => format!("probe {probe} sees the ray up to {clear} m"),
            }
        }
        None => {
            let begin = |paths: &mut Paths, (probe, _): (ProbeIndex, f32)| {
                paths.0.push(ray_path::Path { probe: probe.0 as usize, ..Default::default() });
            };
            let traced = tracing.follow(origin, direction, &mut paths, begin);
            let end = match traced.end {
                End::Hit { t, probe, .. } => format!("a surface at {t} m, found by probe {}", probe.0),
                End::Miss { probe } => format!("no surface, as probe {} sees", probe.0),
                End::Lost { clear, .. } => format!("no probe sees on from {clear} m"),
            };
            format!("{end}; probes asked: {} in {} cell(s)", traced.probes, traced.cells)
        }
    };
    let (coarse, fine) = paths.0.iter().fold((0, 0), |(c, f), p| (c + p.coarse.len(), f + p.fine.len()));
    ray_path::draw(field, &paths, MOST_DRAWN).write_png(output)?;
    console.print(&format!("{end}\nread {coarse} lowest distances and {fine} texels\nwrote {}", output.display()))
}

fn states(volume: &Volume) -> [usize; 3] {
    let count = |state| volume.states.iter().filter(|&&s| s == state).count();
    [count(ProbeState::Active), count(ProbeState::InsideGeometry), count(ProbeState::NeverSampled)]
}

/// Irradiance of one probe along ±X, ±Y, ±Z.
fn axes(volume: &Volume, probe: ProbeIndex) -> [(&'static str, Vec3); 6] {
    [("+x", Vec3::X), ("-x", -Vec3::X), ("+y", Vec3::Y), ("-y", -Vec3::Y), ("+z", Vec3::Z), ("-z", -Vec3::Z)]
        .map(|(name, axis)| (name, volume.probe_irradiance(probe, axis)))
}

fn position_world(volume: &Volume, probe: ProbeIndex) -> [f64; 3] {
    (volume.grid.origin_world() + volume.position(probe).as_dvec3()).to_array()
}

/// Bytes of the same probes in a published file of their method; `None` where there is none.
fn published_bytes(volume: &Volume) -> Option<u64> {
    let tiles = volume.occlusion.tiles().is_some_and(|tiles| tiles.store() == TileStore::default());
    let subdivided = volume.grid.tree().map(|tree| tree.node_count() as u64);
    let is_threev8 = tiles && volume.irradiance.signed().is_some();
    is_threev8.then(|| threev8_bytes(volume.states.len() as u64, subdivided))
}

fn to_json(file: &ProbeFile, probe: Option<u32>) -> Value {
    let volume = file.volume_in_grid();
    let [active, inside, unsampled] = states(volume);
    let tensors: Value = file
        .tensor_shapes
        .iter()
        .map(|(name, (dtype, shape))| {
            (name.clone(), json!({"dtype": dtype, "shape": shape, "bytes": file.tensor_bytes[name]}))
        })
        .collect();
    let mut out = json!({
        "schema": "lightprobe-inspect/1",
        "format": FORMAT,
        "hashes": "match",
        "file_bytes": file.file_bytes,
        "grid": {
            "kind": if volume.grid.tree().is_some() { "mixed" } else { "uniform" },
            "levels": volume.grid.tree().map_or(0, Tree::levels),
            "origin": volume.grid.origin_world().to_array(),
            "spacing": volume.grid.spacing().to_array(),
            "divisions": volume.grid.divisions().to_array(),
            "border": file.border,
        },
        "probes": volume.states.len(),
        "probes_active": active,
        "probes_inside_geometry": inside,
        "probes_never_sampled": unsampled,
        "encoding": {"irradiance": volume.irradiance.describe(), "occlusion": volume.occlusion.describe()},
        "query": file.query,
        "tensors": tensors,
        "published_bytes": published_bytes(volume),
        "scene": file.scene,
        "seed": file.seed,
        "plan": file.plan,
        "config": file.config,
    });
    if let Some(p) = probe {
        let index = ProbeIndex(p);
        let irradiance: Value =
            axes(volume, index).into_iter().map(|(n, e)| (n.to_owned(), json!(e.to_array()))).collect();
        out["probe"] = json!({
            "index": p,
            "position_m": position_world(volume, index),
            "state": volume.states[p as usize],
            "irradiance": irradiance,
        });
    }
    out
}

fn to_text(file: &ProbeFile, probe: Option<u32>) -> String {
    let volume = file.volume_in_grid();
    let grid = &volume.grid;
    let [active, inside, unsampled] = states(volume);
    let mut out = format!(
        "{FORMAT}, {}, all hashes match\n\
         scene     {} (BLAKE3 {}), seed {}\n\
         grid      {}, spacing {} m, origin {} m, border {}\n\
         probes    {} ({active} active, {inside} inside geometry, {unsampled} never sampled)\n\
         irradiance {}\n\
         occlusion  {}\n\
         query      {}\n",
        format::bytes(file.file_bytes),
        file.scene.name,
        file.scene.blake3,
        file.seed.map_or_else(|| "not known".to_owned(), |seed| seed.to_string()),
        grid.describe(),
        grid.spacing(),
        grid.origin_world(),
        file.border,
        volume.states.len(),
        volume.irradiance.describe(),
        volume.occlusion.describe(),
        // Words apart, so that a terminal can wrap them.
        serde_json::to_string(&file.query.weights).unwrap_or_default().replace(",\"", ", \""),
    );
    let mut table = Table::new(&[
        ("tensor", Column::Text),
        ("type", Column::Text),
        ("shape", Column::Text),
        ("bytes", Column::Number),
        ("per probe", Column::Number),
    ]);
    for (name, (dtype, shape)) in &file.tensor_shapes {
        let bytes = file.tensor_bytes[name];
        let per_probe = bytes as f64 / volume.states.len() as f64;
        let per_probe = format!("{} B", format::significant(per_probe, 3));
        table.push([name.clone(), dtype.clone(), format!("{shape:?}"), format::bytes(bytes), per_probe]);
    }
    out += &format!("{table}\n");
    if let Some(bytes) = published_bytes(volume) {
        out += &format!("the published file of this method would take {}\n", format::bytes(bytes));
    }
    if let Some(p) = probe {
        let index = ProbeIndex(p);
        let state = serde_json::to_value(volume.states[p as usize]).unwrap_or_default();
        out += &format!("probe {p} at {:?} m, {}\n", position_world(volume, index), state.as_str().unwrap_or_default());
        for (name, e) in axes(volume, index) {
            let channels = e.to_array().map(|channel| format::significant(f64::from(channel), DIGITS)).join(" ");
            out += &format!("  irradiance {name}  {channels} W·m⁻²\n");
        }
    }
    if let Some(lines) = file.plan["lines"].as_array() {
        out += "plan\n";
        for line in lines {
            let is_kept = line["kept"].as_bool().unwrap_or(true);
            let kept = if is_kept { "kept" } else { "left out" };
            let text = |key: &str| line[key].as_str().unwrap_or_default().to_owned();
            out += &format!("  {:<22} {kept:<9} {}\n", stage_in_words(&text("stage"), is_kept), text("reason"));
        }
    }
    out + "configuration\n" + &file.config
}
