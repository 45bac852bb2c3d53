//! One case of eight probes for each formula, worked out in fractions outside the code.
//!
//! The point P = (3/2, 1/2, 15/4) lies at the fractions (1/4, 3/8, 3/4) of its cell. Probes are moved to P + vᵢ with vᵢ
//! of whole length, so that cosines and distances are fractions:
//!
//! | i | vᵢ | length | cosine with n = (2, 3, 6)/7 | trilinear weight × 128 |
//! |---|---|---|---|---|
//! | 0 | (−2, −1, −2) | 3 | −19/21 | 3·5·1 = 15 |
//! | 1 | ( 2, −2, −1) | 3 |  −8/21 | 1·5·1 = 5 |
//! | 2 | (−2,  1, −2) | 3 | −13/21 | 3·3·1 = 9 |
//! | 3 | ( 2,  2, −1) | 3 |   4/21 | 1·3·1 = 3 |
//! | 4 | (−2, −3,  6) | 7 |  23/49 | 3·5·3 = 45 |
//! | 5 | ( 6, −2,  3) | 7 |  24/49 | 1·5·3 = 15 |
//! | 6 | (−6,  3,  2) | 7 |   9/49 | 3·3·3 = 27 |
//! | 7 | ( 1,  2,  2) | 3 |  20/21 | 1·3·3 = 9 |
//!
//! Irradiances are squares: 4ⁱ, (i + 1)², (10 − i)². What is expected of a look-up is Σ wᵢ·Eᵢ / Σ wᵢ.

use glam::Vec3;

use super::fixture::{Fixture, point};
use crate::probe::query::{Blend, DirectionWeight, QueryPoint, QuerySettings, Visibility};
use crate::probe::store::Occlusion;
use crate::probe::store::irradiance::IrradianceCurve;

pub const P: Vec3 = Vec3::new(1.5, 0.5, 3.75);

const TO_PROBES: [Vec3; 8] = [
    Vec3::new(-2.0, -1.0, -2.0),
    Vec3::new(2.0, -2.0, -1.0),
    Vec3::new(-2.0, 1.0, -2.0),
    Vec3::new(2.0, 2.0, -1.0),
    Vec3::new(-2.0, -3.0, 6.0),
    Vec3::new(6.0, -2.0, 3.0),
    Vec3::new(-6.0, 3.0, 2.0),
    Vec3::new(1.0, 2.0, 2.0),
];

const LENGTHS: [f32; 8] = [3.0, 3.0, 3.0, 3.0, 7.0, 7.0, 7.0, 3.0];

/// Roundings of f32, 2⁻²⁴ each, that a value may have behind it: some thirty in a chain of factors, where d − μ keeps a
/// tenth of d and its cube or the fifth power of a texel is taken.
const TOLERANCE: f64 = 2e-5;

pub fn irradiance(i: usize) -> [f32; 3] {
    [4.0f32.powi(i as i32), ((i + 1) * (i + 1)) as f32, ((10 - i) * (10 - i)) as f32]
}

pub fn eight() -> Fixture {
    let mut fixture = Fixture::new([2, 2, 2], irradiance);
    for (i, to_probe) in TO_PROBES.into_iter().enumerate() {
        fixture.place(i, P + to_probe);
    }
    fixture
}

/// The normal is n = (2, 3, 6)/7, the view (−6, 2, 3)/7.
pub fn asking() -> QueryPoint {
    point(P, Vec3::new(2.0, 3.0, 6.0) / 7.0, Vec3::new(-6.0, 2.0, 3.0) / 7.0)
}

pub fn assert_close<const N: usize>(found: [f32; N], expected: [f64; N], what: &str) {
    for (i, (&f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f64::from(f) - e).abs() <= TOLERANCE * e, "{what} {i}: {f} instead of {e}; all: {found:?}");
    }
}

pub fn check_at(fixture: &Fixture, at: &QueryPoint, visibility: Visibility, weights: [f64; 8], irradiance: [f64; 3]) {
    assert_close(fixture.weights(at, visibility).1, weights, "weight");
    assert_close(fixture.look_up(at, visibility), irradiance, "channel");
}

pub fn check(fixture: &Fixture, weights: [f64; 8], irradiance: [f64; 3]) {
    check_at(fixture, &asking(), Visibility::Stored, weights, irradiance);
}

/// The trilinear weights of the table above, of those corners whose bit is set.
pub fn trilinear(mask: u8) -> [f64; 8] {
    let weights = [15.0, 5.0, 9.0, 3.0, 45.0, 15.0, 27.0, 9.0].map(|w| w / 128.0);
    std::array::from_fn(|i| if mask >> i & 1 == 1 { weights[i] } else { 0.0 })
}

