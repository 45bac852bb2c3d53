//! Divide, zoom, exposure, sorting, keys.

use glam::Vec3;
use lightprobe::image::tonemap;
use lightprobe::math::color::byte_from_unit;
use lightprobe::report::page::{code_of_radiance, radiance_of_code};

use crate::browser::Opened;
use crate::fixture::{self, EXPOSURE_EV, HEIGHT, NAN_AT, WIDTH, light};

/// What the page must show for a pixel: the light that its codes stand for, through the one tone curve.
fn shown(light: Vec3, exposure_ev: f32) -> [u8; 3] {
    let decoded = Vec3::from_array(light.to_array().map(|channel| radiance_of_code(code_of_radiance(channel)) as f32));
    tonemap(decoded, exposure_ev).to_array().map(byte_from_unit)
}

/// Both round the same curve, one in f32, one in f64.
fn assert_shows(actual: [u8; 3], expected: [u8; 3], what: &str) {
    let near = actual.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
    assert!(near, "{what}: {actual:?} instead of {expected:?}");
}

/// The middle of a pixel of the first pair in its canvas, when the whole picture is shown.
fn place_of(opened: &Opened, x: u32, y: u32) -> (f64, f64) {
    let [_, _, width, height] = opened.place("#image-1 canvas.compare");
    ((f64::from(x) + 0.5) * width / f64::from(WIDTH), (f64::from(y) + 0.5) * height / f64::from(HEIGHT))
}

fn data(opened: &Opened, key: &str) -> f64 {
    opened.number(&format!("+document.getElementById('image-1').dataset.{key}"))
}

pub fn divide_zoom_and_exposure() {
    let opened = Opened::new(&fixture::page(), 1280, 900);
    opened.show_image("image-1");
    let compare = "#image-1 canvas.compare";
    let at = |x, y| {
        let (px, py) = place_of(&opened, x, y);
        opened.canvas_pixel(compare, px, py)
    };

    // The divide stands in the middle: base to its left, candidate to its right.
    for (x, y) in [(3, 2), (9, 15), (13, 7)] {
        assert_shows(at(x, y), shown(light(0, x, y), EXPOSURE_EV), "base");
    }
    for (x, y) in [(28, 2), (24, 15)] {
        assert_shows(at(x, y), shown(light(1, x, y), EXPOSURE_EV), "candidate");
    }
    let (x, y) = NAN_AT;
    assert_eq!(at(x, y), [255, 0, 255], "a pixel that is no number");

    // By mouse to the left; then by keys to the right end.
    let [left, top, width, height] = opened.place(compare);
    opened.drag((left + 0.5 * width, top + 0.7 * height), (left + 0.2 * width, top + 0.7 * height));
    assert!((data(&opened, "split") - 0.2).abs() < 0.01);
    assert_shows(at(9, 15), shown(light(1, 9, 15), EXPOSURE_EV), "candidate, after a drag");
    assert_shows(at(3, 2), shown(light(0, 3, 2), EXPOSURE_EV), "base, after a drag");
    opened.eval("document.querySelector('#image-1 canvas.compare').focus()");
    opened.key("ArrowRight");
    assert!((data(&opened, "split") - 0.22).abs() < 0.01);
    opened.key("End");
    assert_shows(at(28, 2), shown(light(0, 28, 2), EXPOSURE_EV), "base, after End");
    // By the range below it.
    opened.eval("document.querySelector('#image-1 .divide input').focus()");
    opened.key("Home");
    assert!(data(&opened, "split") == 0.0);
    assert_shows(at(3, 2), shown(light(1, 3, 2), EXPOSURE_EV), "candidate, after Home");

    // Exposure develops the light itself, not the picture.
    for exposure in [-3.5_f32, 4.0] {
        opened.eval(&format!(
            "(() => {{ const e = document.querySelector('#image-1 .exposure input'); e.value = {exposure}; e.dispatchEvent(new Event('input')); }})()"
        ));
        opened.settle();
        let set = data(&opened, "ev") as f32;
        assert!((set - exposure).abs() < 0.06, "{set}");
        for (x, y) in [(5, 3), (17, 9), (29, 16)] {
            assert_shows(at(x, y), shown(light(1, x, y), set), "candidate, exposed");
        }
    }
    opened.click("#image-1 [data-do=\"exposure\"]");
    assert!((data(&opened, "ev") - f64::from(EXPOSURE_EV)).abs() < 1e-6);
    opened.assert_quiet();
}

