//! Names and messages from a file, made safe to print on one line.

/// The text `kind index 'name'`, for example `mesh 3 'Wall'`. It is safe to print on one line.
pub(super) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        None | Some("") => format!("{kind} {index}"),
        Some(name) => format!("{kind} {index} '{}'", short(name)),
    }
}

/// A name for a one-line message: without control characters, and cut if it is long.
pub(super) fn short(name: &str) -> String {
    const MAX_CHARS: usize = 60;
    let cut: String = name.chars().take(MAX_CHARS).collect();
    let dots = if cut.len() < name.len() { "…" } else { "" };
    format!("{}{dots}", cut.escape_debug())
}

/// A message from a parser or decoder as one line. A long message is cut after a whole word.
pub(super) fn sentence(message: &str) -> String {
    const MAX_CHARS: usize = 240;
    let line = message.split_whitespace().collect::<Vec<_>>().join(" ");
    let Some((end, _)) = line.char_indices().nth(MAX_CHARS) else { return line.escape_debug().to_string() };
    let kept = line[..end].rsplit_once(' ').map_or(&line[..end], |(kept, _)| kept);
    format!("{} …", kept.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_stay_on_one_line() {
        assert_eq!(label("mesh", 3, Some("Wall")), "mesh 3 'Wall'");
        assert_eq!(label("mesh", 3, Some("")), "mesh 3");
        assert_eq!(label("mesh", 3, Some("a\nb")), "mesh 3 'a\\nb'");
        assert_eq!(short(&"ä".repeat(61)), format!("{}…", "ä".repeat(60)));
        assert_eq!(short(&"ä".repeat(60)), "ä".repeat(60));
    }

    #[test]
    fn long_messages_end_after_a_whole_word() {
        assert_eq!(sentence("two\n  words"), "two words");
        let cut = sentence(&"word ".repeat(100));
        assert!(cut.ends_with("word …") && cut.chars().count() <= 242, "{cut}");
    }
}
