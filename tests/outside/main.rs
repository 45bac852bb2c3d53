//! Tests that need what the repository does not bring, the shared scenes or Python: ignored where it is missing, see
//! [`needs`]. The test of the probes' truth is with them for its second scene.

mod adversarial;
#[path = "../common/mod.rs"]
mod common;
mod loader;
#[path = "../common/needs.rs"]
mod needs;
mod policy;
#[allow(dead_code)] // Each user of these needs another part.
#[path = "../pipeline/probe_file.rs"]
mod probe_file;
#[allow(dead_code)]
#[path = "../pipeline/program.rs"]
mod program;
#[path = "../gltf_loader/promises.rs"]
mod promises;
mod python;
mod scenes;
mod truth;

use std::process::ExitCode;

use needs::Need;

fn main() -> ExitCode {
    needs::run(vec![
        test!(adversarial::every_file_renders_or_is_refused, Need::Shared),
        test!(loader::shared_scenes_load_or_are_refused, Need::Shared),
        test!(loader::damaged_shared_scenes_never_panic, Need::Shared),
        test!(truth::cornell_probes_hold_what_paths_bring),
        test!(truth::probes_behind_a_door_ajar_hold_what_paths_bring, Need::Shared),
        test!(python::safetensors_opens_a_probe_file, Need::Safetensors),
        test!(python::the_script_of_the_readme_asks_as_the_tool_does, Need::Safetensors),
        test!(python::the_example_of_the_probe_file_runs, Need::Safetensors),
        test!(python::the_script_says_which_package_is_missing, Need::Python),
        test!(scenes::scenes_are_what_the_script_writes, Need::Python),
        test!(policy::what_is_missing_is_ignored_and_said),
        test!(policy::what_is_missing_fails_in_continuous_integration),
        test!(policy::a_machine_may_say_what_it_lacks),
    ])
}
