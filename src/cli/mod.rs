//! The command line: what was typed. `commands/` turns it into what it means.

mod convert;
mod export;
mod inspect;
mod look;
pub mod topics;
mod trace;
mod values;

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};

pub use self::convert::{ConvertArgs, LatticeName};
pub use self::export::{EngineName, ExportArgs, TargetName, VolumesName};
pub use self::inspect::{HelpArgs, InspectArgs};
pub use self::look::LookArgs;
pub use self::trace::TraceArgs;
pub use self::values::{LookAt, PictureSize, TraceRay};
use self::values::{
    parse_exposure, parse_index, parse_most_probes, parse_positive, parse_samples, parse_seconds, parse_seeds,
    parse_size, parse_target_error,
};

/// Bakes light-field probe volumes for global illumination and measures how much they leak, err and cost.
#[derive(Debug, Parser)]
#[command(name = "lightprobe", version, propagate_version = true, arg_required_else_help = true)]
#[command(disable_help_subcommand = true, after_help = topics::list())]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub output: OutputFlags,
}

#[derive(Debug, Args)]
pub struct OutputFlags {
    /// Print no warnings and draw no progress bars.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Print what the program decides and how long it takes.
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Never draw progress bars (they appear on terminals only).
    #[arg(long, global = true)]
    pub no_progress: bool,
    /// Print the report as JSON on standard output instead of tables.
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Bake a glTF scene into a probe file.
    Bake(BakeArgs),
    /// Shade a picture of the scene with probes, without and with visibility, and report leaks, times and bytes.
    Render(RenderArgs),
    /// Path-trace a picture of the scene: the truth that probes are compared with.
    ///
    /// Every surface is lit by paths of any length, on the same geometry, lights and materials as in `bake` and
    /// `render`, through the same pixel centres, so that pictures subtract. The file has the layers of `render`'s
    /// pictures and, from 32 samples per pixel on, `beauty_variance` and `irradiance_indirect_variance`: the variance of
    /// each pixel's mean. It also carries its own state, so that --resume can add samples later.
    ///
    /// Progress is saved to FILE.exr every minute.
    Reference(ReferenceArgs),
    /// Bake many configurations and set their errors against run time, bytes and leaks.
    ///
    /// All are compared with one path-traced reference, each with several seeds. Finished runs are kept in DIR/runs: a sweep
    /// that was interrupted, or has got more configurations or seeds, runs only what is missing.
    Sweep(SweepArgs),
    /// Compare two results and judge by thresholds whether lighting, leaks, errors or costs got worse.
    ///
    /// Both sides are folders of `render`, reports of `bake`, probe files, sweeps, single images (EXR, HDR, PNG), or
    /// folders of these, matched by name. Exits with 0 within thresholds, 1 beyond them, 2 when the sides cannot be
    /// compared.
    DiffReport(DiffArgs),
    /// Put the probes of a mixed grid on the uniform grid of its finest cells.
    ///
    /// Irradiance is copied to every cell that a probe stands for; distances are copied where it stands for one, and traced
    /// again elsewhere.
    Convert(ConvertArgs),
    /// Write probes as an engine takes them.
    ///
    /// Axes are glTF's: right-handed, +Y up, metres, linear Rec. 709. Probes hold all light that bounced, and that of emissive
    /// surfaces and of the sky: the engine adds punctual lights with shadows, and no ambient light or environment.
    ///
    /// three: spherical harmonics of radiance for LightProbeGrid of three.js 0.187, with a loader and a page; materials
    /// divide by π. bevy: irradiance ÷ π for IrradianceVolume of Bevy 0.20 (KTX2); its shader does not divide. ddgi: the
    /// textures of RTXGI (DDS; EXR to look at): irradiance ÷ 2π, to the power 1/5. exr: all maps in one picture, W·m⁻².
    ///
    /// three and Bevy blend probes by distance alone, so that light comes through walls between probes. --fit chooses the values
    /// by which that is right as far as can be, --volumes auto keeps rooms apart; `render --as` says how right.
    Export(ExportArgs),
    /// Write a page to look at a bake: one HTML file that any browser with WebGL 2 opens, without a network.
    ///
    /// It shows the scene, lit by the probes with visibility off, on and exact, what leaks, the probes in their own light, and
    /// of any point its eight probes, their weights and which of them are hidden. Surfaces ask the probes in the browser; exact
    /// visibility is traced here, at texels of about a 64th of the spacing, or larger where the scene has more than 1,048,576.
    ///
    /// Of more than 524,288 triangles the largest are shown. Normal maps and gloss are not.
    View(LookArgs),
    /// Print what a probe file holds, and check its hashes.
    Inspect(InspectArgs),
    /// Explain a command or a topic; without a name list both.
    Help(HelpArgs),
}

