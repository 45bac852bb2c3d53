//! Occlusion as textures.

use glam::Vec2;

use super::Occlusion;
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::textures::{Bound, Numbers, Texture};

const SIDES: [&str; 2] = ["DISTANCE_RESOLUTION", "DISTANCE_BORDER"];

impl Occlusion {
    /// `distances`: mean and deviation of every probe's map; or `roots` and `words`: the trees of the cells. `None` where the
    /// shader's text has no look-up for it.
    pub fn bound(&self) -> Option<Bound> {
        let mut bound = Bound::default();
        let mut distances = |kind, maps: &OctahedralMaps<Vec2>| {
            bound.define(kind, 1);
            bound.define_sides(SIDES, maps);
            let numbers = Numbers::F32(maps.texels.iter().flat_map(|texel| texel.to_array()).collect());
            bound.textures.push(Texture { name: "distances", channels: 2, numbers });
        };
        match self {
            Occlusion::None => {}
            Occlusion::Moments(maps) => distances("MOMENTS", maps),
            Occlusion::Tiles(tiles) => distances("TILES", &tiles.maps),
            Occlusion::Regions(regions) => {
                let (roots, words) = regions.numbers();
                bound.define("VOXELS", regions.voxels_per_cell);
                let one = |name, numbers| Texture { name, channels: 1, numbers };
                bound.textures.push(one("roots", Numbers::U32(roots.to_vec())));
                bound.textures.push(one("words", Numbers::U16(words.to_vec())));
            }
            Occlusion::Surface(_) => return None,
        }
        Some(bound)
    }
}