pub fn both_views_zoom_together() {
    let opened = Opened::new(&fixture::page(), 1280, 900);
    opened.show_image("image-1");
    let heat_at = |x: f64, y: f64| opened.canvas_pixel("#image-1 canvas.heat", x, y);
    let [left, top, width, height] = opened.place("#image-1 canvas.compare");
    let (x, y) = (0.25 * width, 0.25 * height);
    let before = heat_at(0.9 * width, 0.9 * height);
    opened.wheel(left + x, top + y, -250.0);
    assert!((data(&opened, "zoom") - 2.0).abs() < 0.01, "{}", data(&opened, "zoom"));
    assert_ne!(heat_at(0.9 * width, 0.9 * height), before, "the heat map follows");
    // What was under the pointer stays there: pixel (8, 4) of the picture, in both views.
    let centre = opened.text("document.getElementById('image-1').dataset.centre");
    let centre: Vec<f64> = centre.split(',').map(|at| at.parse().unwrap()).collect();
    assert!((centre[0] - 12.0).abs() < 0.1 && (centre[1] - 6.75).abs() < 0.1, "{centre:?}");
    assert_shows(
        opened.canvas_pixel("#image-1 canvas.compare", x + 3.0, y + 3.0),
        shown(light(0, 8, 4), EXPOSURE_EV),
        "under the pointer",
    );

    // Panning in the heat map moves both; the ends hold.
    let [heat_left, heat_top, ..] = opened.place("#image-1 canvas.heat");
    opened.drag((heat_left + 200.0, heat_top + 100.0), (heat_left + 100.0, heat_top + 100.0));
    let panned = opened.text("document.getElementById('image-1').dataset.centre");
    assert!(panned.split(',').next().unwrap().parse::<f64>().unwrap() > 13.0, "{panned}");
    opened.eval("document.querySelector('#image-1 canvas.heat').focus()");
    for _ in 0..12 {
        opened.key("ArrowRight");
    }
    let end = opened.text("document.getElementById('image-1').dataset.centre");
    assert!(end.starts_with("24,"), "{end}");
    opened.key("+");
    assert!((data(&opened, "zoom") - 3.0).abs() < 0.01);
    opened.key("-");
    opened.key("0");
    assert!(data(&opened, "zoom") == 1.0);

    // Two fingers.
    let (cx, cy) = (heat_left + 0.5 * width, heat_top + 0.5 * height);
    opened.touch("touchStart", &[(cx - 20.0, cy), (cx + 20.0, cy)]);
    opened.touch("touchMove", &[(cx - 40.0, cy), (cx + 40.0, cy)]);
    opened.touch("touchMove", &[(cx - 60.0, cy), (cx + 60.0, cy)]);
    opened.touch("touchEnd", &[]);
    assert!(data(&opened, "zoom") > 2.0, "{}", data(&opened, "zoom"));
    opened.click("#image-1 [data-do=\"fit\"]");

    // Pixels are told with their place, base, candidate and difference.
    let (px, py) = place_of(&opened, 5, 3);
    let [left, top, ..] = opened.place("#image-1 canvas.heat");
    opened.mouse("mouseMoved", left + px, top + py);
    opened.settle();
    let told = opened.text("document.querySelector('#image-1 .readout').textContent");
    assert!(told.contains("x 5, y 3") && told.contains("base (0.17") && told.contains("W·m⁻²·sr⁻¹"), "{told}");
    opened.click("#image-1 [data-do=\"worst\"]");
    assert!(opened.text("document.querySelector('#image-1 .where').textContent").contains("x 10, y 9"));
    opened.assert_quiet();
}

