//! `lightprobe diff-report` as its users meet it: the built program on what it baked and rendered itself.

mod baseline;
#[path = "../common/mod.rs"]
mod common;
mod faults;
mod golden;
mod made;
mod page;
#[allow(dead_code)]
#[path = "../pipeline/probe_file.rs"]
mod probe_file;
#[allow(dead_code)]
#[path = "../pipeline/program.rs"]
mod program;
mod sides;
mod thresholds;
