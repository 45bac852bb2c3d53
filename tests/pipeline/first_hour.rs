//! What a newcomer meets: mistakes are told with what was meant, nothing is left beside what it does not belong to, and
//! what is chosen for the user suits scenes as people have them.

use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

use crate::common::{Folder, Gltf};
use crate::program::{
    bake, command, finish, interruptible, method, names_in, refuse, render, run, scene, succeed, text,
};
use crate::shapes::{add, add_light, diffuse, quad, room, save};
use serde_json::json;

#[test]
fn mistakes_are_told_with_what_was_meant() {
    let folder = Folder::new();
    let (rooms, output) = (scene("two_rooms_open"), folder.path().join("out"));
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=2");
    let words = folder.write("words.txt", "root:x:0:0");
    let (rooms, probes, output) = (text(&rooms), text(&baked.path), text(&output));
    for (arguments, words) in [
        (&["render", probes, rooms, "-o", output][..], &["render SCENE PROBES", "is a probe file"][..]),
        (&["render", rooms, rooms, "-o", output], &["is a scene", "render SCENE PROBES"]),
        (&["bake", probes, "-o", output], &["is a probe file", "`lightprobe bake SCENE -o OUT.probes`"]),
        (&["sweep", probes, "-o", output], &["is a probe file", "`lightprobe sweep SCENE -o DIR`"]),
        (&["render", rooms, text(folder.path()), "-o", output], &["is a folder", "export", "render SCENE PROBES"]),
        (&["bake", rooms, "-o", output, "--config", rooms], &["is no text", "RON file"]),
        (&["diff-report", probes, probes, "-o", output, "--thresholds", text(&words)], &["words.txt", "'root'", "RON"]),
        (&["view", probes, rooms, "-o", output], &["view SCENE PROBES"]),
        (&["inspect", rooms], &["is a scene", "inspect PROBES"]),
        (&["export", rooms, "--to", "three", "-o", output], &["is a scene", "export PROBES"]),
        (&["convert", rooms, probes, "-o", output, "--to", "uniform"], &["is a scene", "convert PROBES SCENE"]),
        (&["bake", rooms, "-o", output, "--set", "spacing_m=1"], &["'grid.spacing_m'"]),
        (&["bake", rooms, "-o", output, "--set", "grid.spaceing=1"], &["did you mean 'spacing_m'"]),
        (&["bake", rooms, "-o", output, "--set", "visibility=none"], &["'query.visibility'"]),
        (&["bake", rooms, "-o", output, "--set", "seed=3"], &["the flag --seed"]),
        (&["bake", rooms, "-o", output, "--set", "grid.spacing_m=1m"], &["write a number, such as 0.5"]),
        (&["bake", rooms, "-o", output, "--set", "grid.divisions=8"], &["three numbers, such as (8, 4, 8)"]),
        (&["bake", rooms, "-o", output, "--preset", "configs/presets/path.ron"], &["--config", "physical"]),
        (&["help", "probe"], &["did you mean", "`lightprobe help` lists them"]),
    ] {
        let message = refuse(arguments);
        for word in words {
            assert!(message.contains(word), "no '{word}' in: {message}");
        }
    }
    // Nothing is near to it.
    assert!(!refuse(&["help", "qqqq"]).contains("did you mean"));
    for (flag, value, word) in [
        ("--threads", "-1", "0 means one"),
        ("--threads", "two", "such as 2"),
        ("--seed", "-1", "from 0 to"),
        ("--memory-budget", "-1GiB", "512MiB"),
    ] {
        let run = run(&["bake", rooms, "-o", output, flag, value]);
        assert!(run.code == Some(2) && run.stderr.contains(word) && !run.stderr.contains("digit"), "{}", run.stderr);
    }
    let run = run(&["render", rooms, probes, "-o", output, "--reference", "0"]);
    assert!(run.code == Some(2) && run.stderr.contains("write a whole number from 1 to"), "{}", run.stderr);
    assert_eq!(names_in(folder.path()).len(), 2);
}

/// Maps and a verdict of other sides would be taken for those of this comparison.
#[test]
fn a_comparison_leaves_nothing_of_an_earlier_one() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=2");
    render(&folder, &rooms, &baked.path, "run", "--size 16x9");
    let (pictures, output) = (folder.path().join("run"), folder.path().join("diff"));
    succeed(&["diff-report", text(&pictures), text(&pictures), "-o", text(&output)]);
    std::fs::write(output.join("difference of opinion.png"), "mine").unwrap();
    let is_map = |name: &&String| name.starts_with("difference_");
    assert!(names_in(&output).iter().any(|name| is_map(&name)), "{:?}", names_in(&output));
    succeed(&["diff-report", text(&baked.path), text(&baked.path), "-o", text(&output)]);
    let after = names_in(&output);
    assert_eq!(after.iter().find(is_map), None, "{after:?}");
    assert!(after.iter().any(|name| name == "difference of opinion.png"), "{after:?}");
    // In a folder that no comparison wrote nothing is removed.
    std::fs::write(output.join("diff.json"), "{}").unwrap();
    std::fs::write(output.join("difference_mine.png"), "mine").unwrap();
    succeed(&["diff-report", text(&baked.path), text(&baked.path), "-o", text(&output)]);
    assert_eq!(std::fs::read(output.join("difference_mine.png")).unwrap(), b"mine");
}