/// Flags that choose a configuration.
#[derive(Debug, Args)]
pub struct ConfigArgs {
    /// Configuration file over the preset; only the keys that stand in it count. See `lightprobe help configuration`.
    #[arg(long, value_name = "FILE.ron")]
    pub config: Option<PathBuf>,
    /// Built-in configuration that all else lies over, `default` where none is named; `list` prints their names.
    #[arg(long, value_name = "NAME|list")]
    pub preset: Option<String>,
    /// Override one key of the configuration, for example grid.spacing_m=0.5; may be repeated.
    ///
    /// Applied last, in order. Values are RON or JSON: grid.divisions=(8,4,8), "query.visibility=moments(power: 3)".
    /// grid.spacing_m=None takes back a key that may be left open.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

/// Flags of every command that makes a picture.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Camera of the scene by name or number, the first where not given; `render` takes `all` (a subfolder each).
    ///
    /// A scene without cameras gets one, with a warning.
    #[arg(long, value_name = "NAME|INDEX|all", conflicts_with = "look_at", allow_negative_numbers = true)]
    pub camera: Option<String>,
    /// Camera by origin and target, metres in world space, and vertical field of view in degrees (60 where not given).
    #[arg(long, value_name = "ox,oy,oz,tx,ty,tz[,fov]", value_parser = LookAt::from_str, allow_hyphen_values = true)]
    pub look_at: Option<LookAt>,
    /// Size of the pictures in pixels, sides up to 16384.
    #[arg(long, value_name = "WxH", default_value = "640x360", value_parser = PictureSize::from_str, allow_hyphen_values = true)]
    pub size: PictureSize,
}

#[derive(Debug, Args)]
pub struct BakeArgs {
    /// Scene: a .glb or .gltf file.
    #[arg(value_name = "SCENE", required_unless_present_any = ["print_config", "preset"])]
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Probe file to write.
    #[arg(short, long, value_name = "OUT.probes", required_unless_present_any = ["dry_run", "print_config", "preset"])]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub config: ConfigArgs,
    /// Choose the spacing, and rows of a fit or rays, for this relative error: RMSE of the indirect irradiance over the scene's
    /// surfaces ÷ its mean.
    ///
    /// Bakes from the configuration's spacing on, at most eight times, finer or coarser, and measures each bake at points by
    /// path tracing. Writes the smallest file that reaches E. Where none does, it writes the best, warns and says why.
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = parse_target_error)]
    pub target_error: Option<f64>,
    /// Most probes of a grid that --target-error may choose, times its samples ÷ those of the configuration.
    #[arg(long, value_name = "N", default_value_t = 65_536, allow_negative_numbers = true, requires = "target_error", value_parser = parse_most_probes)]
    pub max_probes: u64,
    /// Also write the report to this file.
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Print the plan with predicted time (bounces included) and memory (captures, maps, scene), and stop.
    #[arg(long)]
    pub dry_run: bool,
    /// Print the effective configuration, and stop.
    #[arg(long)]
    pub print_config: bool,
    /// Also trace the capture's rays with bare Embree and report their rate.
    #[arg(long)]
    pub measure_raw: bool,
    /// Memory that the program is to take at most, such as 2GiB; as much as the machine has where not given.
    ///
    /// Captured surfaces that do not fit are kept in OUT.probes.resume, and what else is needed is taken in any case: the
    /// result is the same. --dry-run says how much that is.
    #[arg(long, value_name = "SIZE", value_parser = parse_size, allow_hyphen_values = true)]
    pub memory_budget: Option<u64>,
    /// Continue an interrupted bake of the same scene, configuration and seed from OUT.probes.resume: the result is that of
    /// one run.
    ///
    /// Captured probes, iterations and the paths of a fit are not computed again; placement and the survey are.
    #[arg(long)]
    pub resume: bool,
    /// Save the work to OUT.probes.resume once the bake takes longer than this, and iterations as often: seconds, 0 for at
    /// once. The file is removed when the bake is done.
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = parse_seconds, allow_negative_numbers = true)]
    pub checkpoint_every: Duration,
}

