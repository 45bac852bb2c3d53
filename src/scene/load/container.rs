//! GLB, the binary container of glTF: header, JSON chunk, optional BIN chunk. A file that does not start with GLB's
//! magic bytes is JSON text.

use std::ops::Range;

const MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: &[u8; 4] = b"JSON";
const CHUNK_BIN: &[u8; 4] = b"BIN\0";

/// The ranges of the parts within the file's bytes.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Parts {
    pub json: Range<usize>,
    pub bin: Option<Range<usize>>,
}

/// Finds the JSON chunk and the binary chunk. The error describes the fault.
///
/// The total length in the header is ignored. If the file is longer, the extra bytes are harmless; if it is shorter, a
/// chunk is cut off and gives the error.
pub(super) fn split(bytes: &[u8]) -> Result<Parts, String> {
    if !bytes.starts_with(MAGIC) {
        // A byte order mark is not part of JSON, but some editors write it.
        let start = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        return Ok(Parts { json: start..bytes.len(), bin: None });
    }
    let version = word(bytes, 4).ok_or("the GLB header is cut off")?;
    if version != 2 {
        return Err(format!("GLB version {version}, but only 2 is read"));
    }
    let json = chunk(bytes, 12, CHUNK_JSON)?.ok_or("the GLB file has no JSON chunk")?;
    let end = json.end;
    // The specification pads the JSON with spaces. Padding with NUL is common too.
    let trimmed = bytes[json.clone()].iter().rposition(|b| !matches!(b, 0 | b' ')).map_or(0, |last| last + 1);
    let json = json.start..json.start + trimmed;
    // Chunks start at multiples of four. Some writers omit the padding, so the next chunk may start right behind the
    // JSON.
    let padded = end.next_multiple_of(4);
    let bin = match chunk(bytes, padded, CHUNK_BIN)? {
        None if padded != end => chunk(bytes, end, CHUNK_BIN)?,
        found => found,
    };
    Ok(Parts { json, bin })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let raw = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(raw.try_into().ok()?))
}

/// The range of the data of the chunk at byte `at`. `None` if there is no chunk of this kind.
fn chunk(bytes: &[u8], at: usize, kind: &[u8; 4]) -> Result<Option<Range<usize>>, String> {
    let Some(length) = word(bytes, at) else { return Ok(None) };
    if bytes.get(at + 4..at + 8) != Some(kind) {
        return Ok(None);
    }
    let start = at + 8;
    match start.checked_add(length as usize) {
        Some(end) if end <= bytes.len() => Ok(Some(start..end)),
        _ => Err(format!(
            "the {} chunk says {length} bytes, but only {} follow: the file is cut off",
            String::from_utf8_lossy(kind).trim_end_matches('\0'),
            bytes.len() - start
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
        let mut out = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, data) in [(CHUNK_JSON, json), (CHUNK_BIN, bin)] {
            out.extend((data.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(data);
        }
        out
    }

    #[test]
    fn finds_both_chunks() {
        assert_eq!(split(&glb(b"{}  ", &[7; 4])), Ok(Parts { json: 20..22, bin: Some(32..36) }));
        assert_eq!(split(&glb(b"{}\0\0", &[])), Ok(Parts { json: 20..22, bin: Some(32..32) }));
        assert_eq!(split(b"{}"), Ok(Parts { json: 0..2, bin: None }));
    }

    #[test]
    fn cut_off_anywhere_is_an_error_or_has_no_bin() {
        let whole = glb(b"{}  ", &[7; 4]);
        for length in 4..whole.len() {
            if let Ok(parts) = split(&whole[..length]) {
                assert!(length >= 24 && parts.bin.is_none(), "{length}");
            }
        }
    }
}
