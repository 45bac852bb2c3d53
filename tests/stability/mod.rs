//! The cases, by what is extreme about them.

pub mod case;
mod doors;
mod encodings;
mod furnaces;
mod grids;
mod lights;
mod look;
mod materials;
mod meshes;
mod methods;
mod moments;
mod rooms;
mod scales;
mod skies;
mod walls;

use case::Case;

/// All of them, in the order of the table.
pub fn cases() -> Vec<Case> {
    [
        furnaces::cases(),
        doors::cases(),
        scales::cases(),
        lights::cases(),
        encodings::cases(),
        walls::cases(),
        grids::cases(),
        skies::cases(),
        meshes::cases(),
        materials::cases(),
        moments::cases(),
        methods::cases(),
    ]
    .into_iter()
    .flatten()
    .collect()
}
