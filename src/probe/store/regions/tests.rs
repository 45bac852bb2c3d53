//! Trees against the tables that they stand for.

use glam::{DVec3, UVec3, Vec3};

use super::words::{AXIS_SHIFT, THRESHOLD_SHIFT, wall_axis};
use super::*;
use crate::math::random::{Purpose, Random};
use crate::probe::store::surface::{Entry, TableTest, key};

fn grid() -> Grid {
    Grid::from_parts(DVec3::ZERO, Vec3::ONE, UVec3::new(3, 2, 2)).unwrap()
}

/// A first cell with random surfaces of a few masks, a second without any. Every third entry that sees nothing has a probe
/// farther away.
fn table(n: u32, share: f32, masks: &[u8], seed: u64) -> SurfaceVisibility {
    let mut random = Random::new(seed, Purpose::FitPoints, 0, 0);
    let mut table = SurfaceVisibility { voxels_per_cell: n, ..Default::default() };
    for v in 0..n.pow(3) {
        for facing in Facing::ALL.into_iter() {
            if random.uniform() < share {
                // The masks change from one side of the cell to the other, with exceptions.
                let side = usize::from(2 * (v % n) >= n);
                let place =
                    if random.uniform() < 0.9 { side } else { (random.uniform() * masks.len() as f32) as usize };
                table.keys.push(key(UVec3::new(v % n, v / n % n, v / (n * n)), facing, n));
                table.masks.push(masks[place.min(masks.len() - 1)]);
            }
        }
    }
    let nothing = (0..table.keys.len()).filter(|&i| table.masks[i] == 0);
    table.far = nothing.step_by(3).map(|i| (i as u32, i as u32 % 12)).collect();
    table.cell_start = vec![0, table.keys.len() as u32, table.keys.len() as u32];
    table
}

/// All entries are as exact as what surfaces see.
fn open(table: &SurfaceVisibility) -> Vec<Rank> {
    vec![Rank::Own; table.keys.len()]
}

fn whole(table: &SurfaceVisibility) -> Regions {
    Regions::new(&grid(), table, &open(table), &[], &[])
}

#[test]
fn entries_answer_as_in_the_table() {
    let grid = grid();
    for (n, share, masks, seed) in [
        (2, 0.5, &[3u8, 0][..], 1),
        (8, 0.1, &[15, 240, 0, 255], 2),
        (8, 0.6, &[0, 85, 3, 0, 7, 9], 3),
        (22, 0.3, &[1, 2, 3, 4, 5, 0], 4),
    ] {
        let table = table(n, share, masks, seed);
        let mut random = Random::new(seed, Purpose::FitPoints, 1, 0);
        // Whatever the air sees.
        let air: Vec<u8> = air_places(n).map(|_| random.bits() as u8).collect();
        let regions = Regions::new(&grid, &table, &open(&table), &[CellAir { masks: air, ..CellAir::default() }], &[]);
        let mut asked = 0;
        for entry in table.entries(CellIndex(0)) {
            for _ in 0..8 {
                let place = Vec3::from_array(std::array::from_fn(|_| random.uniform()));
                let at = (entry.voxel.as_vec3() + place) / n as f32;
                // Rounding may take a point across a border.
                if voxel_of(grid.fraction_in(&grid.cell(at), at), n) != entry.voxel {
                    continue;
                }
                let (cell, facing) = (grid.cell(at), Facing::of(entry.facing));
                let test = TableTest { strip: 0.0, ..Default::default() };
                let expected = table.look_up(&grid, &cell, at, facing, &test);
                assert_eq!(regions.look_up(&grid, &cell, at, facing), expected, "n {n} at {at}");
                asked += 1;
            }
        }
        assert!(asked > 20, "{asked}");
    }
}

#[test]
fn parts_reach_between_the_surfaces_and_empty_cells_see_all() {
    // A floor: its left half sees the left corners, its right half the right ones.
    let n = 8;
    let floor =
        |v: u32| (key(UVec3::new(v % n, 0, v / n), Facing::of(Vec3::Y), n), if v % n < 4 { 0x55 } else { 0xaa });
    let mut entries: Vec<(u16, u8)> = (0..n * n).map(floor).collect();
    entries.sort_unstable();
    let (keys, masks) = entries.into_iter().unzip();
    let table = SurfaceVisibility { voxels_per_cell: n, cell_start: vec![0, 64, 64], keys, masks, far: Vec::new() };
    let (grid, regions) = (grid(), whole(&table));
    let mask = |at: [f32; 3], facing: Vec3| {
        let at = Vec3::from(at);
        regions.look_up(&grid, &grid.cell(at), at, Facing::of(facing)).mask
    };
    for normal in [Vec3::Y, Vec3::NEG_Y, Vec3::X] {
        assert_eq!(mask([0.1, 0.9, 0.7], normal), 0x55);
        assert_eq!(mask([0.9, 0.5, 0.2], normal), 0xaa);
        assert_eq!(mask([1.5, 0.5, 0.5], normal), 0xff);
        // Beyond the hull the nearest place of the cell counts.
        assert_eq!(mask([0.1, -3.0, 0.5], normal), 0x55);
    }
    // One plane and two ends, one end: four words, and two roots.
    assert_eq!((regions.parts(), regions.bytes()), (3, 4 * 2 + 2 * 4));
    assert_eq!(regions.mean_visible(), 6.0);
}

