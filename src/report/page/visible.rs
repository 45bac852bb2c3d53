//! Names from outside, made safe to look at: what would be invisible or would turn the text around it is spelled out.

/// `text` with control characters and those of Unicode's bidirectional algorithm (UAX #9, section 2) as ⟨U+202E⟩, so that a name
/// cannot pose as another. Line breaks count as control characters. Markup is the template engine's to escape.
pub fn visible(text: &str) -> String {
    let spelled = |c: char| if is_hidden(c) { format!("⟨U+{:04X}⟩", c as u32) } else { c.to_string() };
    text.chars().map(spelled).collect()
}

fn is_hidden(character: char) -> bool {
    character.is_control()
        || matches!(character,
            '\u{061C}' | '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2060}'..='\u{2069}' | '\u{FEFF}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_turns_text_around_is_spelled_out() {
        assert_eq!(visible("exr.\u{202E}gnp\n"), "exr.⟨U+202E⟩gnp⟨U+000A⟩");
        assert_eq!(visible("Räume/客厅 <b>"), "Räume/客厅 <b>");
        assert_eq!(visible("שלום"), "שלום");
    }
}
