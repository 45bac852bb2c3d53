//! The probe file read by the Python package of its container.

use std::process::Command;

use crate::common::Folder;
use crate::program::{bake, scene, text};

pub fn safetensors_opens_a_probe_file() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("furnace"), "--set grid.spacing_m=1 --set encoding.irradiance=f32");
    let script = "import sys; from safetensors.numpy import load_file; t = load_file(sys.argv[1]); \
                  print(sorted((k, list(v.shape), float(v.astype('float64').sum())) for k, v in t.items()))";
    let output = Command::new("python3").args(["-c", script, text(&baked.path)]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listed = String::from_utf8(output.stdout).unwrap();
    for (name, tensor) in &baked.file.tensors {
        assert!(listed.contains(&format!("('{name}', {:?}", tensor.shape)), "{name} {:?}: {listed}", tensor.shape);
    }
}
