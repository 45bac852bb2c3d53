//! Which configurations a sweep compares, and whether they can be.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::bake;
use crate::cli::{EqualName, SweepArgs};
use crate::commands::session::set_sky;
use crate::config::{Config, presets};
use crate::probe::lattice::grid::GridError;
use crate::scene::Scene;
use crate::sweep::ladder::{Ladder, LadderFile, check_shared, expand};
use crate::sweep::method::Method;
use crate::sweep::{SweepError, equal, offsets};
use crate::system::output::Named;

/// All configurations, in the order in which they run.
pub fn ladders(args: &SweepArgs, file: Option<&LadderFile>) -> Result<Vec<Ladder>> {
    let mut ladders = expand(file, &methods(args, file)?, &args.set, |config| set_sky(config, &args.trace))?;
    if args.equal == Some(EqualName::Positions) {
        equal::share_positions(&mut ladders);
    }
    check_shared(&ladders)?;
    Ok(ladders)
}

/// The methods that the command line names; the preset `default` where neither it nor all ladders name any. Files lie over
/// every preset; without presets each is a method of its own, over `default`.
fn methods(args: &SweepArgs, file: Option<&LadderFile>) -> Result<Vec<Method>> {
    let mut methods: Vec<Method> = Vec::new();
    for name in &args.preset {
        let all = || presets::methods().map(|preset| preset.name).collect();
        let named: Vec<&str> = if name == "all" { all() } else { vec![name] };
        for name in named {
            methods.push(Method::new(Some(name), &args.config)?);
        }
    }
    if args.preset.is_empty() {
        for path in &args.config {
            methods.push(Method::new(None, std::slice::from_ref(path))?);
        }
    }
    for (i, method) in methods.iter().enumerate() {
        if methods[..i].iter().any(|other| other.name == method.name) {
            bail!("two configurations are called '{}'; rename a file, or give each preset once", method.name);
        }
    }
    if methods.is_empty() && file.is_none_or(LadderFile::wants_methods) {
        methods.push(Method::new(None, &[])?);
    }
    if !methods.is_empty() && file.is_some_and(|file| !file.wants_methods()) {
        bail!("--preset, --config: every ladder of the file has a configuration of its own; leave them out");
    }
    Ok(methods)
}

/// Whether to find out what limits the best of each ladder. Where presets stand side by side they are compared with each
/// other, and maps of twice their resolution would take longer than all else.
pub fn wants_floors(args: &SweepArgs, file: Option<&LadderFile>) -> bool {
    let Some(file) = file else { return false };
    let mut presets = file.presets();
    presets.extend(args.preset.iter().map(String::as_str));
    presets.len() < 2 && !presets.contains("all")
}

/// Files that configurations come from.
pub fn configurations(args: &SweepArgs, file: Option<&LadderFile>) -> Vec<Named> {
    let named = |path: &PathBuf| Named::new("a configuration", path);
    let of_ladders = file.map(LadderFile::files).unwrap_or_default();
    let ladder = args.ladder.iter().map(|path| Named::new("the ladder", path));
    args.config.iter().chain(&of_ladders).map(named).chain(ladder).collect()
}

/// What loading a scene asks of the configurations: their light, which is the same, and whether any keeps all images.
pub fn shared(ladders: &[Ladder]) -> Result<(&Config, bool)> {
    let configs = || ladders.iter().flat_map(|ladder| &ladder.rungs).map(|rung| &rung.config);
    let first = configs().next().context("there is no configuration to run")?;
    Ok((first, configs().any(|config| config.plan.keeps_everything())))
}

/// Whether any configuration shades glossy surfaces.
pub fn shades_gloss(ladders: &[Ladder]) -> bool {
    ladders.iter().flat_map(|ladder| &ladder.rungs).any(|rung| !rung.config.query.glossy.is_none())
}

/// Shifts the grids by `--offsets`; the shifts.
pub fn shift(args: &SweepArgs, ladders: &mut [Ladder], scene: &Scene) -> Result<Vec<[f64; 3]>, SweepError> {
    let Some(count) = args.offsets else { return Ok(Vec::new()) };
    let fractions = offsets::fractions(args.trace.seed, count);
    let named = |(label, cause): (String, GridError)| SweepError::Bake { label, cause: cause.into() };
    offsets::shift_all(ladders, scene, &fractions).map_err(named)?;
    Ok(fractions)
}

/// Refuses what cannot be baked, before anything is traced.
pub fn check_all(ladders: &[Ladder], scene: &Scene) -> Result<(), SweepError> {
    for rung in ladders.iter().flat_map(|ladder| &ladder.rungs) {
        let named = |cause| SweepError::Bake { label: rung.label.clone(), cause };
        rung.configs().into_iter().try_for_each(|(_, config)| bake::check(config, scene).map_err(named))?;
    }
    Ok(())
}
