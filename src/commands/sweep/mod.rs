//! `lightprobe sweep`: scene + ladders → errors against time, bytes and leaks.

mod methods;
mod outputs;
mod page;
mod reference;
mod sheet;
mod summary;
mod table;
mod work;

use std::time::Instant;

use anyhow::{Context, Result, bail};

use self::methods::{check_all, configurations, ladders, shades_gloss, shared, shift, wants_floors};
use self::work::Work;
use super::camera::cameras;
use super::session::{Opening, Session, list_presets, lists_presets};
use super::{Console, check_picture_memory, kinds, tell};
use crate::cli::SweepArgs;
use crate::evaluate::{Comparison, Scenery};
use crate::light::bsdf::ReflectionModel;
use crate::plan::glossy_materials;
use crate::report::sweep::SweepTimes;
use crate::scene::Detail;
use crate::shade::points::see;
use crate::shade::reference::ReferenceSettings;
use crate::shade::regions::regions;
use crate::sweep::ladder::LadderFile;
use crate::sweep::run::{Setting, Truths};
use crate::sweep::store::{self, Store};
use crate::system::output::{Named, check_folder, create_folder};
use crate::system::{format, interrupt};

/// Memory that evaluation takes at its peak, per pixel: as a render's with a reference, and the sums over the seeds.
const PIXEL_BYTES: f64 = 1500.0;

pub fn run(args: &SweepArgs, console: &Console) -> Result<()> {
    if lists_presets(&args.preset) {
        return list_presets(console);
    }
    if args.view.camera.as_deref() == Some("all") {
        bail!("--camera all: a sweep is of one camera; name one");
    }
    kinds::expect_scene(&args.scene, "sweep SCENE -o DIR")?;
    let file = args.ladder.as_deref().map(LadderFile::read).transpose()?;
    let mut ladders = ladders(args, file.as_ref())?;
    let (config, keep_images) = shared(&ladders)?;
    let outputs: Vec<Named> = outputs::FILES.iter().map(|name| Named::new("-o", args.output.join(name))).collect();
    check_folder(&args.output)?;
    let opening = Opening {
        scene: &args.scene,
        trace: &args.trace,
        light: config.light(),
        probes: None,
        detail: if shades_gloss(&ladders) { Detail::GLOSSY } else { Detail::PICTURE },
        keep_images,
        inputs: configurations(args, file.as_ref()),
        // In a folder that does not exist nothing is in the way.
        outputs: if args.output.is_dir() { outputs.clone() } else { Vec::new() },
    };
    let session = Session::open(opening, console)?;
    check_all(&ladders, &session.scene)?;
    let offsets = shift(args, &mut ladders, &session.scene)?;
    check_all(&ladders, &session.scene)?;
    check_picture_memory(args.view.size, PIXEL_BYTES)?;
    let (world, accel_build_s) = session.world()?;
    let camera =
        cameras(&args.view, &world, console)?.into_iter().next().context("there is no camera; use --look-at")?;

    create_folder(&args.output)?;
    let settings = ReferenceSettings { spp: args.reference, seed: session.seed, ..Default::default() };
    let reference = reference::obtain(args, &world, &camera, &settings, console)?;
    let has_gloss = shades_gloss(&ladders) && glossy_materials(world.scene) > 0;
    let gltf = ReferenceSettings { transport: ReflectionModel::Gltf, ..settings };
    let glossy = has_gloss.then(|| reference::obtain(args, &world, &camera, &gltf, console)).transpose()?;
    let primary_started = Instant::now();
    let view = see(&world, &camera, args.view.size.width, args.view.size.height, session.seed);
    let primary_s = primary_started.elapsed().as_secs_f64();
    let scenery = Scenery::new(&world, &view, primary_s, session.seed);
    let regions = regions(&world, &view);
    let (mean, standard_error) = reference.layers.means(|i| regions[i].is_some());
    let exposure_ev = view.auto_exposure_ev(&reference.layers.beauty);
    let setting = Setting {
        scenery,
        comparison: Comparison {
            layers: &reference.layers,
            regions: &regions,
            glossy: false,
            exposure_ev,
            seed: session.seed,
        },
        glossy: glossy.as_ref().and_then(|reference| reference.glossy.as_ref()),
        reference_mean: mean.filter(|mean| *mean > 0.0),
        reference_settings: ReferenceSettings { spp: reference.spp, ..settings },
        store: Store::new(&args.output)?,
        truths: Truths::default(),
        // Times depend on the threads.
        identity: format!("{}spp = {}\nthreads = {}\n", reference.identity.to_text(), reference.spp, session.threads),
    };
    interrupt::leaves(args.output.join(store::FOLDER), "the same command goes on from there", true);
    let wants_floors = wants_floors(args, file.as_ref());
    let mut work = Work::new(&setting, &ladders, args, wants_floors, console);
    let outcomes = work.run_all()?;
    let sets = summary::ladders(&ladders, &outcomes);
    let floor = if wants_floors { work.floors(&sets, &outcomes)? } else { Vec::new() };
    let shown = work.shown(&sets, &outcomes)?;
    let irradiance = work.irradiance(&outcomes)?;
    work.bar.finish_and_clear();

    let report = summary::report(summary::Parts {
        args,
        session: &session,
        camera: &camera,
        view: &view,
        reference: reference.summary(mean, standard_error),
        exposure_ev,
        times: SweepTimes {
            load: session.load_s,
            accel_build: accel_build_s,
            reference: reference.time_s.unwrap_or(0.0) + glossy.as_ref().and_then(|r| r.time_s).unwrap_or(0.0),
            total: session.elapsed_s(),
        },
        offsets,
        ladders: sets,
        outcomes,
        floor,
    });
    outputs::write(&report, &args.output)?;
    let contact = sheet::draw(&report, &setting.scenery, &reference.layers, &regions, &shown);
    contact.write_png(&args.output.join(sheet::FILE))?;
    let seen = page::Seen { scenery: &setting.scenery, reference: &reference.layers, regions: &regions, exposure_ev };
    page::write(&report, &seen, &irradiance, &args.output)?;
    outputs.iter().filter(|o| o.path.exists()).for_each(|output| tell::written(console, &output.path));
    let kept = format::counted(work.kept as u64, "run", "runs");
    let from_before = if work.kept > 0 { format!(", {kept} kept from before") } else { String::new() };
    session.print(&report, || format!("{}\nwrote {}{from_before}", table::text(&report), args.output.display()))
}
