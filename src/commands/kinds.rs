//! Files of one kind where another is expected: swapped arguments are named as such.

use std::io::Read;
use std::path::Path;

use anyhow::{Result, bail};

use crate::export::RECORD;
use crate::system::input::open_file;

const SCENE: &str = "a scene";
const PROBES: &str = "a probe file";

/// Kinds by the ends of their names.
const BY_NAME: &[(&str, &str)] = &[("glb", SCENE), ("gltf", SCENE), ("probes", PROBES)];

/// Kinds by their first bytes. A probe file begins with a length.
const BY_CONTENT: &[(&[u8], &str)] = &[
    (b"\x89PNG", "a picture"),
    (b"\x76\x2f\x31\x01", "a picture"),
    (b"\xff\xd8\xff", "a picture"),
    (b"#?", "a picture"),
    (b"glTF", SCENE),
    (b"{", "a JSON file"),
    (b"<!", "a page"),
];

/// What a file surely is; `None` where nothing tells.
fn kind_of(path: &Path) -> Option<&'static str> {
    let extension = path.extension().unwrap_or_default();
    if let Some((_, kind)) = BY_NAME.iter().find(|(name, _)| extension.eq_ignore_ascii_case(name)) {
        return Some(kind);
    }
    let mut first = Vec::new();
    open_file(path).ok()?.take(4).read_to_end(&mut first).ok()?;
    BY_CONTENT.iter().find(|(magic, _)| first.starts_with(magic)).map(|(_, kind)| *kind)
}

/// Refuses what is surely no probe file. `usage` shows how the command is written.
pub fn expect_probes(path: &Path, usage: &str) -> Result<()> {
    let kind = match path.is_dir() && !path.join(RECORD).exists() {
        true => Some("a folder that `lightprobe export` did not write"),
        false => kind_of(path),
    };
    match kind {
        Some(kind) if kind != PROBES => {
            bail!("{} is {kind}, and a probe file belongs there; write `lightprobe {usage}`", path.display())
        }
        _ => Ok(()),
    }
}

/// Refuses what is surely no scene.
pub fn expect_scene(path: &Path, usage: &str) -> Result<()> {
    match kind_of(path) {
        // A scene in JSON under another name.
        Some(kind) if kind != SCENE && kind != "a JSON file" => {
            bail!("{} is {kind}, and a scene belongs there; write `lightprobe {usage}`", path.display())
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_the_wrong_place_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let said = |done: Result<()>| done.map_err(|error| error.to_string());
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let (picture, report) = (file("a", b"\x89PNG\r\n"), file("report.json", b"{}"));
        for (path, kind) in [
            (&file("a.GLB", b""), "a scene"),
            (&report, "a JSON file"),
            (&picture, "a picture"),
            (&folder.path().to_owned(), "a folder that"),
        ] {
            let message = said(expect_probes(path, "inspect PROBES")).unwrap_err();
            assert!(message.contains(kind) && message.contains("write `lightprobe inspect PROBES`"), "{message}");
        }
        for (path, kind) in [(&file("a.probes", b""), "a probe file"), (&picture, "a picture")] {
            let message = said(expect_scene(path, "bake SCENE -o OUT.probes")).unwrap_err();
            assert!(message.contains(kind), "{message}");
        }
        // A length first, as in a probe file of any name, and files that are not there.
        for path in [file("b.exr", b"\x40\0\0\0\0\0\0\0{"), folder.path().join("none")] {
            assert_eq!((said(expect_probes(&path, "")), said(expect_scene(&path, ""))), (Ok(()), Ok(())), "{path:?}");
        }
        file(RECORD, b"{}");
        assert_eq!(said(expect_probes(folder.path(), "")), Ok(()));
        // The loader says what is wrong with these.
        assert_eq!((said(expect_scene(&report, "")), said(expect_scene(folder.path(), ""))), (Ok(()), Ok(())));
    }
}