#[test]
fn trilinear_alone() {
    // (15·1 + 5·4 + 9·16 + 3·64 + 45·256 + 15·1024 + 27·4096 + 9·16384)/128, and the like.
    check(&eight(), trilinear(0xFF), [2228.89844, 29.125, 40.125]);
}

#[test]
fn cosine_not_below_its_floor() {
    let mut fixture = eight();
    fixture.settings.direction = DirectionWeight::Cosine { floor: 0.1 };
    // max(1/10, cosine) · trilinear: 1/10·15/128 = 3/256, …, 4/21·3/128 = 1/224, 23/49·45/128 = 1035/6272, …
    let weights =
        [0.01171875, 0.00390625, 0.00703125, 0.00446428571, 0.165019133, 0.0573979592, 0.0387436224, 0.0669642857];
    check(&fixture, weights, [3820.68897, 35.2939276, 30.2755262]);
}

#[test]
fn wrapped_cosine() {
    let mut fixture = eight();
    fixture.settings.direction = DirectionWeight::Wrap { offset: 0.2 };
    // (((cosine + 1)/2)² + 1/5) · trilinear: ((1/21)² + 1/5)·15/128 = 223/9408, …, ((41/42)² + 1/5)·9/128 = 10169/125440.
    let weights =
        [0.0237032313, 0.0115548824, 0.0166135204, 0.0129916029, 0.260077181, 0.0884616761, 0.11607273, 0.0810666454];
    check(&fixture, weights, [3213.47793, 34.3788098, 31.3937829]);
}

#[test]
fn a_probe_at_the_point_has_no_direction() {
    let mut fixture = eight();
    fixture.place(3, P);
    fixture.settings.direction = DirectionWeight::Wrap { offset: 0.2 };
    fixture.moments(1.0, 0.0, |_, _, _| [0.0, 0.0]);
    // ((0 + 1)/2)² + 1/5 = 9/20, times 3/128; distance 0 is not behind mean 0. All others are, without deviation.
    let weights = [0.0, 0.0, 0.0, 0.010546875, 0.0, 0.0, 0.0, 0.0];
    check(&fixture, weights, [64.0, 16.0, 49.0]);
}

#[test]
fn chebyshev_bound_to_a_power() {
    let means = [2.0, 1.0, 3.0, 4.0, 6.0, 5.0, 3.0, 2.0];
    let deviations = [1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 5.0, 3.0];
    let mut fixture = eight();
    // σ²/(σ² + (d − μ)²), 1 where d ≤ μ: 1/2, 1/5, 1, 1, 4/5, 9/13, 25/41, 9/10. Cubes, not below 1/20 (probe 1: 1/125):
    fixture.moments(3.0, 0.05, |i, _, _| [means[i], deviations[i]]);
    let cubed = [0.0146484375, 0.001953125, 0.0703125, 0.0234375, 0.18, 0.0388847007, 0.0478213961, 0.0512578125];
    check(&fixture, cubed, [2624.77054, 29.3098706, 37.2390576]);
    // As they are:
    fixture.moments(1.0, 0.0, |i, _, _| [means[i], deviations[i]]);
    let plain = [0.05859375, 0.0078125, 0.0703125, 0.0234375, 0.28125, 0.0811298077, 0.128620427, 0.06328125];
    check(&fixture, plain, [2409.47664, 29.9563968, 37.6818398]);
    // Not where visibility is off or exact, nor where the file has no distances.
    check_at(&fixture, &asking(), Visibility::Off, trilinear(0xFF), [2228.89844, 29.125, 40.125]);
    check_at(&fixture, &asking(), Visibility::Exact(0xFF), trilinear(0xFF), [2228.89844, 29.125, 40.125]);
    fixture.volume.occlusion = Occlusion::None;
    check(&fixture, trilinear(0xFF), [2228.89844, 29.125, 40.125]);
}

/// Mean and deviation that differ between the four texels of a look-up.
fn mixed_texels(i: usize, column: usize, row: usize) -> [f32; 2] {
    let mean = 1.0 + LENGTHS[i] / 4.0 + column as f32 / 4.0 - row as f32 / 8.0;
    [mean, 0.25 + ((column + 2 * row + i) % 4) as f32 / 4.0]
}

