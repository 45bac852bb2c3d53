//! Points that cover their domain evenly, in blocks of sixteen.
//!
//! Inside a block every pair of dimensions has its own Owen-scrambled (0,2)-sequence in its own order ("padding":
//! Kollig & Keller 2002, Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020). In each pair, every
//! elementary interval of area 1/16 (1 × 16, 2 × 8, 4 × 4, …) holds one point. The first 2, 4 and 8 points are
//! stratified likewise.
//!
//! Blocks are independent of each other. This has two uses:
//! * The spread between the means of blocks measures the error of their mean. The spread between single points would
//!   overestimate it, because it ignores the stratification.
//! * A run of more blocks continues a shorter run.
//!
//! Owen's scrambling flips each bit of a coordinate by a random bit that depends on the values of all higher bits. Four
//! bits tell sixteen points apart, so a coordinate needs 1 + 2 + 4 + 8 = 15 random bits ([`scrambled`]). These are few
//! enough to draw directly; longer sequences approximate them by hashing. The bits below the fourth are independent
//! random bits for each point.

use glam::Vec2;

use super::random::{Numbers, Purpose, Random, mix, unit_from_bits};

/// Points in a block.
pub const BLOCK: u32 = 16;

/// Bits that tell the points of a block apart.
const BITS: u32 = BLOCK.ilog2();

/// Random bits that scrambling one coordinate takes.
const TREE_BITS: u32 = BLOCK - 1;

/// Pairs of dimensions from here on are independent random numbers. Paths that read them come from different places by
/// then, so that stratifying them does not pay; with 16, which is two bounces earlier, `reference` in one closed room had
/// 1.25 × the variance.
const STRATIFIED_PAIRS: u32 = 32;

/// Odd factors that distribute small counters over 64 bits: the fractional parts of the golden ratio and of √2, × 2⁶⁴.
const PAIR_STEP: u64 = 0x9E37_79B9_7F4A_7C15;
const INDEX_STEP: u64 = 0x6A09_E667_F3BC_C909;

/// Sixteen points in any number of dimensions.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    key: u64,
}

impl Block {
    /// The four arguments name the block as they name a stream of [`Random`]. Blocks of different names are
    /// independent.
    pub fn new(seed: u64, purpose: Purpose, a: u64, b: u64) -> Block {
        let mut random = Random::new(seed, purpose, a, b);
        let high = u64::from(random.bits());
        Block { key: (high << 32) | u64::from(random.bits()) }
    }

    /// Point `index` of the block, `index` < [`BLOCK`]. Reading starts at the first dimension.
    pub fn sample(&self, index: u32) -> BlockSample {
        debug_assert!(index < BLOCK);
        BlockSample { key: self.key, index, pair: 0, second: None }
    }
}

/// One point of a [`Block`], read dimension by dimension.
#[derive(Debug, Clone)]
pub struct BlockSample {
    key: u64,
    index: u32,
    /// Number of the next pair of dimensions.
    pair: u32,
    /// The second dimension of a pair of which only the first has been read.
    second: Option<u32>,
}

impl BlockSample {
    /// Continues reading at pair `pair`. Each decision thus keeps its dimensions, whatever was drawn before it.
    #[inline]
    pub fn seek(&mut self, pair: u32) {
        self.pair = pair;
        self.second = None;
    }

    /// A word for decisions by hashing ([`crate::trace::Ray::salt`]). It uses up no dimension.
    #[inline]
    pub fn salt(&self) -> u32 {
        (self.key as u32) ^ (self.index << 28) ^ self.pair.wrapping_mul(PAIR_STEP as u32)
    }

    #[inline]
    fn next_pair(&mut self) -> [u32; 2] {
        let scramble = mix(self.key ^ u64::from(self.pair + 1).wrapping_mul(PAIR_STEP));
        let below = mix(scramble ^ u64::from(self.index + 1).wrapping_mul(INDEX_STEP));
        self.pair += 1;
        if self.pair > STRATIFIED_PAIRS {
            return [below as u32, (below >> 32) as u32];
        }
        let index = scrambled(self.index, scramble as u32);
        // Four bits scrambled are four bits: the mask only tells the compiler so.
        let [x, y] = SEQUENCE[(index & (BLOCK - 1)) as usize].map(u32::from);
        let x = scrambled(x, (scramble >> TREE_BITS) as u32);
        let y = scrambled(y, (scramble >> (2 * TREE_BITS)) as u32);
        // The two halves of `below` fill the bits below the four that stratify.
        [(x << (32 - BITS)) | (below as u32 >> BITS), (y << (32 - BITS)) | ((below >> 32) as u32 >> BITS)]
    }
}

