//! The READMEs: every command runs, every link leads somewhere, and the first one is short.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::Folder;
use lightprobe::cli::topics::TOPICS;

/// What a newcomer reads in five minutes, bytes.
const MOST_BYTES: usize = 10 * 1024;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every README of the repository's own folders.
fn documents() -> Vec<PathBuf> {
    fn below(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let path = entry.path();
            if path.is_dir() {
                below(&path, found);
            } else if path.file_name().is_some_and(|name| name == "README.md") {
                found.push(path);
            }
        }
    }
    let mut found = vec![root().join("README.md")];
    for folder in ["configs", "scenes", "scripts", "src", "tests"] {
        below(&root().join(folder), &mut found);
    }
    found.sort();
    found
}

/// The lines of a document's blocks of code in this language.
fn code(document: &Path, language: &str) -> String {
    let text = std::fs::read_to_string(document).unwrap();
    let (fence, mut inside, mut code) = (format!("```{language}"), false, String::new());
    for line in text.lines() {
        if line.starts_with("```") {
            inside = line == fence;
        } else if inside {
            code.push_str(line);
            code.push('\n');
        }
    }
    code
}

/// The same commands with small pictures of few samples: what they show is tested elsewhere.
fn quick(commands: &str) -> String {
    let mut words: Vec<String> = commands.split(' ').map(str::to_owned).collect();
    for i in 1..words.len() {
        let value = match words[i - 1].as_str() {
            "--size" => "32x18",
            "--reference" => "32",
            _ => continue,
        };
        let rest = words[i].split_once('\n').map(|(_, rest)| format!("\n{rest}")).unwrap_or_default();
        words[i] = value.to_owned() + &rest;
    }
    let one_seed = |line: &str| match line.starts_with("lightprobe sweep ") && !line.contains("--seeds") {
        true => format!("{line} --seeds 1\n"),
        false => format!("{line}\n"),
    };
    words.join(" ").lines().map(one_seed).collect()
}

/// Runs all commands of a document in one shell, as a reader would from the root of the repository.
fn run_commands(folder: &str) -> String {
    let document = root().join(folder).join("README.md");
    let commands = code(&document, "sh");
    assert!(!commands.is_empty(), "{} has no commands", document.display());
    let place = Folder::new();
    for name in ["configs", "scenes", "scripts"] {
        std::os::unix::fs::symlink(root().join(name), place.path().join(name)).unwrap();
    }
    let program = Path::new(env!("CARGO_BIN_EXE_lightprobe")).parent().unwrap();
    let path = std::env::join_paths(
        std::iter::once(program.to_owned()).chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    );
    let output = Command::new("bash")
        .args(["-euxo", "pipefail", "-c", &quick(&commands)])
        .env("PATH", path.unwrap())
        .current_dir(place.path())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {told}", document.display());
    String::from_utf8(output.stdout).unwrap()
}

/// The figures that the README shows are rows of what its commands print.
#[test]
fn commands_of_the_first_readme() {
    let printed = run_commands("");
    let text = std::fs::read_to_string(root().join("README.md")).unwrap();
    let (_, sample) = text.split_once("<!-- sample: begin -->").unwrap();
    let (sample, _) = sample.split_once("<!-- sample: end -->").unwrap();
    let rows: Vec<&str> = sample.lines().filter_map(|line| Some(line.split_once("  ")?.0)).collect();
    assert!(rows.len() > 4);
    for row in rows {
        assert!(printed.lines().any(|line| line.starts_with(&format!("{row} "))), "no row '{row}': {printed}");
    }
}

#[test]
fn commands_of_configurations() {
    run_commands("configs");
}

#[test]
fn commands_of_scenes() {
    run_commands("scenes");
}

#[test]
fn commands_of_gltf() {
    run_commands("src/scene");
}

#[test]
fn commands_of_the_path_tracer() {
    run_commands("src/light");
}

#[test]
fn commands_of_probes() {
    run_commands("src/probe");
}

#[test]
fn commands_of_reports() {
    run_commands("src/report");
}

