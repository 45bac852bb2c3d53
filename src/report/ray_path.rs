//! The way of a ray over the maps of the probes that it is traced in: for each probe asked its distances on the left and its
//! radiance on the right, with the texels that were read.

use glam::Vec3;

use super::probe_key::{Entry, with_key};
use crate::image::{Picture, Picture8};
use crate::probe::query::march::Watch;
use crate::probe::store::radiance::{FAR_M, LightField};

/// Pixels per side of a map.
const SIDE: u32 = 512;

/// Between maps.
const GAP: u32 = 8;

const COARSE: [u8; 3] = [60, 120, 220];
const FINE: [u8; 3] = [250, 200, 40];
const END: [u8; 3] = [230, 30, 30];

const KEY: &[Entry] = &[
    Entry {
        color: [128, 128, 128],
        rim: [40; 3],
        meaning: "left: distance, nearest black; right: radiance; a row for each probe",
    },
    Entry { color: COARSE, rim: [40; 3], meaning: "texels of the level of lowest distances that were read" },
    Entry { color: FINE, rim: [40; 3], meaning: "texels below that were read" },
    Entry { color: END, rim: [40; 3], meaning: "the last: a hit, or where the probe sees no further" },
];

/// What was read of one probe's maps.
#[derive(Debug, Clone, Default)]
pub struct Path {
    pub probe: usize,
    pub coarse: Vec<(usize, usize)>,
    pub fine: Vec<(usize, usize)>,
}

/// Those of all probes that were asked, in order.
#[derive(Debug, Clone, Default)]
pub struct Paths(pub Vec<Path>);

impl Watch for Paths {
    fn coarse(&mut self, column: usize, row: usize) {
        if let Some(path) = self.0.last_mut() {
            path.coarse.push((column, row));
        }
    }

    fn fine(&mut self, column: usize, row: usize) {
        if let Some(path) = self.0.last_mut() {
            path.fine.push((column, row));
        }
    }
}

/// Draws at most `most` of the paths.
pub fn draw(field: &LightField, paths: &Paths, most: usize) -> Picture8 {
    let shown = &paths.0[..paths.0.len().min(most)];
    let (width, height) = (2 * SIDE + GAP, (SIDE + GAP) * shown.len().max(1) as u32 - GAP);
    let mut picture = Picture8::filled(width, height, [242, 242, 243]);
    for (i, path) in shown.iter().enumerate() {
        let maps = [distances(field, path.probe), radiance(field, path.probe)];
        for (k, mut map) in maps.into_iter().enumerate() {
            mark(&mut map, field, path);
            let (left, top) = (k as u32 * (SIDE + GAP), i as u32 * (SIDE + GAP));
            for y in 0..SIDE {
                let from = (y * SIDE) as usize;
                let to = ((top + y) * width + left) as usize;
                picture.pixels[to..to + SIDE as usize].copy_from_slice(&map.pixels[from..from + SIDE as usize]);
            }
        }
    }
    with_key(picture, KEY)
}

/// A value of the map's texel under each pixel.
fn spread<T>(side: usize, value: impl Fn(usize) -> T) -> Vec<T> {
    let texel = |x: u32| (x as usize * side / SIDE as usize).min(side - 1);
    (0..SIDE * SIDE).map(|i| value(texel(i % SIDE) + side * texel(i / SIDE))).collect()
}

/// The logarithm of distance in grey; white where there is no surface.
fn distances(field: &LightField, probe: usize) -> Picture8 {
    let map = field.distance.probe(probe);
    let known = || map.iter().copied().filter(|d| *d > 0.0 && *d < FAR_M);
    let (low, high) = (known().fold(FAR_M, f32::min).ln(), known().fold(f32::MIN_POSITIVE, f32::max).ln());
    let grey = |o: usize| match map[o] {
        d if d >= FAR_M => [255; 3],
        d => [(215.0 * (d.max(f32::MIN_POSITIVE).ln() - low) / (high - low).max(1e-3)) as u8; 3],
    };
    Picture8 { width: SIDE, height: SIDE, pixels: spread(field.distance.resolution, grey) }
}

fn radiance(field: &LightField, probe: usize) -> Picture8 {
    let map = field.radiance.probe(probe);
    let pixels: Vec<Vec3> = spread(field.radiance.resolution, |o| map[o]);
    let picture = Picture::from_pixels(SIDE, SIDE, pixels);
    picture.tonemapped(picture.auto_exposure_ev())
}

/// Colours what was read: half covered where a coarse texel was, wholly where a fine one was, at least two pixels wide.
fn mark(map: &mut Picture8, field: &LightField, path: &Path) {
    let mut fill = |side: usize, &(column, row): &(usize, usize), color: [u8; 3], share: u32, least: usize| {
        let pixel = |i: usize| i * SIDE as usize / side;
        let (left, top) = (pixel(column), pixel(row));
        let right = pixel(column + 1).max(left + least).min(SIDE as usize);
        let bottom = pixel(row + 1).max(top + least).min(SIDE as usize);
        for y in top..bottom {
            for x in left..right {
                let below = &mut map.pixels[x + y * SIDE as usize];
                for (channel, new) in below.iter_mut().zip(color) {
                    *channel = ((u32::from(*channel) * (4 - share) + u32::from(new) * share) / 4) as u8;
                }
            }
        }
    };
    if let Some(lowest) = &field.lowest {
        path.coarse.iter().for_each(|texel| fill(lowest.resolution, texel, COARSE, 2, 1));
    }
    let side = field.distance.resolution;
    path.fine.iter().for_each(|texel| fill(side, texel, FINE, 4, 2));
    if let Some(last) = path.fine.last() {
        fill(side, last, END, 4, 5);
    }
}