/// Neither the result nor any work fits: nothing can be gone on from, and nothing is left.
#[test]
fn work_that_could_not_be_saved_is_not_promised() {
    let folder = Folder::new();
    let output = folder.path().join("a.probes");
    let mut shell = Command::new("bash");
    // Blocks of 1,024 bytes: less than a probe's capture.
    shell.args(["-c", "ulimit -f 1; exec \"$0\" \"$@\""]).arg(command().get_program());
    shell.args(["bake", text(&scene("cornell")), "-o", text(&output), "--checkpoint-every", "0"]);
    let run = finish(shell.args(["--set", "grid.divisions=(3,3,3)"]));
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("ulimit -f unlimited") && !run.stderr.contains("--resume"), "{}", run.stderr);
    assert_eq!(names_in(folder.path()), [""; 0]);
}

/// The set is replaced as a whole: maps of errors would be taken for those of the pictures beside them.
#[test]
fn a_render_leaves_nothing_of_an_earlier_one() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=2");
    render(&folder, &rooms, &baked.path, "out", "--size 16x9 --reference 16 --as three");
    let output = folder.path().join("out");
    std::fs::write(output.join("error_notes.txt"), "mine").unwrap();
    let before = names_in(&output);
    for name in ["reference.exr", "reference.png", "error_on.exr", "as_three.png"] {
        assert!(before.iter().any(|n| n == name), "no {name}: {before:?}");
    }
    render(&folder, &rooms, &baked.path, "out", "--size 16x9");
    let after = names_in(&output);
    let stale =
        |name: &&String| name.starts_with("reference") || name.starts_with("error_o") || name.starts_with("as_");
    assert_eq!(after.iter().find(stale), None, "{after:?}");
    assert!(after.iter().any(|name| name == "error_notes.txt"), "{after:?}");
    // In a folder that no render wrote nothing is removed.
    std::fs::write(output.join("report.json"), "{}").unwrap();
    std::fs::write(output.join("reference.exr"), "mine").unwrap();
    render(&folder, &rooms, &baked.path, "out", "--size 16x9");
    assert_eq!(std::fs::read(output.join("reference.exr")).unwrap(), b"mine");
}

/// A room of 2 m on a plane of 60 m.
fn room_in_a_field(folder: &Folder) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(2), diffuse([0.5; 3], [1.0; 3]));
    add(&mut gltf, &quad([-30.0, -1.01, -30.0], [0.0, 0.0, 60.0], [60.0, 0.0, 0.0], 1), diffuse([0.3; 3], [0.0; 3]));
    save(gltf, folder, "field")
}

#[test]
fn probes_stand_close_where_the_content_is_small() {
    let folder = Folder::new();
    let field = room_in_a_field(&folder);
    let output = folder.path().join("field.probes");
    let run = succeed(&["bake", text(&field), "-o", text(&output), "--dry-run", "--json", "-v"]);
    assert!(run.stderr.contains("warning: the scene is 60.0 m long"), "{}", run.stderr);
    // 60 m ÷ 16 would be 3.75 m: not one probe in the room. At most 16,384 probes cover 60 × 60 × 2 m from 0.97 m on.
    let probes = run.json()["probes"].as_u64().unwrap();
    assert!((8_000..=16_384).contains(&probes), "{probes}");
    // A scene that fills its box has the spacing that it always had.
    let output = folder.path().join("rooms.probes");
    let run = succeed(&["bake", text(&scene("two_rooms_open")), "-o", text(&output), "--dry-run"]);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
}

#[test]
fn a_spacing_larger_than_the_scene_is_told() {
    let folder = Folder::new();
    let output = folder.path().join("out.probes");
    let arguments =
        ["bake", text(&scene("furnace")), "-o", text(&output), "--set", "grid.spacing_m=1000"].map(str::to_owned);
    let run = succeed(&arguments);
    assert!(run.stderr.contains("warning: grid.spacing_m is 1000 m"), "{}", run.stderr);
}