#[test]
fn variance_of_mixed_texels() {
    let mut fixture = eight();
    fixture.moments(1.0, 0.0, mixed_texels);
    // Probe 0 sees P along (2, 1, 2): oct (2/5, 1/5), in texels with border (33/10, 29/10): texel (3, 2) by 7/100, (4, 2) by
    // 3/100, (3, 3) by 63/100, (4, 3) by 27/100. Mean 177/80, variance about it 2533/6400 (of which 61/160 within texels):
    // 2533/(2533 + 6400·(63/80)²) = 0.389572439, · 15/128 = 0.0456530202. Probes 4 to 7 see P from above: lower half.
    // Chebyshev: 0.389572439 0.212264909 0.455739475 0.277124869 0.0117744595 0.0166235267 0.0302497058 0.376786684.
    let weights = [
        0.0456530202,
        0.00829159801,
        0.0320441818,
        0.00649511411,
        0.00413945843,
        0.00194806953,
        0.00638079733,
        0.0264928137,
    ];
    check(&fixture, weights, [3531.93774, 20.182996, 61.9594258]);
}

#[test]
fn biases_move_where_distances_are_compared() {
    let mut fixture = eight();
    fixture.moments(1.0, 0.0, mixed_texels);
    fixture.settings.direction = DirectionWeight::Cosine { floor: 0.1 };
    // Biases are in largest spacings, 4 m: 7/16·4·n = (1/2, 3/4, 3/2) and 7/32·4·(−6, 2, 3)/7 = (−3/4, 1/4, 3/8). Distances
    // and directions in the map are from the probe to P + bias, for probe 0 with both (7/4, 2, 31/8). Cosines (as in
    // `cosine_not_below_its_floor`) and trilinear weights stay those of P.
    // Normal alone, Chebyshev: 0.0512689798 0.0948744212 0.11112235 0.153737883 0.0258478934 0.0192478999 0.0437390232 1.
    (fixture.settings.normal_bias, fixture.settings.view_bias) = (0.4375, 0.0);
    let normal = [
        0.000600808356,
        0.000370603208,
        0.000781329022,
        0.000686329836,
        0.00426539695,
        0.00110479017,
        0.0016946082,
        0.0669642857,
    ];
    check(&fixture, normal, [14468.3206, 59.3090565, 12.877273]);
    // View alone, Chebyshev: 0.275396169 0.0736832553 0.568725071 0.0843832716 0.0238417477 0.0117076259 0.052766232
    // 0.329212739.
    (fixture.settings.normal_bias, fixture.settings.view_bias) = (0.0, 0.21875);
    let view = [
        0.00322729886,
        0.000287825216,
        0.00399884815,
        0.000376711034,
        0.00393434453,
        0.000671993831,
        0.00204435497,
        0.0220454959,
    ];
    check(&fixture, view, [10149.9484, 45.9189599, 27.6050991]);
    // Both, Chebyshev: 0.0378565337 0.0479368679 0.126205429 0.0888470523 0.0451766877 0.0120746186 0.0749171733 1.
    (fixture.settings.normal_bias, fixture.settings.view_bias) = (0.4375, 0.21875);
    let both = [
        0.000443631254,
        0.00018725339,
        0.000887381923,
        0.000396638626,
        0.00745501781,
        0.000693058464,
        0.00290256268,
        0.0669642857,
    ];
    check(&fixture, both, [13908.3332, 58.2359642, 13.3940616]);
}

#[test]
fn biases_choose_the_cell_and_its_weights() {
    let mut fixture = eight();
    fixture.settings.biased_cell = true;
    // P + 4·n/16 = (3/2, 1/2, 15/4) + (1, 3/2, 3)/14 = (11/7, 17/28, 111/28); its fractions (2/7, 45/112, 27/28) give
    // (5/7·67/112·1/28, 2/7·67/112·1/28, …)·21952 = 335, 134, 225, 90, 9045, 3618, 6075, 2430, all without any test.
    fixture.settings.normal_bias = 0.0625;
    let weights = [335.0, 134.0, 225.0, 90.0, 9045.0, 3618.0, 6075.0, 2430.0].map(|w| w / 21952.0);
    // Σ wᵢ·4ⁱ, Σ wᵢ·(i + 1)², Σ wᵢ·(10 − i)².
    let sum = |e: fn(i32) -> f64| weights.iter().enumerate().map(|(i, w)| w * e(i as i32)).sum::<f64>();
    let expected =
        [sum(|i| 4f64.powi(i)), sum(|i| f64::from((i + 1) * (i + 1))), sum(|i| f64::from((10 - i) * (10 - i)))];
    check(&fixture, weights, expected);
    // Towards the viewer too: P + 4·v/32 with v = (−6, 2, 3)/7 lies at x = 3/2 − 3/28, fraction 11/56.
    (fixture.settings.normal_bias, fixture.settings.view_bias) = (0.0, 0.03125);
    let (_, weights) = fixture.weights(&asking(), Visibility::Stored);
    // Corners 1 and 0 differ along x alone: 11/56 against 45/56.
    assert!((f64::from(weights[1] / weights[0]) - 11.0 / 45.0).abs() < TOLERANCE, "{weights:?}");
    // The direction weight is still that from P: that of the cosine stays as in `cosine_not_below_its_floor`.
    let mut turned = eight();
    turned.settings.direction = DirectionWeight::Cosine { floor: 0.1 };
    let (_, plain) = turned.weights(&asking(), Visibility::Stored);
    (turned.settings.normal_bias, turned.settings.biased_cell) = (0.0625, true);
    let (_, biased) = turned.weights(&asking(), Visibility::Stored);
    let flat = trilinear(0xFF);
    let shifted = [335.0, 134.0, 225.0, 90.0, 9045.0, 3618.0, 6075.0, 2430.0].map(|w| w / 21952.0);
    for i in 0..8 {
        let factors = [f64::from(plain[i]) / flat[i], f64::from(biased[i]) / shifted[i]];
        assert!((factors[0] / factors[1] - 1.0).abs() < TOLERANCE, "{i}: {factors:?}");
    }
}