#[derive(Debug, Args)]
pub struct RenderArgs {
    /// Scene: a .glb or .gltf file.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Probe file that `bake` wrote, or a folder that `export` wrote: then all rows are of the engine's look-up.
    #[arg(value_name = "PROBES|DIR")]
    pub probes: PathBuf,
    /// Also shade as an engine would after `export`, without --fit, and report leak, error and bytes of that.
    #[arg(long = "as", value_enum, value_name = "ENGINE")]
    pub engine: Option<EngineName>,
    /// Folder for pictures and report; created where missing.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub view: ViewArgs,
    /// Exposure of the PNG pictures, in powers of two; from the picture where not given.
    ///
    /// Then it brings the log-average of the surfaces in the reference to 18 % grey, without one that of the picture with
    /// exact visibility. A sky behind them does not count.
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse_exposure)]
    pub exposure: Option<f32>,
    /// Path-trace a reference of every camera with SPP samples per pixel, and report how far the probes are from it.
    ///
    /// Rounded up to a multiple of 16; from 32 on figures have standard errors.
    #[arg(long, value_name = "SPP", allow_negative_numbers = true, conflicts_with = "reference_image", value_parser = parse_samples)]
    pub reference: Option<u32>,
    /// The same with a reference that is there: of this camera and size, as `reference` or --reference wrote it.
    ///
    /// It needs the layers `irradiance_indirect` and `beauty`. A file that names another scene or camera is refused.
    #[arg(long, value_name = "FILE.exr")]
    pub reference_image: Option<PathBuf>,
    /// Also light the probes themselves by full paths, and report how far the file's are from that.
    ///
    /// Takes longer than all else. Eight runs trace a path from every captured hit, or SPP/128 paths with --reference SPP. The
    /// report gains an entry with these probes under exact visibility: its error is interpolation. Not for fitted presets.
    #[arg(long)]
    pub bake_error: bool,
    /// Render although the scene's files or its sky are not those of the bake.
    #[arg(long)]
    pub allow_scene_change: bool,
}

#[derive(Debug, Args)]
pub struct ReferenceArgs {
    /// Scene: a .glb or .gltf file.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Picture to write, in layers; the name ends in .exr.
    #[arg(short, long, value_name = "FILE.exr")]
    pub output: PathBuf,
    /// Samples per pixel in all, those of a resumed file included. Rounded up to a multiple of 16; 1 to 15 are taken as
    /// they are, for a quick look without a known error.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_samples)]
    pub spp: u32,
    /// Reflection: `lambert` as in probes, every surface diffuse; `gltf` as glTF 2.0 defines metallic-roughness materials
    /// (appendix B: GGX with Smith's shadowing over a diffuse base), with a layer `glossy` too. Only where the appendix
    /// would reflect more light than arrives, its base is darker.
    #[arg(long, value_enum, default_value = "lambert")]
    pub transport: TransportName,
    #[command(flatten)]
    pub view: ViewArgs,
    /// Most reflections between a light and the surface in the picture; all where not given. 0 leaves light that comes
    /// straight from emitters and the sky.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_index)]
    pub max_bounces: Option<u32>,
    /// Scale samples down that bring more irradiance than this, W·m⁻²: hides rare bright pixels, and makes the picture
    /// too dark. Off where not given.
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = parse_positive)]
    pub firefly_clamp: Option<f32>,
    /// Continue FILE.exr, made of the same scene with the same arguments, up to --spp samples: the result is that of one
    /// run. Without the file it begins anew.
    #[arg(long)]
    pub resume: bool,
    /// Also write the report to this file.
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Of the configuration only `lights` and `materials` count.
    #[command(flatten)]
    pub config: ConfigArgs,
}

