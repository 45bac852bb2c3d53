//! The probe file read by the Python package of its container.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use glam::{DVec3, Vec2, Vec3};
use lightprobe::math::random::{Purpose, Random};
use lightprobe::math::sampling::{triangle_barycentric, uniform_sphere};
use lightprobe::probe::file;
use lightprobe::probe::query::{Query, QueryPoint, Visibility};
use lightprobe::probe::store::surface::Facing;
use lightprobe::scene::{self as scenes, LoadOptions, Scene, TriangleIndex};

use crate::common::Folder;
use crate::program::{bake, scene, text};

pub fn safetensors_opens_a_probe_file() {
    let folder = Folder::new();
    let baked =
        bake(&folder, &scene("furnace"), "--preset physical --set grid.spacing_m=1 --set encoding.irradiance=f32");
    let script = "import sys; from safetensors.numpy import load_file; t = load_file(sys.argv[1]); \
                  print(sorted((k, list(v.shape), float(v.astype('float64').sum())) for k, v in t.items()))";
    let output = Command::new("python3").args(["-c", script, text(&baked.path)]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listed = String::from_utf8(output.stdout).unwrap();
    for (name, tensor) in &baked.file.tensors {
        assert!(listed.contains(&format!("('{name}', {:?}", tensor.shape)), "{name} {:?}: {listed}", tensor.shape);
    }
}

/// A point in world space, its shading normal and its geometric normal.
type Asked = (DVec3, Vec3, Vec3);

/// Points on the scene's surfaces, in the air, and outside of the probes' hull, in equal numbers.
fn points(scene: &Scene, count: u32) -> Vec<Asked> {
    let mut random = Random::new(5, Purpose::Pixel, 0, 0);
    let (low, high) = scene.mesh.bounds().unwrap();
    let mut point = |i: u32| {
        let mut uniform = || random.uniform();
        let bent = uniform_sphere(Vec2::new(uniform(), uniform()));
        let (position, facing) = if i.is_multiple_of(3) {
            let triangle = TriangleIndex((uniform() * scene.mesh.triangles.len() as f32) as u32);
            let place = triangle_barycentric(Vec2::new(uniform(), uniform()));
            let side = if uniform() < 0.5 { 1.0 } else { -1.0 };
            let position = scene.mesh.interpolate(&scene.mesh.positions, triangle, place);
            (position, scene.mesh.geometric_normal(triangle) * side)
        } else {
            let reach = if i % 3 == 1 { 0.0 } else { 0.5 };
            let share = Vec3::new(uniform(), uniform(), uniform()) * (1.0 + 2.0 * reach) - reach;
            (low + (high - low) * share, uniform_sphere(Vec2::new(uniform(), uniform())))
        };
        let normal = (facing + 0.9 * bent).normalize();
        (position.as_dvec3() + scene.origin_world, normal, facing)
    };
    (0..count).map(&mut point).collect()
}

/// Harmonics with gradients.
const FITTED: &str = "--set grid.spacing_m=2 --set fit=rows(rows_per_probe:20,paths:2)";

/// `scripts/readme/read_probes.py`, which is the look-up of src/probe/README.md as a program, and the tool's own look-up:
/// the same at 10,000 points.
pub fn the_script_of_the_readme_asks_as_the_tool_does() {
    let cases = [
        ("two_rooms_sealed", "--preset physical --set grid.spacing_m=1"),
        ("thin_wall", "--preset physical --set grid.spacing_m=0.75 --set encoding.irradiance=f16"),
        (
            "cornell",
            "--preset physical --set grid.divisions=(5,1,4) --set grid.bounds=(min:(-0.4,0.3,-0.4),max:(0.4,0.3,0.4))",
        ),
        ("two_rooms_open", "--preset physical --set grid.spacing_m=1 --set query.test=table(reach_voxels:1,strip:0.5)"),
        ("two_rooms_open", FITTED),
    ];
    let folder = Folder::new();
    let (mut lit, mut dark) = (0, 0);
    for (name, words) in cases {
        let baked = bake(&folder, &scene(name), words);
        let file = file::read(&baked.path).unwrap();
        let volume = file.volume_in_grid();
        let asked = points(&scenes::load(&scene(name), &LoadOptions::default()).unwrap(), 2500);
        let mut lines = String::new();
        for (position, normal, facing) in &asked {
            let numbers = [*position, normal.as_dvec3(), facing.as_dvec3()].map(|v| v.to_array()).concat();
            let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
            writeln!(lines, "{}", words.join(" ")).unwrap();
        }
        let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/readme/read_probes.py");
        let mut child = Command::new("python3")
            .args([text(&script), text(&baked.path), "-"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        // The script answers line by line; it must not wait for a reader while it is still being asked.
        let mut input = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || input.write_all(lines.as_bytes()));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap().unwrap();
        let answers = String::from_utf8(output.stdout).unwrap();
        assert_eq!(answers.lines().count(), asked.len(), "{name}");
        let query = Query { volume, settings: &file.query.weights };
        for ((position, normal, facing), line) in asked.iter().zip(answers.lines()) {
            let local = (*position - volume.grid.origin_world()).as_vec3();
            let (normal, geometric, facing) = (*normal, *facing, Facing::of(*facing));
            let point = QueryPoint { position: local, normal, geometric, facing, view: normal };
            let own = query.irradiance(&point, Visibility::Stored);
            let found: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
            for (own, found) in own.to_array().into_iter().zip(found) {
                // Eight weights and a few dozen f32 products; the fifth power of `gamma5_over_2pi` multiplies by five.
                // Terms of both signs, of some W·m⁻², cancel in sums of harmonics.
                let tolerance = 1e-5 * f64::from(own) + if words == FITTED { 1e-5 } else { 1e-9 };
                assert!((f64::from(own) - found).abs() <= tolerance, "{name}, {position}, {normal}: {own} {found}");
            }
            *if own == Vec3::ZERO { &mut dark } else { &mut lit } += 1;
        }
    }
    assert!(lit > 2500 && dark > 500, "{lit} lit, {dark} dark");
}

/// The example of src/probe/README.md, on the file that its commands make.
pub fn the_example_of_the_probe_file_runs() {
    let folder = Folder::new();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("src/probe/README.md")).unwrap();
    let (_, rest) = readme.split_once("```python\n").unwrap();
    let (example, _) = rest.split_once("```").unwrap();
    std::fs::create_dir(folder.path().join("out")).unwrap();
    let baked = bake(&folder, &scene("two_rooms_sealed"), "--set grid.spacing_m=1");
    std::fs::copy(&baked.path, folder.path().join("out/two_rooms_sealed.probes")).unwrap();
    let output = Command::new("python3").args(["-c", example]).current_dir(folder.path()).output().unwrap();
    let (told, printed) = (String::from_utf8_lossy(&output.stderr), String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success(), "{told}");
    assert!(printed.contains("[10, 5, 6] 300 active") && printed.contains("probe 132 stands at"), "{printed}");
}

/// Without the site's folders Python knows no packages.
pub fn the_script_says_which_package_is_missing() {
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/readme/read_probes.py");
    let output = Command::new("python3").args(["-S", "-E", text(&script)]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("pip install numpy safetensors"), "{told}");
    assert!(!told.contains("Traceback"), "{told}");
}