impl Numbers for BlockSample {
    #[inline]
    fn uniform(&mut self) -> f32 {
        unit_from_bits(self.bits())
    }

    #[inline]
    fn bits(&mut self) -> u32 {
        if let Some(second) = self.second.take() {
            return second;
        }
        let [first, second] = self.next_pair();
        self.second = Some(second);
        first
    }

    /// The next whole pair. It skips a second dimension that has not been read.
    #[inline]
    fn pair(&mut self) -> Vec2 {
        self.second = None;
        Vec2::from(self.next_pair().map(unit_from_bits))
    }
}

/// Sixteen bits of a word in each quarter of another.
const IN_QUARTERS: u64 = 0x0001_0001_0001_0001;

/// For each value of four bits the random bits that belong to them, one in each quarter, the one of the lowest bit first: of
/// bit k from the top that which belongs to the values of the bits above it.
const NODES: [u64; BLOCK as usize] = {
    let mut nodes = [0; BLOCK as usize];
    let mut value = 0;
    while value < nodes.len() {
        let mut k = 0;
        while k < BITS {
            let node = (1 << k) - 1 + (value >> (BITS - k));
            nodes[value] |= 1 << (node as u32 + 16 * (BITS - 1 - k));
            k += 1;
        }
        value += 1;
    }
    nodes
};

/// Owen's scrambling of four bits. Each is flipped by its random bit of [`NODES`].
#[inline]
fn scrambled(value: u32, random: u32) -> u32 {
    /// Brings the lowest bit of quarter k to bit 48 + k; all other products lie elsewhere.
    const GATHER: u64 = 1 << 48 | 1 << 33 | 1 << 18 | 1 << 3;
    let chosen = (u64::from(random & ((1 << TREE_BITS) - 1)) * IN_QUARTERS) & NODES[(value & (BLOCK - 1)) as usize];
    // The top bit of a quarter is then whether any of it is set.
    let set = (chosen + IN_QUARTERS * 0x7FFF) >> 15 & IN_QUARTERS;
    value ^ (set.wrapping_mul(GATHER) >> 48) as u32 & (BLOCK - 1)
}

/// The (0,2)-sequence, both coordinates in units of 1/16. The first dimension is the index with its bits reversed, the second
/// (Sobol' 1967) adds the columns of Pascal's triangle modulo 2.
const SEQUENCE: [[u8; 2]; BLOCK as usize] = {
    const COLUMNS: [u8; BITS as usize] = [0b1000, 0b1100, 0b1010, 0b1111];
    let mut points = [[0; 2]; BLOCK as usize];
    let mut index = 0;
    while index < points.len() {
        let mut k = 0;
        while k < COLUMNS.len() {
            let bit = (index >> k & 1) as u8;
            points[index][0] |= bit << (COLUMNS.len() - 1 - k);
            points[index][1] ^= bit * COLUMNS[k];
            k += 1;
        }
        index += 1;
    }
    points
};

#[cfg(test)]
mod tests {
    use super::*;

    fn block(b: u64) -> Block {
        Block::new(11, Purpose::Path, 5, b)
    }

    /// Pair `pair` of the first `n` points.
    fn points(block: Block, pair: u32, n: u32) -> Vec<Vec2> {
        let point = |i| {
            let mut sample = block.sample(i);
            sample.seek(pair);
            sample.pair()
        };
        (0..n).map(point).collect()
    }

    /// The definition, bit by bit.
    #[test]
    fn every_bit_is_flipped_by_the_random_bit_of_those_above_it() {
        let mut random = Random::new(1, Purpose::Path, 0, 0);
        for _ in 0..1000 {
            let tree = random.bits();
            for value in 0..BLOCK {
                let flip = |k: u32| {
                    let node = (1 << k) - 1 + (value >> (BITS - k));
                    (tree >> node & 1) << (BITS - 1 - k)
                };
                assert_eq!(scrambled(value, tree), value ^ (0..BITS).map(flip).sum::<u32>(), "{value} {tree:x}");
            }
        }
    }