#[test]
fn the_air_answers_as_it_sees_up_to_the_surfaces() {
    // A floor that sees the lower corners but for one voxel, which sees none; above it the air sees by its height.
    let n = 8;
    let keys: Vec<u16> = (0..n * n).map(|v| key(UVec3::new(v % n, 0, v / n), Facing::of(Vec3::Y), n)).collect();
    let blind_key = key(UVec3::new(3, 0, 3), Facing::of(Vec3::Y), n);
    let masks = keys.iter().map(|&key| if key == blind_key { 0 } else { 0x33 }).collect();
    let table = SurfaceVisibility { voxels_per_cell: n, cell_start: vec![0, 64, 64], keys, masks, far: Vec::new() };
    let seen = |place: Vec3| if place.y < 0.5 { 0x33 } else { 0xff };
    let (grid, air) = (grid(), air_places(n).map(seen).collect());
    let regions = Regions::new(&grid, &table, &open(&table), &[CellAir { masks: air, ..CellAir::default() }], &[]);
    let ask = |at: [f32; 3], facing: Vec3| {
        let at = Vec3::from(at);
        regions.look_up(&grid, &grid.cell(at), at, Facing::of(facing)).mask
    };
    for normal in [Vec3::X, Vec3::NEG_Y, Vec3::Y] {
        assert_eq!((ask([0.2, 0.3, 0.8], normal), ask([0.2, 0.8, 0.8], normal)), (0x33, 0xff), "{normal}");
        assert_eq!(ask([0.44, 0.7, 0.44], normal), 0xff);
    }
    // The blind voxel ends at its borders: the floor goes on beside it, the air above it.
    assert_eq!(ask([3.9 / 8.0, 0.9 / 8.0, 3.5 / 8.0], Vec3::Y), 0);
    assert_eq!(ask([4.1 / 8.0, 0.5 / 8.0, 3.5 / 8.0], Vec3::Y), 0x33);
    assert_eq!(ask([3.5 / 8.0, 1.1 / 8.0, 3.5 / 8.0], Vec3::Y), 0x33);
    // What is beside the blind surface is asked too, and not left as dark.
    let further = [[3, 0, 3], [4, 1, 3]].map(|voxel| (key(UVec3::from(voxel), Facing::ALL[0], n), 0x0f)).to_vec();
    let air = CellAir { masks: air_places(n).map(seen).collect(), further };
    let beside = Regions::new(&grid, &table, &open(&table), &[air], &[]);
    let ask = |x: f32, y: f32, facing: Vec3| {
        let at = Vec3::new(x, y, 3.5) / 8.0;
        beside.look_up(&grid, &grid.cell(at), at, Facing::of(facing)).mask
    };
    assert_eq!((ask(3.5, 0.5, Vec3::Y), ask(3.5, 0.5, Vec3::X)), (0, 0x0f));
    assert_ne!(ask(4.5, 1.5, Vec3::Y), 0);
    // Inside of a solid it is none at all.
    let rank = |mask: &u8| if *mask == 0 { Rank::Buried } else { Rank::Own };
    let buried: Vec<Rank> = table.masks.iter().map(rank).collect();
    let air = air_places(n).map(seen).collect();
    let without = Regions::new(&grid, &table, &buried, &[CellAir { masks: air, ..CellAir::default() }], &[]);
    let at = Vec3::new(3.5, 0.5, 3.5) / 8.0;
    assert_eq!(without.look_up(&grid, &grid.cell(at), at, Facing::of(Vec3::Y)).mask, 0x33);
    assert!(without.parts() < regions.parts());
}

