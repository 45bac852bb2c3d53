//! Sizes of published files, from the layouts that are counted here.

use crate::math::harmonics;
use crate::probe::store::tiles::TileStore;

/// Bytes of a file of Three.V8 (Fei Yang 2023): a head, four floats for each coefficient, in mixed grids four more for place
/// and level and an index, and the tiles in a square atlas.
///
/// `subdivided`: cells of a mixed grid that have children; `None` for a uniform one.
pub fn threev8_bytes(probes: u64, subdivided: Option<u64>) -> u64 {
    const HEAD: u64 = 52;
    const MIXED_HEAD: u64 = 60;
    const FOUR_FLOATS: u64 = 16;
    let coefficients = harmonics::COUNT as u64 * FOUR_FLOATS;
    let side = (probes as f64).sqrt().ceil() as u64;
    let atlas = side * side * TileStore::default().runtime_bytes(1) as u64;
    atlas
        + match subdivided {
            None => HEAD + coefficients * probes,
            Some(nodes) => MIXED_HEAD + (coefficients + FOUR_FLOATS) * probes + 4 * (probes + nodes),
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_sizes_come_out() {
        let uniform = |x: u64, y: u64, z: u64| threev8_bytes(x * y * z, None);
        let mixed = |probes: u64, base: u64| {
            assert_eq!((probes - base) % 7, 0);
            threev8_bytes(probes, Some((probes - base) / 7))
        };
        for (bytes, hundredths) in [
            (uniform(40, 24, 24), 3170),
            (mixed(9488, 5 * 3 * 3), 1330),
            (uniform(16, 16, 16), 562),
            (mixed(1800, 2 * 2 * 2), 256),
            (uniform(12, 8, 12), 158),
            (mixed(809, 3 * 2 * 3), 116),
        ] {
            // Truncated MiB; the first two were given with one digit.
            let found = bytes * 100 / (1 << 20);
            let found = if hundredths > 1000 { found / 10 * 10 } else { found };
            assert_eq!(found, hundredths, "{bytes} bytes");
        }
    }
}
