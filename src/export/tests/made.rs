//! What exports are made of: rows of a fit, holes, folders.

use glam::{DVec3, UVec3, Vec3, Vec3A};

use super::fixture::{SPACING, export, grids, origin, points, untested, volume};
use crate::export::made::one_block;
use crate::export::{Export, Rules, Written, record};
use crate::probe::fit::points::asked_in_air;
use crate::probe::fit::rows::Row;
use crate::probe::fit::{Fitted, Kind, RowSettings};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Answers, Query, QueryPoint, Visibility};

#[test]
fn rows_of_a_fit_are_the_look_up() {
    for rules in [Rules::Three, Rules::Bevy] {
        let own = grids(rules, UVec3::new(3, 2, 4), 2);
        let (low, high) = (own.blocks[0].bounds().0, own.blocks[1].bounds().1);
        for query in points(low, high, 200) {
            let asked = asked_in_air(query.position, query.normal);
            let row = own.row(&asked, Vec3::ZERO);
            let mut sum = Vec3A::ZERO;
            for part in &row.parts {
                rules.factors().each(part.oct, part.offset, |unknown, factor| {
                    sum += own.of_probe(part.probe.0 as usize)[unknown] * factor * part.share;
                });
            }
            let found = own.irradiance(&asked.query, Visibility::Stored);
            assert!((Vec3::from(sum) - found).abs().max_element() < 1e-4, "{rules:?}: {sum} {found}");
        }
    }
}

/// Least squares of a step from 0.02 to 1 between two probes give −0.225 + 1.47x, x from 0 to 1: 9 of 60 rows are black. With
/// 16 times the weight of these they give −0.087 + 1.255x, and 4 are.
#[test]
fn a_fit_for_three_leaves_less_black() {
    const ROWS: usize = 60;
    let mut own = grids(Rules::Three, UVec3::new(2, 1, 1), 1);
    let first = own.blocks[0].first - 0.5 * SPACING * Vec3::Y;
    let at = |i: usize| (i as f32 + 0.5) / ROWS as f32;
    let asked: Vec<_> = (0..ROWS).map(|i| asked_in_air(first + at(i) * SPACING * Vec3::X, Vec3::Y)).collect();
    let target = |i: usize| if at(i) < 0.5 { 0.02 } else { 1.0 };
    let row = |(i, asked)| Row { kind: Kind::Surface, ..own.row(asked, Vec3::splat(target(i))) };
    let rows = asked.iter().enumerate().map(row).collect();
    // So small that the values before the fit do not count.
    own.solve(rows, &RowSettings { lambda: 1e-6, ..RowSettings::default() });
    let is_black = |i: &usize| own.irradiance(&asked[*i].query, Visibility::Stored).x < 0.05 * target(*i);
    let black = (0..ROWS).filter(is_black).count();
    // A row's place on the line may round to either side.
    assert!((3..=5).contains(&black), "{black} of {ROWS} rows");
}

#[test]
fn holes_get_what_the_look_up_gives_around_them() {
    let mut own = volume(UVec3::new(3, 3, 3), |_| 2.0);
    own.states[13] = ProbeState::InsideGeometry;
    own.positions[0] += Vec3::new(0.5, 0.0, 0.0);
    for rules in [Rules::Three, Rules::Bevy] {
        let (grids, notes) = one_block(&own, &untested(), rules, None);
        let moved: Vec<(u32, [f32; 3])> = notes[0].moved.iter().map(|moved| (moved.probe, moved.offset)).collect();
        assert_eq!((&notes[0].holes[..], &moved[..]), (&[13][..], &[(0, [0.5, 0.0, 0.0])][..]));
        for (hole, neighbour) in grids.of_probe(13).iter().zip(grids.of_probe(12)) {
            // Coefficients are made anew of 48 directions.
            assert!((*hole - *neighbour).abs().max_element() < 1e-4, "{rules:?}: {hole} {neighbour}");
        }
    }
    // Where nothing is known around, the nearest counts.
    let mut lone = volume(UVec3::new(4, 1, 1), |_| 3.0);
    lone.states[1..].fill(ProbeState::InsideGeometry);
    let (grids, _) = one_block(&lone, &untested(), Rules::Three, None);
    assert!((grids.of_probe(3)[0].x - 3.0).abs() < 1e-4);
}

#[test]
fn what_is_written_answers_as_the_volume_does() {
    let own = volume(UVec3::new(3, 4, 2), |probe| 1.0 + probe as f32);
    let settings = untested();
    let query = Query { volume: &own, settings: &settings };
    let (grids, notes) = one_block(&own, &settings, Rules::Three, None);
    let made = Export::of_grids(&grids, &notes, &origin(), None);
    let folder = tempfile::tempdir().unwrap();
    made.write(folder.path()).unwrap();
    let read = Export::read(folder.path()).unwrap();
    assert_eq!(read.record, made.record);
    // Four halves of 3 × 4 × 7·(2 + 2) texels.
    assert_eq!((read.bytes(), read.probes()), (8 * 3 * 4 * 28, 24));
    let Written::Grids(written) = read.as_read().unwrap() else { panic!("no grids") };
    let written = written.relative_to(DVec3::ZERO);
    let (low, high) = own.grid.hull(0.0);
    for point in points(low + 0.5 * SPACING, high - 0.5 * SPACING, 100) {
        // Half a cell along the normal, of the same linear weights.
        let shifted = QueryPoint { position: point.position + point.normal * 0.5 * SPACING, ..point };
        let (found, expected) =
            (written.irradiance(&point, Visibility::Stored), query.irradiance(&shifted, Visibility::Off));
        // A half has eleven bits; values reach 24.
        assert!((found - expected).abs().max_element() < 24.0 / 1024.0, "{point:?}: {found} {expected}");
    }
}

#[test]
fn damaged_exports_are_refused() {
    let made = export(&grids(Rules::Three, UVec3::new(2, 2, 2), 1));
    let refused = |change: &dyn Fn(&mut Export)| {
        let mut made = made.clone();
        change(&mut made);
        made.as_read().map(|_| ()).unwrap_err()
    };
    let short = refused(&|made| made.files[0].bytes.truncate(100));
    assert!(short.contains("100"), "{short}");
    let huge = refused(&|made| made.record.volumes[0].resolution = [60_000, 60_000, 60_000]);
    assert!(huge.contains("60000"), "{huge}");
    let flat = refused(&|made| made.record.volumes[0].max = made.record.volumes[0].min);
    assert!(flat.contains("no box"), "{flat}");
    let lost = refused(&|made| made.record.volumes[0].file = "other.bin".to_owned());
    assert!(lost.contains("other.bin"), "{lost}");
    // Behind the first slice of 2 × 2 texels, which only repeats the second.
    let infinite = refused(&|made| made.files[0].bytes[32..34].copy_from_slice(&half::f16::INFINITY.to_le_bytes()));
    assert!(infinite.contains("not finite"), "{infinite}");
    let folder = tempfile::tempdir().unwrap();
    let mut outside = made.clone();
    outside.record.volumes[0].file = "../x".to_owned();
    let text = serde_json::to_string(&outside.record).unwrap();
    std::fs::write(folder.path().join(record::RECORD), text).unwrap();
    assert!(Export::read(folder.path()).unwrap_err().to_string().contains("no name of a file"));
}
