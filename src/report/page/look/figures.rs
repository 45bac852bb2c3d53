//! Figures of a page.

use serde::Serialize;

use crate::math::color::luminance;
use crate::shade::texels::Texel;

/// What leaks over the surfaces that a page shows, by area.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// Σ max(0, E − Ê) ÷ ΣÊ; `null` where ΣÊ is 0.
    pub light: Option<f64>,
    /// Σ max(0, Ê − E) ÷ ΣÊ.
    pub dark: Option<f64>,
    /// Share of the area that sees none of its probes, and is left out of both.
    pub unseen: f64,
}

/// Leaks without visibility and with the file's.
pub fn leaks(texels: &[Texel]) -> [Figures; 2] {
    [0, 1].map(|mode| {
        let (mut light, mut dark, mut exact, mut unseen, mut area) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for texel in texels {
            let weight = f64::from(texel.area_m2);
            area += weight;
            if texel.mask == 0 {
                unseen += weight;
                continue;
            }
            let [own, best] = [mode, 2].map(|mode| f64::from(luminance(texel.irradiance[mode])));
            light += weight * (own - best).max(0.0);
            dark += weight * (best - own).max(0.0);
            exact += weight * best;
        }
        let share = |sum: f64| (exact > 0.0).then(|| sum / exact);
        Figures { light: share(light), dark: share(dark), unseen: if area > 0.0 { unseen / area } else { 0.0 } }
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn leaks_are_weighed_by_area() {
        let texel = |mask, off: f32, on: f32, exact: f32, area_m2| Texel {
            mask,
            albedo: Vec3::ONE,
            own: Vec3::ZERO,
            irradiance: [off, on, exact].map(Vec3::splat),
            area_m2,
        };
        let [off, on] =
            leaks(&[texel(3, 2.0, 1.0, 1.0, 3.0), texel(1, 0.0, 1.0, 2.0, 1.0), texel(0, 9.0, 9.0, 0.0, 1.0)]);
        // Exact light is 3·1 + 1·2; without visibility 3·1 too much and 1·2 too little, with it 1·1 too little.
        let close = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-6;
        assert!(close(off.light, 0.6) && close(off.dark, 0.4) && close(on.light, 0.0) && close(on.dark, 0.2));
        assert!((on.unseen - 0.2).abs() < 1e-6);
    }
}
