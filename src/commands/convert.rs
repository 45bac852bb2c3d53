//! `lightprobe convert`: a probe file on another lattice.

use anyhow::{Context, Result, anyhow};
use serde_json::json;

use super::session::{Opening, Probes, Session, inputs};
use super::{Console, kinds, tell};
use crate::bake::convert::to_uniform;
use crate::cli::ConvertArgs;
use crate::config::Layers;
use crate::probe::file::{self, ProbeFile};
use crate::probe::lattice::Refine;
use crate::scene::Detail;
use crate::system::format;
use crate::system::output::{Named, check_outputs};

pub fn run(args: &ConvertArgs, console: &Console) -> Result<()> {
    let usage = "convert PROBES SCENE -o OUT.probes --to uniform";
    kinds::expect_probes(&args.probes, usage)?;
    kinds::expect_scene(&args.scene, usage)?;
    let place = args.probes.display().to_string();
    let output = Named::new("-o", &args.output);
    let read = Named::new("the probe file", &args.probes);
    check_outputs(std::slice::from_ref(&output), &inputs(&args.scene, &args.trace, [read]))?;
    let probes = file::read(&args.probes)?;
    tell::probes(console, &args.probes, &probes);
    let config = uniform_config(&probes).with_context(|| format!("{place}: its configuration"))?;
    let opening = Opening {
        scene: &args.scene,
        trace: &args.trace,
        light: probes.query.light,
        probes: Some(Probes::of(&args.probes, &probes, args.allow_scene_change)),
        detail: Detail::LIGHT,
        keep_images: false,
        inputs: vec![Named::new("the probe file", &args.probes)],
        outputs: vec![output],
    };
    let session = Session::open(opening, console)?;
    let (world, _) = session.world()?;
    let mixed = probes.volume(session.scene.origin_world);
    let converted = to_uniform(&world, &mixed).map_err(|what| anyhow!("{place}: {what}"))?;
    let (container, _) = file::encode(&converted, &probes.provenance(&config));
    let bytes = container.write(&args.output)?;
    tell::written(console, &args.output);
    let (before, after) = (mixed.states.len(), converted.states.len());
    let report = json!({
        "schema": "lightprobe-convert/1",
        "probes_before": before,
        "probes": after,
        "bytes_before": probes.file_bytes,
        "bytes": bytes,
    });
    session.print(&report, || {
        format!(
            "{before} probes, {}, became {after}, {}\nwrote {}",
            format::bytes(probes.file_bytes),
            format::bytes(bytes),
            args.output.display()
        )
    })
}

/// The file's configuration with a uniform grid.
fn uniform_config(probes: &ProbeFile) -> Result<String> {
    let mut config = Layers::default().text(&probes.config, "the file")?.config()?;
    config.placement.refine = Refine::Uniform;
    Ok(config.to_ron())
}
