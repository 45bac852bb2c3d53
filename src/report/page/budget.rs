//! How large a page may get, and which pictures give way.

use std::io;

use super::embed::Embedded;

/// Of all pixels in the page, bytes: leaves room for text and plots in a page of 8 MB.
pub const PICTURES_BYTES: usize = 7_200_000;

/// Coarsest resolution, as blocks of so many pixels along a side; what does not fit then is shown by its small picture alone.
const COARSEST: u32 = 8;

/// Packs `count` pairs, which come in order of importance, into at most `budget` bytes: as long as they are too large, the last pair
/// that has its full resolution is halved, then the last of those at a half, and so on; at last pairs are left out from the end.
/// `embed` packs pair `i` with blocks of a size.
///
/// # Errors
/// Those of `embed`.
pub fn fit(
    count: usize,
    budget: usize,
    embed: impl Fn(usize, u32) -> io::Result<Embedded>,
) -> io::Result<Vec<Option<Embedded>>> {
    let mut pairs: Vec<Option<Embedded>> = (0..count).map(|i| embed(i, 1).map(Some)).collect::<io::Result<Vec<_>>>()?;
    let total = |pairs: &[Option<Embedded>]| pairs.iter().flatten().map(Embedded::size_bytes).sum::<usize>();
    let mut factor = 2;
    while factor <= COARSEST {
        for i in (0..count).rev() {
            if total(&pairs) <= budget {
                return Ok(pairs);
            }
            if pairs[i].as_ref().is_some_and(|pair| pair.factor < factor) {
                pairs[i] = Some(embed(i, factor)?);
            }
        }
        factor *= 2;
    }
    for i in (0..count).rev() {
        if total(&pairs) <= budget {
            break;
        }
        pairs[i] = None;
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::super::shrink::Size;
    use super::*;

    /// A pair of 64 kB at full resolution.
    fn fake(_: usize, factor: u32) -> io::Result<Embedded> {
        let text = "x".repeat(64_000 / (factor * factor) as usize);
        Ok(Embedded {
            factor,
            size: Size { width: 1, height: 1 },
            base: text,
            candidate: String::new(),
            is_candidate_relative: false,
            difference: String::new(),
            scale: 1.0,
        })
    }

    fn factors(budget: usize) -> Vec<u32> {
        fit(3, budget, fake).unwrap().iter().map(|pair| pair.as_ref().map_or(0, |pair| pair.factor)).collect()
    }

    #[test]
    fn the_last_give_way_first() {
        assert_eq!(factors(192_000), [1, 1, 1]);
        assert_eq!(factors(191_999), [1, 1, 2]);
        assert_eq!(factors(100_000), [1, 2, 2]);
        assert_eq!(factors(47_999), [2, 2, 4]);
        assert_eq!(factors(3000), [8, 8, 8]);
        assert_eq!(factors(2999), [8, 8, 0]);
        assert_eq!(factors(0), [0, 0, 0]);
    }
}
