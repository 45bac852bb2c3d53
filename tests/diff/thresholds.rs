//! The user's own thresholds.

use crate::common::Folder;
use crate::made::{diff, failing, report, text};
use crate::program::one_error;

fn bake_report(folder: &Folder, name: &str, time: f64) -> std::path::PathBuf {
    let report = serde_json::json!({"schema": "lightprobe-bake/1", "time_s": {"total": time}});
    folder.write(name, report.to_string())
}

#[test]
fn times_are_judged_only_when_asked() {
    let folder = Folder::new();
    let (fast, slow) = (bake_report(&folder, "fast.json", 1.0), bake_report(&folder, "slow.json", 2.0));
    let (code, found) = report(&diff(&folder, &fast, &slow, &[]));
    assert_eq!(code, Some(0));
    let time = found["gates"].as_array().unwrap().iter().find(|g| g["name"] == "time.bake").unwrap();
    assert_eq!((time["value"].as_f64(), &time["threshold"]), (Some(100.0), &serde_json::Value::Null));
    let strict = folder.write("strict.ron", r#"(gates: {"time.bake": (relative: 0.2)})"#);
    let (code, found) = report(&diff(&folder, &fast, &slow, &["--thresholds", text(&strict)]));
    assert_eq!((code, failing(&found)), (Some(1), vec!["time.bake".to_owned()]));
    assert!(found["gates"][0]["source"].as_str().unwrap().ends_with("strict.ron: gates.time.bake"));
    // Faster is never worse.
    assert_eq!(diff(&folder, &slow, &fast, &["--thresholds", text(&strict)]).code, Some(0));
}

#[test]
fn exceptions_for_nothing_are_told() {
    let folder = Folder::new();
    let side = bake_report(&folder, "a.json", 1.0);
    let file = |item: &str| {
        let text = format!("(exceptions: [(item: \"{item}\", gate: \"time.*\", limit: (relative: 9))])");
        folder.write("exceptions.ron", text)
    };
    let notes =
        |item: &str| report(&diff(&folder, &side, &side, &["--thresholds", text(&file(item))])).1["notes"].to_string();
    assert!(notes("bkae").contains("item bkae, gate time.* fits no gate"));
    assert!(!notes("*").contains("fits no gate"));
}

#[test]
fn mistakes_are_refused() {
    let folder = Folder::new();
    let side = bake_report(&folder, "a.json", 1.0);
    for (text_of_file, word) in [(r#"(gates: {"time.bak": ()})"#, "time.bake"), ("", "empty"), ("(", "line 1")] {
        let path = folder.write("bad.ron", text_of_file);
        let message = one_error(&diff(&folder, &side, &side, &["--thresholds", text(&path)]));
        assert!(message.contains("bad.ron") && message.contains(word), "{message}");
    }
    let missing = folder.path().join("none.ron");
    let message = one_error(&diff(&folder, &side, &side, &["--thresholds", text(&missing)]));
    assert!(message.contains("none.ron") && message.contains("configs/diff.ron"), "{message}");
    assert!(!folder.path().join("out").exists());
}

#[test]
fn the_printed_defaults_are_those_in_effect() {
    let folder = Folder::new();
    let side = bake_report(&folder, "a.json", 1.0);
    let defaults = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/diff.ron");
    let plain = report(&diff(&folder, &side, &side, &[])).1;
    let given = report(&diff(&folder, &side, &side, &["--thresholds", defaults])).1;
    assert_eq!(plain["thresholds"]["gates"], given["thresholds"]["gates"]);
}
