//! Cargo's build script: tells the linker where Embree 4 is, and the binaries where to find it when they run.
//!
//! Looked for in `EMBREE_DIR`, then in `.deps/embree` (made by `scripts/setup.sh`), then on the system. The flags come
//! from here and not from `.cargo/config.toml`, because a caller's `RUSTFLAGS` would replace those.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
    process::Command,
};

const LIBRARY: &str = "libembree4.so";

fn main() {
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    let linked = find_embree().and_then(|library| {
        // Also notices that the library is gone, as after moving the checkout: its absolute path is in the binaries.
        println!("cargo::rerun-if-changed={}", library.display());
        link(&library).map_err(|error| format!("cannot link {}: {error}", library.display()))
    });
    if let Err(message) = linked {
        println!("cargo::error={message}");
    }
}

/// The Embree 4 library to link, or what to do about its absence.
fn find_embree() -> Result<PathBuf, String> {
    if let Some(dir) = env::var_os("EMBREE_DIR").filter(|dir| !dir.is_empty()).map(PathBuf::from) {
        let arch = format!("lib/{}-linux-gnu", cargo_var("CARGO_CFG_TARGET_ARCH"));
        return first_in([dir.clone(), dir.join("lib"), dir.join("lib64"), dir.join(arch)]).ok_or_else(|| {
            format!("EMBREE_DIR={} holds no {LIBRARY}, there or in lib: correct or unset it", dir.display())
        });
    }
    first_in([Path::new(&cargo_var("CARGO_MANIFEST_DIR")).join(".deps/embree/lib")])
        .or_else(|| first_in(system_folders()))
        .ok_or_else(|| {
            "Embree 4 not found: run scripts/setup.sh, or set EMBREE_DIR to the folder of an installed one".to_owned()
        })
}

fn first_in(folders: impl IntoIterator<Item = PathBuf>) -> Option<PathBuf> {
    folders.into_iter().find_map(|folder| embree_in(&folder))
}

/// `libembree4.so` in `folder`, else a versioned name such as `libembree4.so.4`, which comes without development files.
fn embree_in(folder: &Path) -> Option<PathBuf> {
    let is_embree =
        |name: &str| name.starts_with("libembree4.so.") || (name.starts_with("libembree4-") && name.contains(".so"));
    let exact = folder.join(LIBRARY);
    if exact.is_file() {
        return Some(exact);
    }
    let entries = fs::read_dir(folder).ok()?.flatten();
    entries
        .filter(|entry| entry.file_name().to_str().is_some_and(is_embree))
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .min()
}

/// Where pkg-config, the compiler and custom put a system's Embree.
fn system_folders() -> Vec<PathBuf> {
    let answer = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| PathBuf::from(text.trim()))
    };
    let arch = cargo_var("CARGO_CFG_TARGET_ARCH");
    let by_pkg_config = answer("pkg-config", &["--variable=libdir", "embree4"]);
    let by_compiler = answer("cc", &[&format!("-print-file-name={LIBRARY}")])
        .filter(|file| file.is_absolute()) // else it echoes the name
        .map(|file| file.with_file_name(""));
    let custom = ["/usr/local/lib", "/usr/local/lib64", "/usr/lib", "/usr/lib64"].map(PathBuf::from);
    let multiarch = PathBuf::from(format!("/usr/lib/{arch}-linux-gnu"));
    by_pkg_config.into_iter().chain(by_compiler).chain(custom).chain([multiarch]).collect()
}

fn link(library: &Path) -> io::Result<()> {
    let real = library.canonicalize()?;
    let real_folder = real.parent().unwrap_or(Path::new("/"));
    let search = if library.ends_with(LIBRARY) { library.with_file_name("") } else { symlink_in_out_dir(&real)? };
    println!("cargo::rustc-link-search=native={}", search.display());

    if cargo_var("CARGO_CFG_TARGET_OS") == "linux" {
        // DT_RPATH and not DT_RUNPATH: it also serves the libraries that Embree itself needs (TBB beside it), and a
        // stray LD_LIBRARY_PATH does not put another Embree in its place. Linkers differ in what they do unasked.
        link_argument("--disable-new-dtags");
        // A copied binary takes the libraries beside it.
        rpath("$ORIGIN");
        rpath("$ORIGIN/../lib");
    }
    // Where the file really is and not where a symlink to it is: Embree looks for its TBB beside the path it was
    // loaded by.
    rpath(&real_folder.display().to_string());
    Ok(())
}

/// The linker wants the one name; gives it to a library that has another.
fn symlink_in_out_dir(real: &Path) -> io::Result<PathBuf> {
    let folder = PathBuf::from(cargo_var("OUT_DIR"));
    let link = folder.join(LIBRARY);
    match fs::remove_file(&link) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => std::os::unix::fs::symlink(real, &link)?,
    }
    Ok(folder)
}

fn rpath(folder: &str) {
    link_argument("-rpath");
    link_argument(folder);
}

/// Hands one argument to the linker behind the compiler driver; `-Wl,` would split a path at its commas.
fn link_argument(argument: &str) {
    println!("cargo::rustc-link-arg=-Xlinker");
    println!("cargo::rustc-link-arg={argument}");
}

/// A variable that cargo sets for every build script.
fn cargo_var(name: &str) -> String {
    env::var(name).unwrap_or_default()
}