#[test]
fn commands_of_comparisons() {
    run_commands("src/report/diff");
}

#[test]
fn commands_of_sweeps() {
    run_commands("src/sweep");
}

#[test]
fn commands_of_exports() {
    run_commands("src/export");
}

/// A README that gets its first command gets its test above.
#[test]
fn no_command_is_left_out() {
    let run = [
        "",
        "configs",
        "scenes",
        "src/scene",
        "src/light",
        "src/probe",
        "src/report",
        "src/report/diff",
        "src/sweep",
        "src/export",
    ];
    for document in documents() {
        let folder = document.parent().unwrap().strip_prefix(root()).unwrap().to_str().unwrap();
        assert_eq!(!code(&document, "sh").is_empty(), run.contains(&folder), "{}", document.display());
    }
}

#[test]
fn the_first_readme_is_short() {
    let text = std::fs::read_to_string(root().join("README.md")).unwrap();
    assert!(text.len() <= MOST_BYTES, "{} bytes", text.len());
    for topic in TOPICS.iter().filter(|topic| topic.name != "source") {
        assert!(text.contains(&format!("`{}`", topic.name)), "no word of the topic {}", topic.name);
    }
}

#[test]
fn links_lead_somewhere() {
    for document in documents() {
        let text = std::fs::read_to_string(&document).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target) {
            if target.starts_with("http") {
                continue;
            }
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = if file.is_empty() { document.clone() } else { document.parent().unwrap().join(file) };
            assert!(file.exists(), "{}: {target}", document.display());
            let anchor =
                |line: &str| line.trim_start_matches('#').trim().to_lowercase().replace(' ', "-").replace('`', "");
            let found = std::fs::read_to_string(&file)
                .is_ok_and(|t| t.lines().any(|line| line.starts_with('#') && anchor(line) == heading));
            assert!(heading.is_empty() || found, "{}: {target}", document.display());
        }
    }
}

/// Flags that a document names are flags of some command.
#[test]
fn flags_of_documents_exist() {
    use clap::CommandFactory;
    let mut known: Vec<String> = ["version", "help", "release", "test", "path"].map(String::from).to_vec();
    let mut command = lightprobe::cli::Cli::command();
    command.build();
    for command in command.get_subcommands() {
        known.extend(command.get_arguments().filter_map(|a| a.get_long()).map(String::from));
    }
    // Of scripts.
    known.extend(["list", "readme", "check", "tables", "out", "allow-change"].map(String::from));
    for document in documents() {
        let text = std::fs::read_to_string(&document).unwrap();
        for (before, rest) in text.match_indices("--").map(|(i, _)| (&text[..i], &text[i + 2..])) {
            let flag: String = rest.chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
            let starts = before.ends_with([' ', '`', '(']);
            // Within backticks: what begins with another program's name has that program's flags.
            let span = before.rsplit('`').next().unwrap_or_default();
            let is_foreign = ["cargo ", "gltf-transform "].iter().any(|program| span.starts_with(program));
            if starts && !is_foreign && flag.starts_with(|c: char| c.is_ascii_lowercase()) {
                assert!(known.contains(&flag), "{}: --{flag}", document.display());
            }
        }
    }
}

#[test]
fn help_explains_commands_and_topics() {
    let help = |name: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_lightprobe")).arg("help").args(name).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, list, _) = help(&[]);
    assert_eq!(code, Some(0));
    for topic in TOPICS {
        assert!(list.contains(topic.name), "{}", topic.name);
        let (code, text, _) = help(&[topic.name]);
        assert!(code == Some(0) && text.lines().count() > 10, "{}", topic.name);
        assert!(!text.contains("```") && !text.contains("<!--") && !text.contains("|---"), "{}", topic.name);
    }
    let (_, bake, _) = help(&["bake"]);
    assert!(bake.contains("--target-error") && bake.contains("Usage: lightprobe bake"), "{bake}");
    let (code, _, message) = help(&["gitf"]);
    assert!(code == Some(2) && message.contains("'gltf'"), "{message}");
}