#[test]
fn small_weights_are_crushed() {
    let mut fixture = eight();
    fixture.settings.direction = DirectionWeight::Wrap { offset: 0.0 };
    fixture.settings.crush_below = 0.4;
    // w = ((cosine + 1)/2)²: 1/441, 169/1764, 16/441, 625/1764, 1296/2401, 5329/9604, 841/2401, 1681/1764. Below 2/5, w³/(2/5)²:
    // probe 3: 0.277991, · 3/128; probes 4, 5, 7 stay. The trilinear factor comes after and counts for no threshold.
    let weights = [
        8.5397575e-09,
        0.000214686346,
        2.0987308e-05,
        0.00651531792,
        0.189764681,
        0.0650241761,
        0.056655923,
        0.0670041454,
    ];
    check(&fixture, weights, [3752.4443, 37.0059407, 26.751431]);
    // Not below 1/10 first: probes 0, 1 and 2 become (1/10)³/(2/5)² = 1/160, · 15/128, 5/128, 9/128.
    fixture.settings.weight_floor = 0.1;
    let lifted = [
        0.000732421875,
        0.000244140625,
        0.000439453125,
        0.00651531792,
        0.189764681,
        0.0650241761,
        0.056655923,
        0.0670041454,
    ];
    check(&fixture, lifted, [3741.00068, 36.904841, 26.9347564]);
}

#[test]
fn weights_too_small_for_a_reciprocal_still_have_shares() {
    let mut fixture = eight();
    fixture.settings.weight_floor = 2.0f32.powi(-70);
    fixture.settings.crush_below = 2.0f32.powi(-35);
    // Behind everything: all eight weigh (2⁻⁷⁰)³/(2⁻³⁵)² = 2⁻¹⁴⁰, whose reciprocal is above the largest f32, 2¹²⁸. Times
    // tᵢ, multiples of 2⁻⁷, they are still multiples of the smallest f32, 2⁻¹⁴⁹: nothing is rounded.
    fixture.moments(1.0, 0.0, |_, _, _| [0.0, 0.0]);
    assert_close(fixture.look_up(&asking(), Visibility::Stored), [2228.89844, 29.125, 40.125], "channel");
}

#[test]
fn weights_have_a_floor() {
    let mut fixture = eight();
    fixture.settings.direction = DirectionWeight::Cosine { floor: 0.0 };
    fixture.settings.weight_floor = 0.3;
    // Cosines below 3/10 count as 3/10, before the trilinear factor: 3/10·15/128 = 9/256, …, 23/49·45/128 = 1035/6272.
    let weights = [0.03515625, 0.01171875, 0.02109375, 0.00703125, 0.165019133, 0.0573979592, 0.06328125, 0.0669642857];
    check(&fixture, weights, [3409.77374, 32.6488089, 35.4255676]);
}

#[test]
fn trilinear_weights_have_a_floor_along_each_axis() {
    let mut fixture = eight();
    fixture.settings.trilinear_floor = 0.3;
    // Along x 1/4 becomes 3/10 (corners with bit 0), along z 1/4 becomes 3/10 (corners without bit 2), along y none:
    // 3/4·5/8·3/10 = 9/64, 3/10·5/8·3/10 = 9/160, …
    let weights = [0.140625, 0.05625, 0.084375, 0.03375, 0.3515625, 0.140625, 0.2109375, 0.084375];
    check(&fixture, weights, [2253.31122, 28.3469388, 41.7040816]);
}