#[test]
fn where_the_air_sees_otherwise_than_a_surface_it_does_so_up_to_that_surface() {
    // A wall's far side sees the corners beyond it, the air before it those on its own side: places lie in voxels 1, 3, 5, 7.
    for wall in [0, 2, 4, 6, 7] {
        let n = 8;
        let keys: Vec<u16> = (0..n * n).map(|v| key(UVec3::new(wall, v % n, v / n), Facing::of(Vec3::X), n)).collect();
        let table = SurfaceVisibility {
            voxels_per_cell: n,
            cell_start: vec![0, 64, 64],
            masks: vec![0xaa; keys.len()],
            keys,
            far: Vec::new(),
        };
        let seen = |place: Vec3| if place.x * 8.0 < wall as f32 { 0x55 } else { 0xaa };
        let (grid, air) = (grid(), air_places(n).map(seen).collect());
        let regions = Regions::new(&grid, &table, &open(&table), &[CellAir { masks: air, ..CellAir::default() }], &[]);
        for x in 0..n {
            let at = Vec3::new((x as f32 + 0.5) / 8.0, 0.4, 0.4);
            let expected = if x < wall && wall > 1 { 0x55 } else { 0xaa };
            assert_eq!(regions.look_up(&grid, &grid.cell(at), at, Facing::of(Vec3::X)).mask, expected, "{wall} {x}");
        }
    }
}

#[test]
fn cells_that_see_alike_share_a_tree() {
    let table = SurfaceVisibility {
        voxels_per_cell: 1,
        cell_start: vec![0, 1, 2],
        keys: vec![2, 2],
        masks: vec![9, 9],
        far: Vec::new(),
    };
    assert_eq!(whole(&table).bytes(), 2 * 4 + 2);
}

#[test]
fn trees_come_back_from_the_file_and_damaged_ones_do_not() {
    let regions = whole(&table(22, 0.3, &[1, 2, 3, 4, 5, 0], 5));
    // Some need more than eight bits from one part to the other.
    assert!(regions.words.len() > 1000 && regions.words[0] & LOW == 0);
    let written = |change: &dyn Fn(&mut Regions)| {
        let (mut regions, mut container) = (regions.clone(), Container::default());
        change(&mut regions);
        write(&regions, &mut container);
        read(&container, &grid())
    };
    assert_eq!(written(&|_| ()).unwrap(), regions);
    let far = (0..).find(|&i| regions.words[i] == LEAF | FAR).unwrap();
    type Change<'a> = (&'a dyn Fn(&mut Regions), &'a str);
    let changes: [Change; 10] = [
        (&|r| r.roots[1] = 1, ROOTS),
        (&|r| r.roots[0] = u32::MAX, ROOTS),
        (&|r| r.roots.truncate(1), ROOTS),
        (&|r| r.words.truncate(r.words.len() - 2), TREES),
        (&|r| r.words.push(0), TREES),
        (&|r| r.words[1] ^= 1, TREES),
        (&|r| r.words[far + 1] = 12, TREES),
        // A plane at the cell's border divides nothing.
        (&|r| r.words[0] &= !(31 << THRESHOLD_SHIFT), TREES),
        (&|r| r.words[0] |= 31 << THRESHOLD_SHIFT, TREES),
        (&|r| r.voxels_per_cell = 23, VOXELS_KEY),
    ];
    for (i, (change, words)) in changes.into_iter().enumerate() {
        let error = written(change).unwrap_err();
        assert!(error.contains(words), "{i}: {error}");
    }
}

#[test]
fn words_that_pass_for_trees_answer_everywhere_and_end() {
    let (mut passed, mut walled) = (0, 0);
    for seed in 0..20_000 {
        let mut random = Random::new(seed, Purpose::FitPoints, 2, 0);
        // Thresholds within the cell and small distances, so that some pass.
        let mut any = |n: u32| (random.bits() % n) as u16;
        let mut word = || match any(4) {
            0 => any(4) << AXIS_SHIFT | (1 + any(3)) << THRESHOLD_SHIFT | (2 + any(3)),
            1 => 3 << AXIS_SHIFT | (WALLS + any(3)) << THRESHOLD_SHIFT | (3 + any(3)),
            _ => LEAF | any(4),
        };
        let words: Vec<u16> = (0..7).map(|_| word()).collect();
        let Ok(firsts) = firsts(&words, 4, 12) else { continue };
        passed += usize::from(firsts.len() < 7);
        for first in firsts {
            let regions = Regions { voxels_per_cell: 4, roots: vec![first], words: words.clone() };
            let point = |i: u32| (UVec3::new(i % 4, i / 4 % 4, i / 16 % 4).as_vec3() + 0.5) / 4.0;
            let places = (0..64 * 6).map(|i| (point(i), Facing::ALL[i as usize / 64]));
            let seen: u32 =
                places.map(|(at, facing)| regions.mask(regions.leaf(first as usize, at, facing)).count_ones()).sum();
            // Voxels at a wall count on both sides there.
            match words.iter().any(|word| wall_axis(*word).is_some()) {
                true => walled += 1,
                false => assert_eq!(regions.mean_visible(), f64::from(seen) / 384.0, "{words:?}"),
            }
        }
    }
    // One plane before six ends, at any of five places: a quarter of 5·½⁶ in the kind of the words, and a third in the distance.
    assert!(passed > 100 && walled > 50, "{passed} {walled}");
}

