//! The stage: settle → survey → need.

use super::lend::lend;
use super::placement::{Placement, PlacementTask};
use super::settings::PlacementRule;
use super::settle::{Settler, settle_all};
use super::surveyor::Surveyor;
use super::walls::walls;
use super::{air, need};
use crate::light::World;
use crate::probe::lattice::{Grid, ProbeState};
use crate::probe::store::regions::Regions;
use crate::probe::store::surface::SurfaceVisibility;
use crate::scene::Mesh;

/// Places every probe of the grid and surveys the surfaces; `surveying` is called in between.
pub fn place(world: &World, task: &PlacementTask, surveying: impl FnOnce()) -> Placement {
    let PlacementTask { grid, settings, occlusion, .. } = *task;
    let mut placement = settle_all(world, task);
    surveying();
    let Some(voxels) = occlusion.survey_voxels() else { return placement };
    let surveyor = Surveyor::new(world, grid, voxels, &settings.survey);
    let mut found = surveyor.survey(&placement, None);
    placement.rays += found.rays;
    if let PlacementRule::Settle(rule) = &settings.rule
        && rule.relocate
    {
        let moved = need::relocate(&Settler { world, grid, settings: rule }, &mut placement, &found, &settings.survey);
        if !moved.is_empty() {
            found = surveyor.survey(&placement, Some((&found, &moved)));
            placement.rays += found.rays;
        }
    }
    // Only where shading asks this very table does it need a probe for every entry, and does a probe that no surface sees
    // weigh nothing.
    if occlusion.keeps_survey() {
        found.table.far = need::far_probes(world, grid, &placement, &found, &settings.survey);
        leave_unseen(&world.scene.mesh, grid, &mut placement, &found.table, settings.keep_unsampled);
        let (mut seen, rays) = air::seen(world, grid, &placement, &found.table);
        placement.rays += rays + lend(world, grid, &mut found, &seen);
        placement.rays += air::look_beside_dark(world, grid, &placement, &found, &mut seen);
        placement.regions = Some(Regions::new(grid, &found.table, &found.ranks(), &seen, &walls(&surveyor, &found)));
    }
    placement.survey = Some(found.table);
    placement
}

/// Active probes that no surface sees are asked by none, and not worth baking unless they are to be kept.
fn leave_unseen(mesh: &Mesh, grid: &Grid, placement: &mut Placement, table: &SurfaceVisibility, keep: bool) {
    let mut seen = need::seen_probes(mesh, grid, placement, table, |_| true);
    table.far.iter().for_each(|&(_, probe)| seen[probe as usize] = true);
    for (asked, &seen) in placement.asked.iter_mut().zip(&seen) {
        *asked &= seen;
    }
    for (state, seen) in placement.states.iter_mut().zip(seen) {
        if *state == ProbeState::Active && !seen && !keep {
            *state = ProbeState::NeverSampled;
        }
    }
}