#[test]
fn square_roots_are_blended_and_squared() {
    let mut fixture = eight();
    fixture.settings.blend = Blend::SquareRoot;
    // (Σ tᵢ·2ⁱ)² = (4165/128)², (Σ tᵢ·(i + 1))² = 5², (Σ tᵢ·(10 − i))² = 6².
    check(&fixture, trilinear(0xFF), [1058.79059, 25.0, 36.0]);
    // A channel below zero has no root and counts as black: roots lose 45/128 of 16, 5 and 6.
    fixture.store(IrradianceCurve::Linear, |i, _, _| irradiance(i).map(|e| if i == 4 { -e } else { e }));
    check(&fixture, trilinear(0xFF), [724.36676, 10.5117798, 15.1369629]);
}

#[test]
fn irradiance_is_looked_up_around_the_normal() {
    let mut fixture = eight();
    // n = (2, 3, 6)/7: oct (2/11, 3/11), in texels with border column 63/22, row 67/22. Values rise with column and row:
    // 2·63/22 + 16·67/22, 5·63/22 + 3·67/22 and 67/22 more than `trilinear_alone`.
    fixture.store(IrradianceCurve::Linear, |i, c, r| {
        let (e, c, r) = (irradiance(i), c as f32, r as f32);
        [e[0] + 2.0 * c + 16.0 * r, e[1] + 5.0 * c + 3.0 * r, e[2] + r]
    });
    check(&fixture, trilinear(0xFF), [2283.35298, 52.5795455, 43.1704545]);
}

#[test]
fn fifth_powers_are_taken_after_texels_and_before_probes_are_mixed() {
    let mut fixture = eight();
    // Stored (i + 1)/4, (9 − i)/8, 1/2 + i²/32: 2π·Σ tᵢ·sᵢ⁵.
    let stored = |i: usize| [(i + 1) as f32 / 4.0, (9 - i) as f32 / 8.0, 0.5 + (i * i) as f32 / 32.0];
    fixture.store(IrradianceCurve::Gamma5Over2Pi, |i, _, _| stored(i));
    check(&fixture, trilinear(0xFF), [48.4833803, 2.07776499, 35.1639304]);
    // With texels that differ by c/4, r/4 and c·r/8: at column 63/22 and row 67/22, (63·67/22²)/8 for the last.
    fixture.store(IrradianceCurve::Gamma5Over2Pi, |i, c, r| {
        let (s, c, r) = (stored(i), c as f32, r as f32);
        [s[0] + c / 4.0, s[1] + r / 4.0, s[2] + c * r / 8.0]
    });
    check(&fixture, trilinear(0xFF), [296.77821, 44.7350701, 489.97255]);
}

#[test]
fn all_factors_in_their_order() {
    let mut fixture = eight();
    fixture.settings = QuerySettings {
        direction: DirectionWeight::Wrap { offset: 0.05 },
        trilinear_floor: 0.3,
        weight_floor: 0.06,
        crush_below: 0.4,
        blend: Blend::SquareRoot,
        normal_bias: 0.4375,
        view_bias: 0.21875,
        ..fixture.settings
    };
    let means = [4.5, 4.0, 4.0, 3.5, 5.0, 6.0, 5.5, 2.0];
    let deviations = [1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 2.0, 1.0];
    fixture.moments(3.0, 0.1, |i, _, _| [means[i], deviations[i]]);
    fixture.store(IrradianceCurve::Gamma5Over2Pi, |i, _, _| {
        [(i + 1) as f32 / 4.0, (9 - i) as f32 / 8.0, 0.5 + (i * i) as f32 / 32.0]
    });
    // Squared distances to P + bias × 64: 1413, 1429, 1157, 917, 2309, 3157, 2373, 165.
    //   i   wrap      Chebyshev  product   floor, crush   trilinear
    //   0   0.052268  0.962004   0.046533  0.00135        9/64
    //   1   0.145805  0.655304   0.041030  0.00135        9/160
    //   2   0.086281  0.940360   0.071746  0.00230821562  27/320
    //   3   0.404308  0.924754   0.319736  0.204294282    27/800
    //   4   0.589775  0.797916   0.299612  0.168095516    45/128
    //   5   0.604873  0.895759   0.434748  0.434748262    9/64
    //   6   0.400271  0.920146   0.311835  0.189519524    27/128
    //   7   1.002948  1          1.002948  1.00294785     27/320
    let weights = [
        0.00018984375,
        7.59375e-05,
        0.000194755693,
        0.006894932,
        0.0590960799,
        0.0611364744,
        0.0399767746,
        0.0846237245,
    ];
    check(&fixture, weights, [83.5063782, 0.15006085, 64.613497]);
}
