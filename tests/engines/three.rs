//! three.js with WebGL 2 in a headless browser.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use glam::Vec3;
use headless_chrome::protocol::cdp::Page::CaptureScreenshotFormatOption;
use headless_chrome::protocol::cdp::types::Event;
use headless_chrome::{Browser, LaunchOptions, Tab};
use lightprobe::image::LayeredImage;
use serde_json::Value;
use tempfile::TempDir;

use crate::needs::browser;
use crate::server::Server;

const PATIENCE: Duration = Duration::from_secs(120);
const SIZE: (u32, u32) = (96, 54);

/// The folder of npm's package three.
pub fn package() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("LIGHTPROBE_THREE")?);
    folder.join("build/three.module.js").is_file().then_some(folder)
}

fn run(words: &str, paths: &[(&str, &Path)]) -> Value {
    let word = |word: &str| match paths.iter().find(|(name, _)| *name == word) {
        Some((_, path)) => path.to_str().expect("UTF-8").to_owned(),
        None => word.to_owned(),
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightprobe"));
    let output = command.args(words.split_whitespace().map(word)).args(["-q", "--json"]).output().expect("the program");
    assert!(output.status.success(), "{words}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Two rooms with a door, fitted for three.js, in a folder.
fn exported(folder: &Path) -> PathBuf {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_rooms_open.glb");
    let (probes, export) = (folder.join("rooms.probes"), folder.join("export"));
    let paths = [("SCENE", &*scene), ("PROBES", &*probes), ("EXPORT", &*export)];
    run("bake SCENE -o PROBES --set grid.spacing_m=1 --set capture.rays.octahedral.resolution=16", &paths);
    run("export PROBES --to three -o EXPORT --scene SCENE --fit --set fit.rows.rows_per_probe=50", &paths);
    export
}

struct Page {
    tab: Arc<Tab>,
    complaints: Arc<Mutex<Vec<String>>>,
    _browser: Browser,
    _profile: TempDir,
}

impl Page {
    fn open(address: &str) -> Page {
        let profile = tempfile::tempdir().unwrap();
        // WebGL by software, on machines without a graphics card too.
        let args =
            ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-quic"];
        let options = LaunchOptions {
            path: browser(),
            sandbox: false,
            user_data_dir: Some(profile.path().join("profile")),
            window_size: Some((1280, 800)),
            args: args.map(OsStr::new).to_vec(),
            idle_browser_timeout: 5 * PATIENCE,
            enable_gpu: true,
            ..LaunchOptions::default()
        };
        let browser = Browser::new(options).expect("the browser starts");
        let tab = browser.new_tab().expect("a tab");
        tab.set_default_timeout(PATIENCE);
        let complaints: Arc<Mutex<Vec<String>>> = Arc::default();
        let own = complaints.clone();
        let listener = move |event: &Event| match event {
            Event::RuntimeExceptionThrown(thrown) => {
                own.lock().unwrap().push(format!("{:?}", thrown.params.exception_details));
            }
            Event::RuntimeConsoleAPICalled(called) => own.lock().unwrap().push(format!("{:?}", called.params.args)),
            _ => {}
        };
        tab.add_event_listener(Arc::new(listener)).unwrap();
        tab.enable_runtime().unwrap();
        tab.navigate_to(address).unwrap().wait_until_navigated().unwrap();
        Page { tab, complaints, _browser: browser, _profile: profile }
    }

    fn eval(&self, expression: &str) -> Value {
        let found = self.tab.evaluate(expression, true);
        let found =
            found.unwrap_or_else(|error| panic!("{expression}: {error}; {:?}", self.complaints.lock().unwrap()));
        found.value.unwrap_or(Value::Null)
    }

    fn wait_for(&self, condition: &str) {
        let started = Instant::now();
        while self.eval(condition) != Value::Bool(true) {
            let complaints = self.complaints.lock().unwrap();
            assert!(started.elapsed() < PATIENCE, "never came true: {condition}; {complaints:?}");
            drop(complaints);
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn shoot(&self, name: &str) {
        let Some(folder) = std::env::var_os("LIGHTPROBE_PAGE_SHOTS").map(PathBuf::from) else { return };
        let shot = self.tab.capture_screenshot(CaptureScreenshotFormatOption::Png, None, None, true).unwrap();
        fs::write(folder.join(format!("{name}.png")), shot).unwrap();
    }
}

fn serve(export: &Path) -> Server {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/engines");
    let three = package().expect("these tests run where three.js is");
    Server::new(vec![("/node_modules/three/", three), ("/", export.to_owned()), ("/", own)])
}

pub fn pixels_of_three_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let export = exported(folder.path());
    let server = serve(&export);
    let page = Page::open(&format!("{}/compare.html", server.address));
    page.wait_for("window.ready === true");
    let (width, height) = SIZE;
    let mut unit = 0.0;
    for camera in ["lit", "dark"] {
        let scene = export.join("scene.glb");
        let shaded = folder.path().join(camera);
        let paths = [("SCENE", &*scene), ("EXPORT", &*export), ("SHADED", &*shaded)];
        run(&format!("render SCENE EXPORT -o SHADED --camera {camera} --size {width}x{height}"), &paths);
        let image = LayeredImage::read_exr(&shaded.join("visibility_on.exr")).unwrap();
        let expected = image.layer("irradiance_indirect").unwrap();
        let text = page.eval(&format!("irradiance('{camera}', {width}, {height}).then(JSON.stringify)"));
        let found: Vec<f32> = serde_json::from_str(text.as_str().expect("text")).unwrap();
        let found: Vec<Vec3> = found.as_chunks::<3>().0.iter().map(|p| Vec3::from(*p)).collect();
        assert_eq!(found.len(), expected.len());
        let mean = expected.iter().map(|e| e.element_sum() / 3.0).sum::<f32>() / expected.len() as f32;
        // Of the lit room, whose probes those of the dark one are blended with.
        unit = f32::max(unit, mean);
        let mut differences: Vec<f32> =
            found.iter().zip(expected).map(|(a, b)| (*a - *b).abs().max_element() / unit).collect();
        differences.sort_by(f32::total_cmp);
        let at = |share: f64| differences[(share * (differences.len() - 1) as f64) as usize];
        eprintln!(
            "{camera}: mean {mean}, differences ÷ {unit}: median {}, 97 % {}, most {}",
            at(0.5),
            at(0.97),
            at(1.0)
        );
        // Textures are filtered with fractions of eight bits: 1/256 of the difference between neighbours, which is as large
        // as the light. Pixels on edges may show the other surface, as both draw through nearly the same points: few do.
        assert!(mean > 0.0 && at(0.5) < 0.002 && at(0.97) < 0.01, "{camera}: {} {}", at(0.5), at(0.97));
    }
    assert!(server.missed.lock().unwrap().is_empty(), "{:?}", server.missed.lock().unwrap());
}

pub fn the_exported_page_shows_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let export = exported(folder.path());
    let server = serve(&export);
    let page = Page::open(&format!("{}/index.html", server.address));
    page.wait_for("document.getElementById('message').textContent !== 'loading'");
    assert_eq!(page.eval("document.getElementById('message').textContent"), "");
    page.shoot("three_page");
    let bright = "(() => { const c = document.createElement('canvas'); c.width = c.height = 64; const g = c.getContext('2d'); \
        document.getElementById('exposure').dispatchEvent(new Event('input', { bubbles: true })); \
        g.drawImage(document.querySelector('canvas'), 0, 0, 64, 64); \
        return g.getImageData(0, 0, 64, 64).data.reduce((sum, v, i) => sum + (i % 4 < 3 ? v : 0), 0); })()";
    let lit = page.eval(bright).as_f64().unwrap();
    page.eval("document.getElementById('lit').checked = false");
    let dark = page.eval(bright).as_f64().unwrap();
    assert!(lit > 1.5 * dark.max(1.0), "probes light the scene: {lit} with, {dark} without");
    assert!(page.complaints.lock().unwrap().is_empty(), "{:?}", page.complaints.lock().unwrap());
}
