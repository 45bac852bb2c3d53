//! What `lightprobe help TOPIC` explains: the READMEs that stand beside what they describe.

use std::fmt::Write as _;

/// A text that is part of the program.
#[derive(Debug)]
pub struct Topic {
    pub name: &'static str,
    pub about: &'static str,
    /// Markdown.
    pub text: &'static str,
}

/// A topic of the README in this folder of the repository.
macro_rules! topic {
    ($name:literal, $folder:literal, $about:literal) => {
        Topic { name: $name, about: $about, text: include_str!(concat!("../../", $folder, "/README.md")) }
    };
}

/// No topic has the name of a command.
pub const TOPICS: &[Topic] = &[
    topic!("configuration", "configs", "Keys, layers, which spacing, --target-error"),
    topic!("presets", "configs/presets", "The methods, and how they compare"),
    topic!("gltf", "src/scene", "What is read of glTF, units, skies, what is refused"),
    topic!("light", "src/light", "The path tracer of `reference`, its noise, its BRDF"),
    topic!("probes", "src/probe", "The method, its limits, the probe file and its look-up"),
    topic!("report", "src/report", "Every figure and key of `bake` and `render`"),
    topic!("gates", "src/report/diff", "What `diff-report` judges, noise, its page"),
    topic!("ladders", "src/sweep", "What `sweep` compares and writes"),
    topic!("engines", "src/export", "Probes in three.js, Bevy, RTXGI"),
    topic!("scenes", "scenes", "The scenes of the repository"),
    topic!("tests", "tests", "What is tested, and stiff and extreme scenes"),
    topic!("scripts", "scripts", "The scripts of the repository"),
    topic!("source", "src", "How the source is divided"),
];

/// The topics as `--help` lists them.
pub fn list() -> String {
    let widest = TOPICS.iter().map(|topic| topic.name.len()).max().unwrap_or(0);
    let mut text = "Topics (lightprobe help TOPIC):".to_owned();
    for Topic { name, about, .. } in TOPICS {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  {name:widest$}  {about}");
    }
    text
}