/// Models of reflection by the names of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum TransportName {
    Lambert,
    Gltf,
}

#[derive(Debug, Args)]
pub struct SweepArgs {
    /// Scene: a .glb or .gltf file.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Folder for reference, runs, report, table and plots; created where missing.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Built-in configuration to compare, may be repeated; `all`: every method, which leaves out `path`, the truth at the
    /// probes. `default` where neither --preset nor a base in the ladder is given; --config then lies over that.
    #[arg(long, value_name = "NAME|all")]
    pub preset: Vec<String>,
    /// Configuration file to compare, may be repeated. With --preset it lies over each of them, as a scene's own does.
    #[arg(long, value_name = "FILE.ron")]
    pub config: Vec<PathBuf>,
    /// Ladders: which keys of the configurations take which values.
    #[arg(long, value_name = "FILE.ron")]
    pub ladder: Option<PathBuf>,
    /// Override one key of all configurations; may be repeated. An axis of the ladder with the same key wins.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Compare on equal grids (all methods take bounds and spacing of the first) or at equal bytes.
    #[arg(long, value_enum)]
    pub equal: Option<EqualName>,
    /// Samples per pixel of the reference, rounded up to a multiple of 16. More are added to one that is there.
    #[arg(long, value_name = "SPP", default_value_t = 256, allow_negative_numbers = true, value_parser = parse_samples)]
    pub reference: u32,
    /// Bakes of every configuration, with the seeds from --seed on. From 2 on, noise is told from bias.
    #[arg(long, value_name = "N", default_value_t = 3, allow_negative_numbers = true, value_parser = parse_seeds)]
    pub seeds: u32,
    /// Bake every configuration on N grids, shifted by fractions of a cell that --seed chooses, and report geometric means:
    /// how planes of probes meet walls decides much of the error.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seeds)]
    pub offsets: Option<u32>,
    #[command(flatten)]
    pub view: ViewArgs,
}

/// What is held equal between methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum EqualName {
    Positions,
    Bytes,
}

#[derive(Debug, Args)]
pub struct DiffArgs {
    /// What was accepted: a folder or a file.
    #[arg(value_name = "BASE")]
    pub base: PathBuf,
    /// What is to be judged, of the same kind.
    #[arg(value_name = "CANDIDATE")]
    pub candidate: PathBuf,
    /// Folder for index.html, diff.json, diff.md, junit.xml and the difference maps; created where missing.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Thresholds that go over the defaults, in the form of configs/diff.ron.
    #[arg(long, value_name = "FILE.ron")]
    pub thresholds: Option<PathBuf>,
    /// Do not fail because the scene has changed; its light is judged all the same.
    #[arg(long)]
    pub allow_scene_change: bool,
    /// Judge only the pixels of images that are white in this one, which must be of their size.
    #[arg(long, value_name = "FILE.png")]
    pub mask: Option<PathBuf>,
    /// Put CANDIDATE in the place of BASE once they are compared, and exit with 0 whatever the verdict. A crash leaves
    /// the old BASE or the new one; sides that cannot be compared leave it alone.
    #[arg(long)]
    pub update_baseline: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes_and_views_are_checked() {
        assert_eq!("64x36".parse(), Ok(PictureSize { width: 64, height: 36 }));
        assert!(
            "0x5".parse::<PictureSize>().is_err()
                && "64".parse::<PictureSize>().is_err()
                && "99999x5".parse::<PictureSize>().is_err()
        );
        assert_eq!("0,1,2,3,4,5".parse::<LookAt>().unwrap().fov_y_deg, 60.0);
        for bad in ["0,1,2", "0,0,0,0,0,0", "0,1,2,3,4,5,180", "0,1,nan,3,4,5"] {
            assert!(bad.parse::<LookAt>().is_err(), "{bad}");
        }
    }
}
