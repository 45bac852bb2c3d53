//! three.js with WebGL 2 in a headless browser.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use glam::Vec3;
use headless_chrome::protocol::cdp::Page::CaptureScreenshotFormatOption;
use headless_chrome::protocol::cdp::types::Event;
use headless_chrome::{Browser, LaunchOptions, Tab};
use serde_json::Value;
use tempfile::TempDir;

use crate::agree::{CAMERAS, SIZE, all_agree, baked, exported, shaded};
use crate::album::Entry;
use crate::mutants;
use crate::needs::browser;
use crate::server::Server;

const PATIENCE: Duration = Duration::from_secs(120);

/// The folder of npm's package three.
pub fn package() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("LIGHTPROBE_THREE")?);
    folder.join("build/three.module.js").is_file().then_some(folder)
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

/// Irradiance by three.js of an export below the page's own.
fn picture(page: &Page, camera: &str, (width, height): (u32, u32), folder: &str, scene: &str) -> Vec<Vec3> {
    let call = format!("irradiance('{camera}', {width}, {height}, '{folder}', '{scene}').then(JSON.stringify)");
    let text = page.eval(&call);
    let found: Vec<f32> = serde_json::from_str(text.as_str().expect("text")).unwrap();
    found.as_chunks::<3>().0.iter().map(|p| Vec3::from(*p)).collect()
}

/// The same for each camera of the two rooms.
fn pictures(page: &Page, folder: &str) -> Vec<Vec<Vec3>> {
    CAMERAS.iter().map(|camera| picture(page, camera, SIZE, folder, "scene.glb")).collect()
}

/// The pictures of an album.
pub fn album(entries: &[Entry]) {
    for entry in entries {
        let Entry { scene, export, camera, size, .. } = entry;
        let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/engines");
        let (folder, file) = (scene.parent().expect("a folder"), scene.file_name().and_then(OsStr::to_str));
        let three = package().expect("these tests run where three.js is");
        let folders =
            vec![("/node_modules/three/", three), ("/scene/", folder.to_owned()), ("/", export.clone()), ("/", own)];
        let server = Server::new(folders);
        let page = Page::open(&format!("{}/compare.html", server.address));
        page.wait_for("window.ready === true");
        let file = format!("scene/{}", file.expect("a name"));
        entry.judge(&picture(&page, camera, *size, "", &file));
    }
}

pub fn pixels_of_three_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let probes = baked("two_rooms_open", folder.path());
    let export = exported("two_rooms_open", &probes, "three", "--fit");
    let (expected, unit) = shaded("two_rooms_open", &export);
    let broken = mutants::write(&mutants::OF_THREE, &export, &export);
    let server = serve(&export);
    let page = Page::open(&format!("{}/compare.html", server.address));
    page.wait_for("window.ready === true");
    assert!(all_agree("three", &pictures(&page, ""), &expected, unit));
    for (mutant, folder) in mutants::OF_THREE.iter().zip(broken) {
        let name = folder.file_name().and_then(|name| name.to_str()).expect("a name").to_owned();
        let found = pictures(&page, &format!("{name}/"));
        assert!(!all_agree(&format!("three, {}", mutant.name), &found, &expected, unit), "nobody notices");
    }
    assert!(server.missed.lock().unwrap().is_empty(), "{:?}", server.missed.lock().unwrap());
}

pub fn several_volumes_in_three_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let probes = baked("two_rooms_open", folder.path());
    let export = exported("two_rooms_open", &probes, "three", "--fit --volumes auto");
    let (expected, unit) = shaded("two_rooms_open", &export);
    mutants::write_reversed(&export, &export);
    let server = serve(&export);
    let page = Page::open(&format!("{}/compare.html", server.address));
    page.wait_for("window.ready === true");
    assert!(all_agree("three, volumes auto", &pictures(&page, ""), &expected, unit));
    let found = pictures(&page, "reversed/");
    assert!(!all_agree("three, volumes in the opposite order", &found, &expected, unit), "nobody notices");
}

pub fn the_exported_page_shows_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let probes = baked("two_rooms_open", folder.path());
    let export = exported("two_rooms_open", &probes, "three", "--fit");
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