    #[test]
    fn the_sequence_is_that_of_van_der_corput_and_sobol() {
        for index in 0..BLOCK {
            let reversed = index.reverse_bits() >> (32 - BITS);
            // Pascal's triangle modulo 2.
            let sobol = [0b1000, 0b1100, 0b1010, 0b1111].into_iter().enumerate();
            let sobol = sobol.fold(0, |sum, (k, column)| sum ^ (column * (index >> k & 1)));
            assert_eq!(SEQUENCE[index as usize].map(u32::from), [reversed, sobol]);
        }
    }

    #[test]
    fn every_elementary_interval_holds_one_point() {
        for b in 0..50 {
            for pair in 0..6 {
                // Prefixes whose length is a power of two are stratified too.
                for n in [2u32, 4, 8, 16] {
                    let points = points(block(b), pair, n);
                    for columns in (0..=n.ilog2()).map(|k| 1 << k) {
                        let rows = n / columns;
                        let mut count = vec![0; n as usize];
                        for p in &points {
                            count[((p.x * columns as f32) as u32 * rows + (p.y * rows as f32) as u32) as usize] += 1;
                        }
                        assert!(count.iter().all(|c| *c == 1), "{columns} × {rows}: {count:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn single_points_are_uniform() {
        // One point of many blocks, in 8 × 8 cells: χ² of 63 degrees of freedom, mean 63 and standard deviation 11.2.
        // Below 63 + 5 · 11.2 = 119: the χ² tail beyond it is 2e-5, and twelve are looked at.
        for (index, pair) in [(0, 0), (0, 1), (3, 0), (3, 7), (15, 0), (15, 2)] {
            for high in [true, false] {
                let n = 20_000;
                let mut count = [0f64; 64];
                for b in 0..n {
                    let p = points(block(b), pair, 16)[index];
                    // The coordinates themselves, or their bits below those that stratify.
                    let p = if high { p } else { (p * 16.0).fract() };
                    count[(p.x * 8.0) as usize * 8 + (p.y * 8.0) as usize] += 1.0;
                }
                let expected = n as f64 / 64.0;
                let chi_squared: f64 = count.iter().map(|c| (c - expected).powi(2) / expected).sum();
                assert!(chi_squared < 119.0, "point {index}, pair {pair}: χ² = {chi_squared}");
            }
        }
    }

    #[test]
    fn blocks_and_pairs_of_dimensions_are_independent() {
        // Correlation of one point's coordinates in two blocks, or in two pairs of one block. From 20,000 pairs of
        // values its standard error is 0.007; the bound is five of them, because nine correlations are tested.
        let n = 20_000;
        let x = |b: u64, pair: u32, index: usize| f64::from(points(block(b), pair, 16)[index].x) - 0.5;
        let correlation = |f: &dyn Fn(u64) -> f64| (0..n).map(f).sum::<f64>() * 12.0 / n as f64;
        for index in [0, 5, 15] {
            let blocks = correlation(&|b| x(b, 0, index) * x(b + 1, 0, index));
            let pairs = correlation(&|b| x(b, 0, index) * x(b, 1, index));
            let far = correlation(&|b| x(b, 2, index) * x(b, 11, index));
            assert!(blocks.abs() < 0.036 && pairs.abs() < 0.036 && far.abs() < 0.036, "{blocks} {pairs} {far}");
        }
    }

    #[test]
    fn block_means_predict_their_error() {
        // The mean of x·y over a block is 1/4. The spread of 4000 block means predicts the error of their mean. It is
        // far below the spread of sixteen independent points, 7/144/16.
        let means: Vec<f64> = (0..4000)
            .map(|b| points(block(b), 3, 16).iter().map(|p| f64::from(p.x * p.y)).sum::<f64>() / 16.0)
            .collect();
        let n = means.len() as f64;
        let mean = means.iter().sum::<f64>() / n;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // Four standard errors: 6e-5 of a normal distribution lies beyond.
        assert!((mean - 0.25).abs() < 4.0 * (variance / n).sqrt(), "{mean}");
        assert!(variance < 0.05 * 7.0 / 144.0 / 16.0, "{variance}");
    }

    #[test]
    fn seeking_and_halves_keep_dimensions_apart() {
        let mut a = block(0).sample(7);
        let (x, y) = (a.uniform(), a.uniform());
        let mut b = block(0).sample(7);
        assert_eq!(b.pair(), Vec2::new(x, y));
        let first = b.uniform();
        // This skips the other half of the pair.
        let next = b.pair();
        b.seek(1);
        assert_eq!(b.pair().x, first);
        assert_eq!(b.pair(), next);
    }
}