#[test]
fn pictures_outside_of_the_hull_and_in_the_dark_are_told() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=1 --set grid.bounds=(min:(-3,0.5,-1),max:(-1,1.5,1))");
    let output = folder.path().join("out");
    let run = succeed(&["render", text(&rooms), text(&baked.path), "-o", text(&output), "--size", "16x9"]);
    assert!(run.stderr.contains("lies outside the probes' hull"), "{}", run.stderr);
    assert!(run.stdout.contains("outside the hull"), "{}", run.stdout);
    // A lamp of a millionth of the usual.
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.5; 3], [0.0; 3]));
    add_light(&mut gltf, json!({ "type": "point", "intensity": 1e-6 }), json!({ "translation": [0.0, 0.5, 0.0] }));
    let dim = save(gltf, &folder, "dim");
    let baked = bake(&folder, &dim, "--set grid.divisions=(3,3,3)");
    let run = succeed(&["render", text(&dim), text(&baked.path), "-o", text(&output), "--size", "16x9"]);
    assert!(run.stderr.contains("hardly any light"), "{}", run.stderr);
}

/// Figures have rows, and every row a name: nothing depends on the width of a terminal.
#[test]
fn a_render_prints_a_row_for_each_figure() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=2");
    let output = folder.path().join("out");
    for reference in [&[][..], &["--reference", "32"]] {
        let arguments = ["render", text(&rooms), text(&baked.path), "-o", text(&output), "--size", "32x18"];
        let shown = succeed(&[&arguments[..], reference].concat()).stdout;
        for row in ["leak light ", "leak dark ", "blocks ", "look-up ", "look-up, of runs ", "memory per probe "] {
            assert!(shown.lines().any(|line| line.starts_with(row)), "{row}: {shown}");
        }
        for row in ["error (nrmse) ", "falsely black "] {
            let is_there = shown.lines().any(|line| line.starts_with(row));
            assert_eq!(is_there, !reference.is_empty(), "{row}: {shown}");
        }
        let table = shown.lines().filter(|line| line.contains("  "));
        assert!(table.clone().count() > 10 && table.map(|line| line.chars().count()).max() <= Some(80), "{shown}");
    }
}

/// A camera that is chosen stands in rooms and before objects, and never in an object.
#[test]
fn automatic_cameras_look_at_what_there_is() {
    let folder = Folder::new();
    // A hollow block of 0.4 m whose outside and inside are fronts, as a helmet's are; lit by the sky alone.
    let mut gltf = Gltf::new();
    let shrink = |triangles: Vec<[f32; 3]>, by: f32| -> Vec<[f32; 3]> {
        triangles.into_iter().map(|p| p.map(|x| x * by)).collect()
    };
    add(&mut gltf, &shrink(room(2), 0.19), diffuse([0.5; 3], [0.0; 3]));
    let outside: Vec<[f32; 3]> = shrink(room(2), 0.2).chunks(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
    // An opening in the lid, through which light comes in.
    add(&mut gltf, &outside[..outside.len() - 6], diffuse([0.5; 3], [0.0; 3]));
    let helmet = save(gltf, &folder, "helmet");
    let baked = bake(&folder, &helmet, "--set grid.divisions=(3,3,3) --env 1,1,1");
    let output = folder.path().join("out");
    let run = succeed(&["render", text(&helmet), text(&baked.path), "-o", text(&output), "--size", "32x18"]);
    assert!(run.stderr.contains("framed it from outside"), "{}", run.stderr);
    // The same shape as a lit room of 3 m.
    let mut gltf = Gltf::new();
    add(&mut gltf, &shrink(room(2), 1.5), diffuse([0.5; 3], [0.1; 3]));
    let lit = save(gltf, &folder, "lit");
    let baked = bake(&folder, &lit, "--set grid.divisions=(3,3,3)");
    let run = succeed(&["render", text(&lit), text(&baked.path), "-o", text(&output), "--size", "32x18"]);
    assert!(run.stderr.contains("framed it from inside"), "{}", run.stderr);
    // In a field the content fills the picture, not the plane around it.
    let field = room_in_a_field(&folder);
    let baked = bake(&folder, &field, "--set grid.divisions=(3,3,3)");
    let report = render(&folder, &field, &baked.path, "field", "--size 32x18");
    let irradiance = method(&report, "visibility_on")["irradiance_indirect_mean"].as_f64().unwrap();
    assert!(irradiance > 0.1, "{irradiance}");
}

#[test]
fn an_interruption_says_what_is_left() {
    let folder = Folder::new();
    let output = folder.path().join("out.probes");
    // Work for minutes, and -v says when it has begun.
    let arguments =
        ["bake", text(&scene("office")), "-o", text(&output), "-v", "--set", "grid.spacing_m=0.2"].map(str::to_owned);
    let mut child = interruptible().args(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.starts_with("acceleration structure") {
        line.clear();
        assert!(lines.read_line(&mut line).unwrap() > 0, "it ended before it was interrupted");
    }
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let mut rest = String::new();
    lines.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");
    assert!(rest.contains("interrupted: nothing is left"), "{rest}");
    assert_eq!(names_in(folder.path()), [""; 0]);
}
