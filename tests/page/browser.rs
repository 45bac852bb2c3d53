//! A headless browser with one page open, driven as a person would: mouse, wheel, keys.

use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use headless_chrome::protocol::cdp::Log::LogEntryLevel;
use headless_chrome::protocol::cdp::types::{Event, Method};
use headless_chrome::{Browser, LaunchOptions, Tab};
use serde::Serialize;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::needs::browser;

/// Longest wait for something that the page is to do: only a hung page takes it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A method of the DevTools protocol with its parameters as JSON: most of them are optional.
macro_rules! method {
    ($kind:ident, $name:literal) => {
        #[derive(Debug, Serialize)]
        #[serde(transparent)]
        struct $kind(Value);

        impl Method for $kind {
            const NAME: &'static str = $name;
            type ReturnObject = Value;
        }
    };
}

method!(MouseEvent, "Input.dispatchMouseEvent");
method!(TouchEvent, "Input.dispatchTouchEvent");
method!(KeyEvent, "Input.dispatchKeyEvent");
method!(DeviceMetrics, "Emulation.setDeviceMetricsOverride");
method!(EmulatedMedia, "Emulation.setEmulatedMedia");
method!(ScriptsOff, "Emulation.setScriptExecutionDisabled");
method!(EnableNetwork, "Network.enable");
method!(EnableLog, "Log.enable");
method!(EnableRuntime, "Runtime.enable");
method!(Evaluate, "Runtime.evaluate");
method!(Screenshot, "Page.captureScreenshot");
method!(PrintToPdf, "Page.printToPDF");

/// A page in a browser of its own.
pub struct Opened {
    tab: Arc<Tab>,
    url: String,
    /// Whether the page's own scripts run.
    scripts: bool,
    /// Addresses that were asked for.
    requests: Arc<Mutex<Vec<String>>>,
    /// Errors of the console and exceptions.
    complaints: Arc<Mutex<Vec<String>>>,
    _browser: Browser,
    _folder: TempDir,
}

impl Opened {
    /// Opens a page in a window of this size.
    pub fn new(html: &str, width: u32, height: u32) -> Opened {
        Opened::with_scripts(html, width, height, true)
    }

    pub fn with_scripts(html: &str, width: u32, height: u32, scripts: bool) -> Opened {
        Opened::with_flags(html, (width, height), scripts, &[])
    }

    /// A page that draws with WebGL, in software on machines without a graphics card too.
    pub fn drawing(html: &str, width: u32, height: u32) -> Opened {
        const BY_SOFTWARE: [&str; 3] =
            ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
        Opened::with_flags(html, (width, height), true, &BY_SOFTWARE)
    }

    fn with_flags(html: &str, (width, height): (u32, u32), scripts: bool, flags: &[&str]) -> Opened {
        let path = browser().expect("tests that open a page run where there is a browser");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("index.html");
        fs::write(&file, html).unwrap();
        let args = ["--disable-quic", "--disable-component-update", "--hide-scrollbars"];
        let options = LaunchOptions {
            path: Some(path),
            sandbox: false,
            user_data_dir: Some(folder.path().join("profile")),
            window_size: Some((width, height)),
            args: args.iter().chain(flags).map(OsStr::new).collect(),
            idle_browser_timeout: 5 * PATIENCE,
            enable_gpu: !flags.is_empty(),
            ..LaunchOptions::default()
        };
        let browser = Browser::new(options).expect("the browser starts");
        let tab = browser.new_tab().expect("a tab");
        tab.set_default_timeout(PATIENCE);
        let (requests, complaints) = (Arc::default(), Arc::default());
        watch(&tab, &requests, &complaints);
        let opened = Opened {
            tab,
            scripts,
            url: format!("file://{}", file.display()),
            requests,
            complaints,
            _browser: browser,
            _folder: folder,
        };
        opened.call(EnableNetwork(json!({})));
        opened.call(EnableLog(json!({})));
        opened.call(EnableRuntime(json!({})));
        opened.call(ScriptsOff(json!({ "value": !scripts })));
        opened.resize(width, height);
        opened.tab.navigate_to(&opened.url).unwrap().wait_until_navigated().unwrap();
        opened
    }

