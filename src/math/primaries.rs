//! Primaries of RGB, and the matrix from those of a file to Rec. 709.

use glam::{DMat3, DVec2, DVec3};

/// CIE 1931 chromaticities xy of the primaries and the white of linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Primaries {
    pub red: DVec2,
    pub green: DVec2,
    pub blue: DVec2,
    pub white: DVec2,
}

/// Half a unit of the third decimal, to which files round chromaticities.
const ROUNDING: f64 = 5e-4;

/// Least determinant of the primaries' chromaticities, twice the area of their triangle: 1/200 of Rec. 709's, which is 0.22.
/// Below it the primaries are on one line, up to the digits in which files give them.
const MIN_DETERMINANT: f64 = 1e-3;

/// From XYZ to the responses of sharpened cones, which adaptation scales (Bradford: Lam 1985; ICC.1:2022, annex E).
const BRADFORD: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

impl Primaries {
    /// ITU-R BT.709-6, items 1.3 and 1.4; the white is D65.
    pub const REC_709: Primaries = Primaries {
        red: DVec2::new(0.64, 0.33),
        green: DVec2::new(0.30, 0.60),
        blue: DVec2::new(0.15, 0.06),
        white: DVec2::new(0.3127, 0.3290),
    };

    /// The tristimulus values themselves as "RGB". Their white only fixes the unit of each channel.
    pub const XYZ: Primaries = Primaries {
        red: DVec2::new(1.0, 0.0),
        green: DVec2::new(0.0, 1.0),
        blue: DVec2::new(0.0, 0.0),
        white: DVec2::new(1.0 / 3.0, 1.0 / 3.0),
    };

    /// The numbers in the order red x, red y, green x, …, white y.
    pub fn from_array(xy: [f64; 8]) -> Primaries {
        let [red, green, blue, white] = [0, 2, 4, 6].map(|at| DVec2::new(xy[at], xy[at + 1]));
        Primaries { red, green, blue, white }
    }

    /// The matrix from linear RGB of these primaries to Rec. 709.
    ///
    /// White becomes white: where the whites differ, light is adapted by Bradford's matrix. Tristimulus values describe
    /// light without reference to a white, so [`Primaries::XYZ`] are not adapted. Primaries that equal those of Rec. 709
    /// to three decimals give the identity. `None` if the primaries span no colours.
    pub fn rec_709_from_rgb(&self) -> Option<DMat3> {
        if self.is_about(&Primaries::REC_709) {
            return Some(DMat3::IDENTITY);
        }
        let adaptation = match self.is_about(&Primaries::XYZ) {
            true => DMat3::IDENTITY,
            false => adaptation(xyz_of(self.white), xyz_of(Primaries::REC_709.white)),
        };
        let matrix = Primaries::REC_709.xyz_from_rgb()?.inverse() * adaptation * self.xyz_from_rgb()?;
        matrix.is_finite().then_some(matrix)
    }

    /// RGB (1, 1, 1) gets the white's chromaticity and luminance 1 (SMPTE RP 177). `None` if the primaries lie on a line.
    fn xyz_from_rgb(&self) -> Option<DMat3> {
        let column = |xy: DVec2| DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y);
        let unscaled = DMat3::from_cols(column(self.red), column(self.green), column(self.blue));
        let spans = unscaled.determinant().abs() >= MIN_DETERMINANT;
        spans.then(|| unscaled * DMat3::from_diagonal(unscaled.inverse() * xyz_of(self.white)))
    }

    fn is_about(&self, other: &Primaries) -> bool {
        let all = |p: &Primaries| [p.red, p.green, p.blue, p.white];
        all(self).iter().zip(all(other)).all(|(a, b)| a.abs_diff_eq(b, ROUNDING))
    }
}

/// XYZ of luminance 1. Not finite if y is 0.
fn xyz_of(white: DVec2) -> DVec3 {
    DVec3::new(white.x, white.y, 1.0 - white.x - white.y) / white.y
}

fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    BRADFORD.inverse() * DMat3::from_diagonal((BRADFORD * to) / (BRADFORD * from)) * BRADFORD
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: DVec3, expected: [f64; 3], tolerance: f64) {
        assert!(found.abs_diff_eq(DVec3::from(expected), tolerance), "{found} instead of {expected:?}");
    }

    #[test]
    fn tristimulus_values_become_rec_709() {
        let matrix = Primaries::XYZ.rec_709_from_rgb().unwrap();
        // IEC 61966-2-1, which inverts a matrix that it has rounded to four decimals.
        assert_close(matrix.x_axis, [3.2406, -0.9689, 0.0557], 5e-4);
        assert_close(matrix.y_axis, [-1.5372, 1.8758, -0.2040], 5e-4);
        assert_close(matrix.z_axis, [-0.4986, 0.0415, 1.0570], 5e-4);
    }

    #[test]
    fn aces_keeps_its_white() {
        // AP1 (ACES, S-2014-004).
        let ap1 = Primaries::from_array([0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767]);
        let matrix = ap1.rec_709_from_rgb().unwrap();
        assert_close(matrix * DVec3::ONE, [1.0, 1.0, 1.0], 1e-12);
        // The Academy's matrix from AP1 to Rec. 709 with Bradford's adaptation, rounded to four decimals.
        assert_close(matrix.x_axis, [1.7051, -0.1303, -0.0240], 2e-4);
        assert_close(matrix.y_axis, [-0.6218, 1.1408, -0.1290], 2e-4);
        assert_close(matrix.z_axis, [-0.0833, -0.0105, 1.1530], 2e-4);
    }

    #[test]
    fn rec_709_is_left_alone() {
        let rounded = Primaries { white: DVec2::new(0.313, 0.329), ..Primaries::REC_709 };
        assert_eq!(rounded.rec_709_from_rgb(), Some(DMat3::IDENTITY));
        let moved = Primaries { green: DVec2::new(0.21, 0.71), ..Primaries::REC_709 };
        assert_close(moved.rec_709_from_rgb().unwrap() * DVec3::ONE, [1.0, 1.0, 1.0], 1e-12);
    }

    #[test]
    fn primaries_without_colours_are_refused() {
        for bad in [
            Primaries { green: DVec2::new(0.395, 0.195), ..Primaries::REC_709 },
            Primaries { green: Primaries::REC_709.red, ..Primaries::REC_709 },
            Primaries { white: DVec2::new(0.3, 0.0), ..Primaries::REC_709 },
            Primaries { white: DVec2::NAN, ..Primaries::REC_709 },
            Primaries::from_array([0.0; 8]),
        ] {
            assert_eq!(bad.rec_709_from_rgb(), None, "{bad:?}");
        }
    }
}