pub fn gates_are_sorted_and_filtered() {
    let opened = Opened::new(&fixture::page(), 1280, 900);
    let column = |selector: &str| {
        let texts = opened.eval(&format!(
            "[...document.querySelectorAll('tbody.gate:not(.off) {selector}')].map((cell) => cell.textContent)"
        ));
        texts.as_array().unwrap().iter().map(|text| text.as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(column(".name")[..2], ["leak.light", "irradiance.mean"], "worst margin first");
    assert!(opened.text("document.querySelector('h1').textContent").contains("2 of 22"));
    assert_eq!(opened.eval("window.boom"), serde_json::Value::Null, "a name ran as a script");

    // Some are folded away at first, and shown when asked.
    let total = fixture::gates().len();
    assert!(column(".name").len() < total);
    opened.click("#show-all");
    assert_eq!(column(".name").len(), total);

    opened.click("th[data-key=\"name\"] button");
    let names = column(".name");
    assert!(names.is_sorted(), "{names:?}");
    opened.click("th[data-key=\"name\"] button");
    assert!(column(".name").iter().rev().is_sorted());
    assert_eq!(opened.text("document.querySelector('th[data-key=name]').getAttribute('aria-sort')"), "descending");
    opened.click("th[data-key=\"value\"] button");
    let values = opened.eval("[...document.querySelectorAll('tbody.gate')].map((gate) => gate.dataset.value ?? null)");
    let values: Vec<f64> = values.as_array().unwrap().iter().filter_map(|v| v.as_str()?.parse().ok()).collect();
    assert!(values.is_sorted() && values.len() == total - 1, "{values:?}");
    assert_eq!(column(".name").last().unwrap(), "image.psnr", "undefined last");

    opened.click("#failing-only");
    assert_eq!(column(".pill"), ["fail", "fail"]);
    opened.assert_quiet();
}

pub fn a_keyboard_is_enough() {
    let opened = Opened::new(&fixture::page(), 1280, 900);
    opened.show_image("image-1");
    opened.eval("scrollTo({top: 0, behavior: 'instant'}), document.activeElement.blur()");
    let mut seen = Vec::new();
    for _ in 0..60 {
        opened.key("Tab");
        let focused = opened.text(
            "(() => { const e = document.activeElement; const s = getComputedStyle(e); \
             return [e.id || e.className || e.dataset.do || e.getAttribute('href') || e.type || e.tagName, \
             e.closest('.picture')?.id ?? '', s.outlineStyle].join('|'); })()",
        );
        assert!(!focused.ends_with("|none"), "focus is not to be seen: {focused}");
        seen.push(focused);
    }
    let place =
        |what: &str| seen.iter().position(|one| one.starts_with(what)).unwrap_or_else(|| panic!("{what} in {seen:?}"));
    let order = [
        "skip|",
        "#gates|",
        "theme scripted|",
        // The worst pair stands before the gates, the others after.
        "out|image-2|",
        "failing-only|",
        "out|image-1|",
        "worst|image-1|",
        "range|image-1|",
        "compare|image-1|",
        "heat|image-1|",
    ];
    let places: Vec<usize> = order.iter().map(|what| place(what)).collect();
    assert!(places.is_sorted(), "{order:?} at {places:?}");

    // The toggle of colours works by key, and lasts.
    let paper = || opened.text("getComputedStyle(document.body).backgroundColor");
    opened.emulate("light", "screen");
    let light = paper();
    opened.eval("document.querySelector('button.theme').focus()");
    opened.key("Enter");
    assert_eq!(paper(), light);
    opened.key("Enter");
    assert_eq!(opened.text("document.documentElement.dataset.theme"), "dark");
    assert_ne!(paper(), light);
    opened.key("Enter");
    opened.emulate("dark", "screen");
    assert_ne!(paper(), light);

    // A line is copied as it is, whatever is in it.
    opened.eval("document.querySelectorAll('button.copy')[1].focus()");
    opened.key("Enter");
    opened.wait_for("document.getElementById('copied').textContent !== ''");
    assert_eq!(opened.text("document.getElementById('copied').textContent"), "Copied");
    assert!(opened.text("document.querySelectorAll('button.copy')[1].dataset.copy").contains(fixture::HOSTILE));
    opened.assert_quiet();
}
