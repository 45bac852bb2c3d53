//! Lines in which two texts differ.

use serde::Serialize;

/// Longest texts that are compared line by line, lines: the table of the comparison has the square of it.
const MOST_LINES: usize = 2000;

/// A line that only one text has.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Line {
    /// "base" or "candidate".
    pub side: &'static str,
    /// From 1.
    pub number: usize,
    pub text: String,
}

/// The lines that are not part of a longest common subsequence (D. Hirschberg, 1975, gives the recurrence), in order; `None` where a
/// text is too long to compare.
pub fn differing_lines(base: &str, candidate: &str) -> Option<Vec<Line>> {
    let [base, candidate]: [Vec<&str>; 2] = [base.lines().collect(), candidate.lines().collect()];
    if base.len() > MOST_LINES || candidate.len() > MOST_LINES {
        return None;
    }
    // common[i][j]: length of the longest common subsequence of base[i..] and candidate[j..].
    let columns = candidate.len() + 1;
    let mut common = vec![0_u16; (base.len() + 1) * columns];
    for i in (0..base.len()).rev() {
        for j in (0..candidate.len()).rev() {
            common[i * columns + j] = if base[i] == candidate[j] {
                common[(i + 1) * columns + j + 1] + 1
            } else {
                common[(i + 1) * columns + j].max(common[i * columns + j + 1])
            };
        }
    }
    let line = |side, number: usize, text: &str| Line { side, number: number + 1, text: text.to_owned() };
    let (mut i, mut j) = (0, 0);
    let mut lines = Vec::new();
    while i < base.len() || j < candidate.len() {
        if i < base.len() && j < candidate.len() && base[i] == candidate[j] {
            (i, j) = (i + 1, j + 1);
        } else if j == candidate.len()
            || (i < base.len() && common[(i + 1) * columns + j] >= common[i * columns + j + 1])
        {
            lines.push(line("base", i, base[i]));
            i += 1;
        } else {
            lines.push(line("candidate", j, candidate[j]));
            j += 1;
        }
    }
    Some(lines)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn brief(base: &str, candidate: &str) -> Vec<String> {
        let lines = differing_lines(base, candidate).unwrap();
        lines.iter().map(|line| format!("{}{}{}", &line.side[..1], line.number, line.text)).collect()
    }

    #[test]
    fn only_what_differs_is_named() {
        assert!(brief("a\nb", "a\nb").is_empty());
        assert_eq!(brief("a\nb\nc", "a\nx\nc"), ["b2b", "c2x"]);
        assert_eq!(brief("a", "0\na"), ["c10"]);
        assert_eq!(brief("", "a"), ["c1a"]);
        assert!(differing_lines(&"x\n".repeat(MOST_LINES + 1), "").is_none());
    }

    proptest! {
        #[test]
        fn what_is_left_is_the_same(base in "[ab\n]{0,30}", candidate in "[ab\n]{0,30}") {
            let differing = differing_lines(&base, &candidate).unwrap();
            let rest = |side: &str, text: &str| -> Vec<String> {
                let is_named = |number: usize| differing.iter().any(|line| line.side == side && line.number == number + 1);
                text.lines().enumerate().filter(|(i, _)| !is_named(*i)).map(|(_, line)| line.to_owned()).collect()
            };
            prop_assert_eq!(rest("base", &base), rest("candidate", &candidate));
        }
    }
}
