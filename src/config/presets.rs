//! Presets: configurations compiled in, one file each under `configs/presets/`.

use super::ron_text::ConfigError;

/// A named configuration.
pub struct Preset {
    pub name: &'static str,
    pub summary: &'static str,
    pub(super) text: &'static str,
}

/// The preset of a run that names none.
pub const DEFAULT: &str = "default";

/// The ground that all presets lie on, with every key: [`Config::default`](super::Config::default).
pub const PHYSICAL: &str = "physical";

pub const PRESETS: &[Preset] = &[
    Preset {
        name: DEFAULT,
        summary: "where no preset is given: as physical, but with probes fitted to what look-ups ask, for the least error and bytes",
        text: include_str!("../../configs/presets/default.ron"),
    },
    Preset {
        name: PHYSICAL,
        summary: "octahedral maps of the light where the probes stand, visibility measured at the surfaces",
        text: include_str!("../../configs/presets/physical.ron"),
    },
    Preset {
        name: "path",
        summary: "as physical, but lit by full paths at every hit: the truth at the probes",
        text: include_str!("../../configs/presets/path.ron"),
    },
    Preset {
        name: "mcguire-2017",
        summary: "light-field probes that glossy rays are traced in (McGuire et al. 2017)",
        text: include_str!("../../configs/presets/mcguire-2017.ron"),
    },
    Preset {
        name: "ddgi-2019",
        summary: "dynamic diffuse global illumination, run until it has settled (Majercik et al. 2019, 2021)",
        text: include_str!("../../configs/presets/ddgi-2019.ron"),
    },
    Preset {
        name: "irradiance-2022",
        summary: "irradiance probes from cube maps, one bounce, no visibility (Luo 2022)",
        text: include_str!("../../configs/presets/irradiance-2022.ron"),
    },
    Preset {
        name: "lightfield-2022",
        summary: "light-field probes from cube maps, traced bounces, moments of distance (Luo 2022)",
        text: include_str!("../../configs/presets/lightfield-2022.ron"),
    },
    Preset {
        name: "threev8-uniform",
        summary: "Three.V8 (Fei Yang 2023): spherical harmonics, tiles of distance",
        text: include_str!("../../configs/presets/threev8-uniform.ron"),
    },
    Preset {
        name: "threev8-mixed",
        summary: "the same on a grid that is fine only where surfaces are",
        text: include_str!("../../configs/presets/threev8-mixed.ron"),
    },
];

/// Presets that `all` does not mean: the truth at the probes, which methods are compared with, and one whose probes have
/// 8 MiB each, which only small grids can be made of.
const APART: &[&str] = &["path", "mcguire-2017"];

/// What `all` stands for.
pub fn methods() -> impl Iterator<Item = &'static Preset> {
    PRESETS.iter().filter(|preset| !APART.contains(&preset.name))
}

/// The preset of a name.
///
/// # Errors
/// There is none.
pub fn find(name: &str) -> Result<&'static Preset, ConfigError> {
    let known = || PRESETS.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
    PRESETS
        .iter()
        .find(|preset| preset.name == name)
        .ok_or_else(|| ConfigError::NoPreset { name: name.to_owned(), known: known() })
}