    fn call<M: Method + Serialize>(&self, method: M) -> M::ReturnObject {
        self.tab.call_method(method).unwrap()
    }

    pub fn resize(&self, width: u32, height: u32) {
        self.call(DeviceMetrics(json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false })));
    }

    /// "light" or "dark" as the system's colours, "print" or "screen" as the medium.
    pub fn emulate(&self, colors: &str, medium: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": colors }]);
        self.call(EmulatedMedia(json!({ "media": medium, "features": features })));
    }

    /// The value of an expression, which may be a promise.
    pub fn eval(&self, expression: &str) -> Value {
        let asked =
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true, "userGesture": true });
        let answer = self.call(Evaluate(asked));
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    pub fn number(&self, expression: &str) -> f64 {
        let value = self.eval(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression} is {value}, no number"))
    }

    pub fn text(&self, expression: &str) -> String {
        let value = self.eval(expression);
        value.as_str().unwrap_or_else(|| panic!("{expression} is {value}, no text")).to_owned()
    }

    pub fn wait_for(&self, condition: &str) {
        let start = Instant::now();
        while self.eval(condition) != Value::Bool(true) {
            assert!(start.elapsed() < PATIENCE, "never came true: {condition}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// After what was asked for has been painted.
    pub fn settle(&self) {
        if !self.scripts {
            return;
        }
        self.eval(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 0))))",
        );
    }

    /// Brings the pair `image-N` into view and waits until it is decoded.
    pub fn show_image(&self, id: &str) {
        self.eval(&format!(
            "document.querySelector('#{id} .stage').scrollIntoView({{behavior: 'instant', block: 'center'}})"
        ));
        self.wait_for(&format!("document.getElementById('{id}').dataset.state === 'ready'"));
        // Longer than the pause after a scroll in which the wheel belongs to the page.
        std::thread::sleep(Duration::from_millis(400));
        self.settle();
    }

    /// Left, top, width, height of an element in the window.
    pub fn place(&self, selector: &str) -> [f64; 4] {
        let place = self.eval(&format!(
            "(() => {{ const b = document.querySelector('{selector}').getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; }})()"
        ));
        [0, 1, 2, 3].map(|i| place[i].as_f64().unwrap())
    }

    pub fn mouse(&self, kind: &str, x: f64, y: f64) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        self.call(MouseEvent(json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": 1, "clickCount": 1 })));
    }

    pub fn drag(&self, from: (f64, f64), to: (f64, f64)) {
        self.mouse("mouseMoved", from.0, from.1);
        self.mouse("mousePressed", from.0, from.1);
        for share in [0.3, 0.7, 1.0] {
            let (x, y) = (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
            self.call(MouseEvent(json!({ "type": "mouseMoved", "x": x, "y": y, "button": "left", "buttons": 1 })));
        }
        self.mouse("mouseReleased", to.0, to.1);
        self.settle();
    }

    pub fn wheel(&self, x: f64, y: f64, delta: f64) {
        self.call(MouseEvent(json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": delta })));
        self.settle();
    }

    /// One step of two fingers: "touchStart", "touchMove" with both points, "touchEnd" with none.
    pub fn touch(&self, kind: &str, points: &[(f64, f64)]) {
        let points: Vec<Value> =
            points.iter().enumerate().map(|(id, (x, y))| json!({ "x": x, "y": y, "id": id })).collect();
        self.call(TouchEvent(json!({ "type": kind, "touchPoints": points })));
        self.settle();
    }

    pub fn click(&self, selector: &str) {
        self.eval(&format!(
            "document.querySelector('{selector}').scrollIntoView({{behavior: 'instant', block: 'center'}})"
        ));
        let [left, top, width, height] = self.place(selector);
        let (x, y) = (left + width / 2.0, top + height / 2.0);
        self.mouse("mouseMoved", x, y);
        self.mouse("mousePressed", x, y);
        self.mouse("mouseReleased", x, y);
        self.settle();
    }

    /// Presses a key by its name, such as "ArrowLeft" or "+".
    pub fn key(&self, key: &str) {
        let text = if key.chars().count() == 1 { key } else { "" };
        let code = match key {
            "Tab" => 9,
            "Enter" => 13,
            "Escape" => 27,
            " " => 32,
            "End" => 35,
            "Home" => 36,
            "ArrowLeft" => 37,
            "ArrowUp" => 38,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            _ => 0,
        };
        let text = if key == "Enter" { "\r" } else { text };
        let event =
            |kind: &str| json!({ "type": kind, "key": key, "code": key, "text": text, "windowsVirtualKeyCode": code });
        self.call(KeyEvent(event("keyDown")));
        self.call(KeyEvent(json!({ "type": "keyUp", "key": key, "code": key, "windowsVirtualKeyCode": code })));
        self.settle();
    }

    /// What a canvas shows at a point of the page, relative to its corner: red, green, blue.
    pub fn canvas_pixel(&self, selector: &str, x: f64, y: f64) -> [u8; 3] {
        let pixel = self.eval(&format!(
            "(() => {{ const c = document.querySelector('{selector}'); const s = c.width / c.clientWidth; \
             return [...c.getContext('2d').getImageData({x} * s, {y} * s, 1, 1).data]; }})()"
        ));
        [0, 1, 2].map(|i| pixel[i].as_u64().unwrap() as u8)
    }

    /// Nothing but the page itself was asked for, and nothing was complained of.
    pub fn assert_quiet(&self) {
        self.settle();
        let requests = self.requests.lock().unwrap();
        let outside: Vec<&String> =
            requests.iter().filter(|url| **url != self.url && !url.starts_with("data:")).collect();
        assert!(requests.contains(&self.url), "the page itself was not seen: {requests:?}");
        assert!(outside.is_empty(), "asked for: {outside:?}");
        let complaints = self.complaints.lock().unwrap();
        assert!(complaints.is_empty(), "{complaints:?}");
    }

    /// Keeps a picture of the whole page where `LIGHTPROBE_PAGE_SHOTS` says.
    pub fn shoot(&self, name: &str) {
        let Some(folder) = std::env::var_os("LIGHTPROBE_PAGE_SHOTS").map(PathBuf::from) else { return };
        let size = self.eval("[document.documentElement.clientWidth, document.documentElement.scrollHeight]");
        let clip = json!({ "x": 0, "y": 0, "width": size[0], "height": size[1], "scale": 1 });
        let shot = self.call(Screenshot(json!({ "format": "png", "clip": clip, "captureBeyondViewport": true })));
        keep(&folder.join(format!("{name}.png")), &shot["data"]);
    }

    /// Keeps the page as it is printed.
    pub fn print(&self, name: &str) {
        let Some(folder) = std::env::var_os("LIGHTPROBE_PAGE_SHOTS").map(PathBuf::from) else { return };
        let printed =
            self.call(PrintToPdf(json!({ "printBackground": false, "paperWidth": 8.27, "paperHeight": 11.69 })));
        keep(&folder.join(format!("{name}.pdf")), &printed["data"]);
    }
}

fn keep(path: &std::path::Path, data: &Value) {
    use base64::Engine as _;
    let bytes = base64::engine::general_purpose::STANDARD.decode(data.as_str().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

fn watch(tab: &Arc<Tab>, requests: &Arc<Mutex<Vec<String>>>, complaints: &Arc<Mutex<Vec<String>>>) {
    let (requests, complaints) = (requests.clone(), complaints.clone());
    let listener = move |event: &Event| match event {
        Event::NetworkRequestWillBeSent(sent) => requests.lock().unwrap().push(sent.params.request.url.clone()),
        Event::RuntimeExceptionThrown(thrown) => {
            complaints.lock().unwrap().push(format!("{:?}", thrown.params.exception_details));
        }
        Event::RuntimeConsoleAPICalled(called) => complaints.lock().unwrap().push(format!("{:?}", called.params.args)),
        // Warnings are about speed, such as of the test's own reading of canvases; a broken policy is an error.
        Event::LogEntryAdded(added) if added.params.entry.level == LogEntryLevel::Error => {
            complaints.lock().unwrap().push(format!("{:?}", added.params.entry));
        }
        _ => {}
    };
    tab.add_event_listener(Arc::new(listener)).unwrap();
}
