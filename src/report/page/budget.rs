//! How large a page may get, and which pictures give way.

use super::embed::Embedded;

/// Of all pixels in the page, bytes: leaves room for text and plots in a page of 8 MB.
pub const PICTURES_BYTES: usize = 7_200_000;

/// Coarsest resolution, as blocks of so many pixels along a side; what does not fit then is shown by its small picture alone.
const COARSEST: u32 = 8;

/// Resolutions at which a pair is packed, finest first, as blocks of so many pixels along a side.
pub fn factors(finest: u32) -> impl Iterator<Item = u32> {
    std::iter::successors(Some(finest), |factor| Some(2 * factor)).take_while(move |&f| f == finest || f <= COARSEST)
}

/// Chooses from pairs, which come in order of importance and each at several resolutions ([`factors`]), what takes at most `budget`
/// bytes: as long as they are too large, the last pair that has its full resolution is halved, then the last of those at a half, and
/// so on; those after the first `judged` all the way before any of the first. At last pairs are left out from the end.
pub fn fit(mut pairs: Vec<Vec<Embedded>>, judged: usize, budget: usize) -> Vec<Option<Embedded>> {
    // The first of a pair's resolutions is the one it has.
    let fits = |pairs: &[Vec<Embedded>]| {
        pairs.iter().filter_map(|levels| levels.first()).map(Embedded::size_bytes).sum::<usize>() <= budget
    };
    let halvings = |range: std::ops::Range<usize>| {
        factors(1).skip(1).flat_map(move |factor| range.clone().rev().map(move |i| (i, factor)))
    };
    let judged = judged.min(pairs.len());
    for (i, factor) in halvings(judged..pairs.len()).chain(halvings(0..judged)) {
        if !fits(&pairs) && pairs[i].len() > 1 && pairs[i][0].factor < factor {
            pairs[i].remove(0);
        }
    }
    for i in (0..pairs.len()).rev() {
        if !fits(&pairs) {
            pairs[i].clear();
        }
    }
    pairs.into_iter().map(|levels| levels.into_iter().next()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::shrink::PixelExtent;
    use super::*;

    /// A pair of 64 kB at full resolution.
    fn fake(factor: u32) -> Embedded {
        let text = "x".repeat(64_000 / (factor * factor) as usize);
        Embedded {
            factor,
            size: PixelExtent { width: 1, height: 1 },
            base: text,
            candidate: String::new(),
            is_candidate_relative: false,
            difference: String::new(),
            scale: 1.0,
        }
    }

    fn chosen(judged: usize, budget: usize) -> Vec<u32> {
        let pairs = (0..3).map(|_| factors(1).map(fake).collect()).collect();
        fit(pairs, judged, budget).iter().map(|pair| pair.as_ref().map_or(0, |pair| pair.factor)).collect()
    }

    #[test]
    fn the_last_give_way_first() {
        assert_eq!(chosen(3, 192_000), [1, 1, 1]);
        assert_eq!(chosen(3, 191_999), [1, 1, 2]);
        assert_eq!(chosen(3, 100_000), [1, 2, 2]);
        assert_eq!(chosen(3, 47_999), [2, 2, 4]);
        assert_eq!(chosen(3, 3000), [8, 8, 8]);
        assert_eq!(chosen(3, 2999), [8, 8, 0]);
        assert_eq!(chosen(3, 0), [0, 0, 0]);
    }

    #[test]
    fn what_is_not_judged_gives_way_before_what_is() {
        assert_eq!(chosen(1, 100_000), [1, 2, 2]);
        assert_eq!(chosen(1, 66_000), [1, 8, 8]);
        assert_eq!(chosen(1, 65_999), [2, 8, 8]);
        assert_eq!(chosen(9, 100_000), [1, 2, 2]);
    }

    #[test]
    fn large_pictures_begin_coarse() {
        assert_eq!(factors(1).collect::<Vec<_>>(), [1, 2, 4, 8]);
        assert_eq!(factors(4).collect::<Vec<_>>(), [4, 8]);
        assert_eq!(factors(16).collect::<Vec<_>>(), [16]);
    }
}
