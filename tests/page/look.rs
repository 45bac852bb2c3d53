//! The page to look at a bake: driven by mouse, fingers and keys, its shader against the tool's own look-up and pictures.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::Vec3;
use lightprobe::image::Picture8;
use lightprobe::probe::Volume;
use lightprobe::probe::file::{self, ProbeFile};
use lightprobe::probe::query::{Query, QueryPoint, Visibility};
use lightprobe::probe::store::surface::Facing;
use serde_json::Value;
use tempfile::TempDir;

use crate::browser::Opened;
use crate::fixture::HOSTILE;

fn of_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Runs the program with words, and files in place of the words that name them, and gives its JSON.
fn run(words: &str, files: &[(&str, &Path)]) -> Value {
    let word = |word: &str| match files.iter().find(|(name, _)| *name == word) {
        Some((_, path)) => path.to_str().expect("UTF-8").to_owned(),
        None => word.to_owned(),
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightprobe"));
    let output = command.args(words.split_whitespace().map(word)).args(["-q", "--json"]).output().expect("the program");
    assert!(output.status.success(), "{words}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// A bake of two rooms with a doorway, and its page.
struct Rooms {
    folder: TempDir,
    scene: PathBuf,
    html: String,
}

impl Rooms {
    /// `how`: flags of the bake besides the spacing.
    fn baked(how: &str) -> Rooms {
        let (folder, scene) = (tempfile::tempdir().unwrap(), of_project("scenes/two_rooms_open.glb"));
        let (probes, page) = (folder.path().join("rooms.probes"), folder.path().join("rooms.html"));
        let files = [("SCENE", &*scene), ("PROBES", &*probes), ("PAGE", &*page)];
        run(&format!("bake SCENE -o PROBES --set grid.spacing_m=1 {how}"), &files);
        run("view SCENE PROBES -o PAGE", &files);
        let html = fs::read_to_string(&page).unwrap();
        Rooms { folder, scene, html }
    }

    fn quick() -> Rooms {
        Rooms::baked("--set capture.rays.octahedral.resolution=16 --set fit.rows.rows_per_probe=50")
    }

    fn probes(&self) -> ProbeFile {
        file::read(&self.folder.path().join("rooms.probes")).unwrap()
    }
}

/// The page, once it has drawn its first frame.
fn opened(html: &str, width: u32, height: u32) -> Opened {
    let opened = Opened::drawing(html, width, height);
    ready(&opened);
    opened
}

fn ready(opened: &Opened) {
    opened.wait_for("['ready', 'failed', 'lost'].includes(document.getElementById('stage').dataset.state)");
    assert_eq!(opened.text("document.getElementById('state').textContent"), "");
}

fn told(opened: &Opened, key: &str) -> f64 {
    opened.number(&format!("+document.getElementById('stage').dataset.{key}"))
}

pub fn a_bake_is_turned_picked_and_switched() {
    let opened = opened(&Rooms::quick().html, 1280, 900);
    opened.shoot("look-1280-light");
    let at = |x: f64, y: f64| {
        opened.eval("scrollTo({top: 0, behavior: 'instant'})");
        let [left, top, width, height] = opened.place("#view");
        (left + x * width, top + y * height)
    };

    // The mouse turns, with Shift it moves, the wheel comes nearer.
    let before = ["yaw", "pitch", "distance"].map(|key| told(&opened, key));
    opened.drag(at(0.5, 0.5), at(0.6, 0.4));
    ready(&opened);
    assert!(told(&opened, "yaw") < before[0] - 0.1 && told(&opened, "pitch") < before[1] - 0.05);
    let (x, y) = at(0.5, 0.5);
    opened.wheel(x, y, -300.0);
    ready(&opened);
    assert!(told(&opened, "distance") < 0.8 * before[2]);

    // A click without a drag picks: eight probes, whose weights are all of it, and what the light comes to.
    opened.click("#cameras button");
    ready(&opened);
    let (x, y) = at(0.5, 0.6);
    opened.mouse("mouseMoved", x, y);
    opened.mouse("mousePressed", x, y);
    opened.mouse("mouseReleased", x, y);
    ready(&opened);
    let rows = "[...document.querySelectorAll('#probes-table tbody tr')]";
    assert_eq!(opened.number(&format!("{rows}.length")), 8.0);
    for column in [3, 4] {
        let sum = opened
            .number(&format!("{rows}.reduce((sum, row) => sum + parseFloat(row.cells[{column}].textContent), 0)"));
        assert!((sum - 100.0).abs() < 0.5, "weights of column {column} come to {sum} %");
    }
    assert!(opened.text("document.getElementById('told').textContent").contains("W·m⁻² with the exact one."));
    opened.eval("scrollTo({top: 0, behavior: 'instant'})");
    opened.shoot("look-1280-picked");

    // Switches change the picture, and the legend of leaks comes and goes.
    let picture = || opened.text("document.getElementById('view').toDataURL()");
    let on = picture();
    opened.click("input[name=visibility][value=\"0\"]");
    ready(&opened);
    assert_ne!(picture(), on, "without visibility it looks the same");
    opened.click("input[name=show][value=\"2\"]");
    ready(&opened);
    assert!(opened.eval("document.getElementById('leaks').checkVisibility()") == true);
    opened.eval("scrollTo({top: 0, behavior: 'instant'})");
    opened.shoot("look-1280-leaks");
    opened.click("input[name=show][value=\"0\"]");
    opened.click("#probes");
    ready(&opened);
    assert!(opened.eval("document.getElementById('leaks').checkVisibility()") == false);
    opened.assert_quiet();
}

pub fn keys_are_enough_to_look_at_a_bake() {
    let opened = opened(&Rooms::quick().html, 640, 600);
    let mut seen = Vec::new();
    // One more would leave the page.
    for _ in 0..15 {
        opened.key("Tab");
        let focused = opened.text(
            "(() => { const e = document.activeElement; const s = getComputedStyle(e); \
             return [e.id || e.name || e.className || e.getAttribute('href') || e.tagName, s.outlineStyle].join('|'); })()",
        );
        assert!(!focused.ends_with("|none"), "focus is not to be seen: {focused}");
        seen.push(focused);
    }
    let order =
        ["skip|", "#figures|", "theme scripted|", "visibility|", "show|", "probes|", "exposure|", "cut|", "view|"];
    let place =
        |what: &&str| seen.iter().position(|one| one.starts_with(what)).unwrap_or_else(|| panic!("{what} in {seen:?}"));
    assert!(order.iter().map(place).is_sorted(), "{seen:?}");

    opened.eval("document.getElementById('view').focus()");
    let before = told(&opened, "yaw");
    opened.key("ArrowRight");
    assert!(told(&opened, "yaw") > before);
    let before = told(&opened, "distance");
    opened.key("+");
    assert!(told(&opened, "distance") < before);
    for (key, name) in [("1", "off"), ("3", "exact"), ("2", "on")] {
        opened.key(key);
        assert_eq!(opened.text("document.getElementById('stage').dataset.visibility"), name);
    }
    opened.key("Enter");
    assert_eq!(opened.number("look.picked().probes.length"), 8.0);
    opened.key("Escape");
    assert_eq!(opened.eval("look.picked()"), Value::Null);
    ready(&opened);
    opened.assert_quiet();
}

pub fn the_look_at_a_bake_fits_telephones() {
    let opened = opened(&Rooms::quick().html, 390, 844);
    for colors in ["light", "dark"] {
        opened.emulate(colors, "screen");
        let [needed, there] =
            ["document.documentElement.scrollWidth", "innerWidth"].map(|length| opened.number(length));
        assert!(needed <= there, "the page is {needed} px wide in a window of {there} px");
        opened.shoot(&format!("look-390-{colors}"));
    }
    // One finger turns, two come nearer, a tap picks.
    let [left, top, width, height] = opened.place("#view");
    let (x, y) = (left + 0.5 * width, top + 0.5 * height);
    let before = ["yaw", "distance"].map(|key| told(&opened, key));
    opened.touch("touchStart", &[(x, y)]);
    opened.touch("touchMove", &[(x + 40.0, y)]);
    opened.touch("touchMove", &[(x + 80.0, y)]);
    opened.touch("touchEnd", &[]);
    assert!(told(&opened, "yaw") < before[0] - 0.1);
    opened.touch("touchStart", &[(x - 20.0, y), (x + 20.0, y)]);
    opened.touch("touchMove", &[(x - 40.0, y), (x + 40.0, y)]);
    opened.touch("touchMove", &[(x - 60.0, y), (x + 60.0, y)]);
    opened.touch("touchEnd", &[]);
    assert!(told(&opened, "distance") < 0.6 * before[1]);
    assert_eq!(opened.eval("look.picked()"), Value::Null);
    opened.touch("touchStart", &[(x, y)]);
    opened.touch("touchEnd", &[]);
    assert_eq!(opened.number("look.picked().probes.length"), 8.0);
    ready(&opened);
    opened.eval("document.getElementById('point').scrollIntoView({behavior: 'instant'})");
    opened.shoot("look-390-picked");
    opened.assert_quiet();
}

/// Numbers in [0,1) that depend on nothing but how many were drawn before.
struct Chance(u64);

impl Chance {
    fn unit(&mut self) -> f32 {
        // The constants of Knuth's MMIX; the high bits are well mixed.
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn direction(&mut self) -> Vec3 {
        let (z, turn) = (2.0 * self.unit() - 1.0, std::f32::consts::TAU * self.unit());
        let across = (1.0 - z * z).sqrt();
        Vec3::new(across * turn.cos(), across * turn.sin(), z)
    }
}

/// Points in and around the probes' hull that face anywhere, each with a mask.
fn points(volume: &Volume, count: usize) -> Vec<(QueryPoint, u8)> {
    let (low, high) = volume.grid.hull(0.3);
    let mut chance = Chance(1);
    let point = |_| {
        let position = low + (high - low) * Vec3::new(chance.unit(), chance.unit(), chance.unit());
        let geometric = chance.direction();
        let normal = (geometric + 0.5 * chance.direction()).normalize();
        let view = (geometric + chance.direction()).normalize_or(geometric);
        let query = QueryPoint { position, normal, geometric, facing: Facing::of(geometric), view };
        (query, (chance.unit() * 256.0) as u8)
    };
    (0..count).map(point).collect()
}

/// What the page's shader gives for points: irradiance off, on and exact.
fn shaded(opened: &Opened, points: &[(QueryPoint, u8)]) -> Vec<[Vec3; 3]> {
    let mut found = Vec::new();
    for points in points.chunks(1000) {
        let point = |(p, mask): &(QueryPoint, u8)| {
            let [position, normal, geometric, view] = [p.position, p.normal, p.geometric, p.view].map(|v| v.to_array());
            serde_json::json!({ "position": position, "normal": normal, "geometric": geometric, "view": view, "centre": position, "mask": mask })
        };
        let asked = Value::Array(points.iter().map(point).collect());
        let answer = opened.eval(&format!("draw.lookUp({asked}).map((answer) => answer.light)"));
        let lights: Vec<[[f32; 3]; 3]> = serde_json::from_value(answer).unwrap();
        found.extend(lights.into_iter().map(|light| light.map(Vec3::from)));
    }
    found
}

/// Largest differences of the shader from the tool, ÷ mean irradiance, sorted; exact masks only where cells are the points' own.
fn differences(opened: &Opened, probes: &ProbeFile, scene: &Path, count: usize, with_masks: bool) -> Vec<f32> {
    let scene = lightprobe::scene::load(scene, &Default::default()).unwrap();
    let volume = probes.volume_as_planned(scene.origin_world);
    let query = Query { volume: &volume, settings: &probes.query.weights };
    let points = points(&volume, count);
    let modes = if with_masks { 3 } else { 2 };
    let expected = points.iter().map(|(point, mask)| {
        [Visibility::Off, Visibility::Stored, Visibility::Exact(*mask)]
            .map(|visibility| query.irradiance(point, visibility))
    });
    let expected: Vec<[Vec3; 3]> = expected.collect();
    let mean = expected.iter().map(|e| e[0].element_sum() / 3.0).sum::<f32>() / count as f32;
    let found = shaded(opened, &points);
    let pairs = found.iter().zip(&expected);
    let of = |(f, e): (&[Vec3; 3], &[Vec3; 3])| {
        (0..modes)
            .map(|mode| (f[mode] - e[mode]).abs().max_element() / mean.max(e[mode].max_element()))
            .fold(0.0, f32::max)
    };
    let mut differences: Vec<f32> = pairs.map(of).collect();
    differences.sort_by(f32::total_cmp);
    differences
}

/// Told, and judged. A point within rounding of the border between two voxels may be taken for the other one: that is about
/// 6 borders × 8 voxels × 2·10⁻⁷ of all points, so that of ten thousand none or one differs by more than arithmetic does.
fn assert_agree(differences: &[f32], what: &str) {
    let at = |share: f64| differences[(share * (differences.len() - 1) as f64) as usize];
    eprintln!(
        "{what}: median {:.1e}, 99 % {:.1e}, 99.9 % {:.1e}, largest {:.1e}",
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    );
    // Some tens of roundings of f32, a few of them of sums that cancel.
    assert!(at(0.999) < 1e-4, "{what}: {}", at(0.999));
    assert!(
        differences.iter().filter(|d| **d > 1e-3).count() <= 2,
        "{what}: {:?}",
        &differences[differences.len() - 5..]
    );
}

pub fn the_shader_looks_up_as_the_tool_does() {
    let rooms = Rooms::quick();
    let opened = opened(&rooms.html, 640, 480);
    assert_agree(&differences(&opened, &rooms.probes(), &rooms.scene, 10_000, true), "default");
    opened.assert_quiet();
}

pub fn the_shader_knows_the_published_methods() {
    // Directions, floors, crushing, biases, square roots; maps, their fifth root; moments, tiles; a mixed grid; look-ups towards.
    for (preset, how) in [
        ("physical", "--set capture.rays.octahedral.resolution=16"),
        (
            "physical",
            "--set capture.rays.octahedral.resolution=16 --set store.occlusion=moments(resolution:14) \
             --set query.test=chebyshev(power:3,floor:0) --set query.blank_below=1e-6 --set query.distance_bias=0.0025 \
             --set query.direction=cosine(floor:0.05)",
        ),
        ("ddgi-2019", "--set transport.frames.most=64"),
        ("threev8-mixed", "--set capture.rays.cube.face=10"),
        ("threev8-uniform", "--set capture.rays.cube.face=10 --set query.look_up=towards"),
    ] {
        let rooms = Rooms::baked(&format!("--preset {preset} {how}"));
        let opened = opened(&rooms.html, 400, 300);
        // Masks are of the cell that is asked straight on: another one where the view shifts it.
        let with_masks = preset == "physical";
        assert_agree(&differences(&opened, &rooms.probes(), &rooms.scene, 2000, with_masks), preset);
        opened.assert_quiet();
    }
}

pub fn its_picture_is_that_of_render() {
    let rooms = Rooms::quick();
    let opened = opened(&rooms.html, 800, 700);
    let (width, height) = (320, 180);
    opened.eval(&format!(
        "Object.assign(document.getElementById('stage').style, {{ width: '{width}px', height: '{height}px' }})"
    ));
    opened.click("#probes");
    opened.eval("(() => { const e = document.getElementById('exposure'); e.value = 0; e.dispatchEvent(new Event('input')); })()");
    let probes = rooms.folder.path().join("rooms.probes");
    for (i, camera) in ["lit", "dark"].into_iter().enumerate() {
        let folder = rooms.folder.path().join(camera);
        let files = [("SCENE", &*rooms.scene), ("PROBES", &*probes), ("FOLDER", &*folder)];
        run(&format!("render SCENE PROBES -o FOLDER --camera {camera} --size {width}x{height} --exposure 0"), &files);
        opened.click(&format!("#cameras button:nth-of-type({})", i + 1));
        for (mode, name) in ["visibility_off", "visibility_on", "visibility_ray"].into_iter().enumerate() {
            opened.click(&format!("input[name=visibility][value=\"{mode}\"]"));
            ready(&opened);
            let read = format!(
                "(() => {{ const c = document.createElement('canvas'); c.width = {width}; c.height = {height}; const g = c.getContext('2d'); \
                 g.drawImage(document.getElementById('view'), 0, 0); return [...g.getImageData(0, 0, {width}, {height}).data]; }})()"
            );
            let found: Vec<u8> = serde_json::from_value(opened.eval(&read)).unwrap();
            let expected = png(&folder.join(format!("{name}.png")));
            let mut differences: Vec<u8> = expected
                .pixels
                .iter()
                .zip(found.as_chunks::<4>().0)
                .map(|(e, f)| (0..3).map(|k| e[k].abs_diff(f[k])).max().unwrap())
                .collect();
            differences.sort_unstable();
            let at = |share: f64| differences[(share * (differences.len() - 1) as f64) as usize];
            eprintln!(
                "{camera}, {name}: median {}, 95 % {}, 99 % {}, largest {}",
                at(0.5),
                at(0.95),
                at(0.99),
                at(1.0)
            );
            // Both round the same colour; edges of things are smooth in the browser, and those of exact visibility are texels.
            assert!(at(0.5) <= 1 && at(0.95) <= 3, "{camera}, {name}: {} {}", at(0.5), at(0.95));
        }
    }
    opened.assert_quiet();
}

fn png(path: &Path) -> Picture8 {
    let image = image::open(path).unwrap().to_rgb8();
    let (width, height) = image.dimensions();
    Picture8 { width, height, pixels: image.pixels().map(|pixel| pixel.0).collect() }
}

pub fn old_files_are_shown_as_the_tool_looks_them_up() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, probes, page) = (
        of_project("scenes/two_rooms_open.glb"),
        of_project("tests/golden/before_query/surface.probes"),
        folder.path().join("old.html"),
    );
    let files = [("SCENE", &*scene), ("PROBES", &*probes), ("PAGE", &*page)];
    run("view SCENE PROBES -o PAGE", &files);
    let opened = opened(&fs::read_to_string(&page).unwrap(), 640, 600);
    assert!(opened.text("document.querySelector('.note').textContent").contains("files of before query version 4"));
    opened.eval("document.getElementById('view').focus()");
    opened.key("Enter");
    ready(&opened);
    assert!(opened.text("document.getElementById('told').textContent").contains("W·m⁻² with the exact one."));
    opened.assert_quiet();
}

pub fn a_hostile_camera_stays_a_name() {
    // The binary scene with a camera renamed: its JSON grows, so lengths in both headers change.
    let glb = fs::read(of_project("scenes/two_rooms_open.glb")).unwrap();
    let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let (json, rest) = glb[20..].split_at(length(12));
    let mut json: Value = serde_json::from_slice(json).unwrap();
    let node = json["nodes"].as_array_mut().unwrap().iter_mut().find(|node| node["camera"].is_number()).unwrap();
    node["name"] = HOSTILE.into();
    let mut json = serde_json::to_vec(&json).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut made = glb[..8].to_vec();
    made.extend(((20 + json.len() + rest.len()) as u32).to_le_bytes());
    made.extend((json.len() as u32).to_le_bytes());
    made.extend(b"JSON");
    made.extend(&json);
    made.extend(rest);
    let folder = tempfile::tempdir().unwrap();
    let (scene, page) = (folder.path().join("</bdi><img src=x>.glb".replace('/', "")), folder.path().join("page.html"));
    fs::write(&scene, made).unwrap();
    let probes = of_project("tests/golden/two_rooms_open/two_rooms_open.probes");
    let files = [("SCENE", &*scene), ("PROBES", &*probes), ("PAGE", &*page)];
    run("view SCENE PROBES -o PAGE --allow-scene-change", &files);
    let html = fs::read_to_string(&page).unwrap();
    assert!(!html.contains("<img") && !html.contains("</script><img") && !html.contains('\u{202E}'));
    assert_eq!(html.matches("<script").count(), html.matches("</script>").count());
    let links = ["src=", "href=", "url(", "@import", "fetch(", "XMLHttpRequest", "import("];
    for (link, at) in links.iter().flat_map(|link| html.match_indices(link).map(|(at, _)| (*link, at))) {
        let rest = html[at + link.len()..].trim_start_matches(['"', '\'']);
        // The scene's name in the text, the camera's in the data.
        let is_name = ["&lt;img ", "\\u003cimg "].iter().any(|before| html[..at].ends_with(before));
        let is_own = is_name || rest.starts_with("data:") || rest.starts_with('#');
        assert!(is_own, "{link}{}", rest.chars().take(40).collect::<String>());
    }
}