/// A wall at x = 0.3 of the cell, thinner than a voxel of 1/8: what is before it sees the low corners, what is behind the high
/// ones, whichever way it faces. Points on the wall go by their facing.
#[test]
fn things_beside_a_thin_wall_see_what_is_on_their_side() {
    let grid = grid();
    let n = 8;
    let (layer, low, high) = (2, 0x55, 0xaa);
    let mut entries: Vec<(u16, u8)> = Vec::new();
    for y in 0..n {
        for z in 0..n {
            entries.push((key(UVec3::new(layer, y, z), Facing::of(Vec3::NEG_X), n), low));
            entries.push((key(UVec3::new(layer, y, z), Facing::of(Vec3::X), n), high));
        }
    }
    entries.sort();
    let table = SurfaceVisibility {
        voxels_per_cell: n,
        cell_start: [vec![0], vec![entries.len() as u32; grid.cell_count()]].concat(),
        keys: entries.iter().map(|e| e.0).collect(),
        masks: entries.iter().map(|e| e.1).collect(),
        far: Vec::new(),
    };
    let air = air_places(n).map(|place| if place.x < 0.3 { low } else { high }).collect();
    let sides = entries.iter().map(|(_, mask)| if *mask == low { BELOW } else { BEYOND }).collect();
    let wall = Wall { plane: Plane { axis: 0, place: (0.3f32 * 65536.0) as u16 }, sides };
    let regions =
        Regions::new(&grid, &table, &open(&table), &[CellAir { masks: air, ..CellAir::default() }], &[vec![wall]]);
    let (origin, sides) = grid.cell_box(CellIndex(0));
    let seen = |x: f32, facing: Facing| {
        let at = origin + Vec3::new(x, 0.4, 0.6) * sides;
        regions.look_up(&grid, &grid.cell(at), at, facing).mask
    };
    for facing in Facing::ALL {
        for x in [0.01, 0.2, 0.26, 0.297] {
            assert_eq!(seen(x, facing), low, "{x} {facing:?}");
        }
        for x in [0.303, 0.34, 0.37, 0.5, 0.99] {
            assert_eq!(seen(x, facing), high, "{x} {facing:?}");
        }
    }
    for x in [0.2998, 0.3, 0.3002] {
        assert_eq!((seen(x, Facing::of(Vec3::NEG_X)), seen(x, Facing::of(Vec3::X))), (low, high), "{x}");
    }
    // A wall and one part on either side, read back as they were written.
    let mut container = Container::default();
    write(&regions, &mut container);
    assert_eq!((regions.parts(), read(&container, &grid)), (2 + usize::from(grid.cell_count() > 1), Ok(regions)));
}

/// Whatever walls there are, files come back, and surfaces get what the table says.
#[test]
fn walls_change_nothing_for_surfaces() {
    let grid = grid();
    let n = 8;
    let mut divided = 0;
    for seed in 0..100 {
        let table = table(n, 0.3, &[0x0f, 0xf0, 0x33, 0xff], seed);
        let mut random = Random::new(seed, Purpose::FitPoints, 3, 0);
        let mut walls = Vec::new();
        for _ in 0..1 + random.bits() % 4 {
            let plane = Plane { axis: random.bits() as usize % 3, place: random.bits() as u16 };
            let place = plane.share() * n as f32;
            let side = |entry: Entry| {
                let low = entry.voxel[plane.axis] as f32;
                match (low + 1.0 <= place, low >= place) {
                    (true, _) => BELOW,
                    (_, true) => BEYOND,
                    _ => BELOW | BEYOND,
                }
            };
            walls.push(Wall { plane, sides: table.entries(CellIndex(0)).map(side).collect() });
        }
        let air = air_places(n).map(|_| 1 + (random.bits() % 255) as u8).collect();
        let plain = whole(&table);
        let regions =
            Regions::new(&grid, &table, &open(&table), &[CellAir { masks: air, ..CellAir::default() }], &[walls]);
        divided += usize::from(regions != plain);
        let (low, sides) = grid.cell_box(CellIndex(0));
        for entry in table.entries(CellIndex(0)) {
            let at = low + (entry.voxel.as_vec3() + Vec3::new(0.3, 0.5, 0.7)) / n as f32 * sides;
            let facing = Facing::of(entry.facing);
            let asked = |regions: &Regions| regions.look_up(&grid, &grid.cell(at), at, facing);
            assert_eq!(asked(&regions), asked(&plain), "{seed} {entry:?}");
        }
        let mut container = Container::default();
        write(&regions, &mut container);
        assert_eq!(read(&container, &grid), Ok(regions), "{seed}");
    }
    assert!(divided > 50, "{divided}");
}
