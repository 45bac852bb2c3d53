//! Captures as bytes, for files that a bake writes for itself.
//!
//! Numbers are little-endian. Lists begin with their length (u64). A capture that comes back is the same bit by bit.

use glam::{Vec2, Vec3};

use super::captured::{ProbeCapture, Seen};
use super::surfel::{PackedNormal, Surfel};
use crate::light::sampled::RayCount;

/// Appends numbers and lists to bytes.
struct Writer(Vec<u8>);

impl Writer {
    fn number(&mut self, number: u64) {
        self.0.extend(number.to_le_bytes());
    }

    fn list<T, const N: usize>(&mut self, list: &[T], bytes: impl Fn(&T) -> [u8; N]) {
        self.number(list.len() as u64);
        list.iter().for_each(|item| self.0.extend(bytes(item)));
    }
}

/// Reads what a [`Writer`] wrote; `None` where that is something else.
struct Reader<'b>(&'b [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    fn number(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take()?))
    }

    fn list<T, const N: usize>(&mut self, item: impl Fn([u8; N]) -> Option<T>) -> Option<Vec<T>> {
        let length = usize::try_from(self.number()?).ok()?;
        let (items, rest) = self.0.split_at_checked(length.checked_mul(N)?)?;
        self.0 = rest;
        items.as_chunks::<N>().0.iter().map(|bytes| item(*bytes)).collect()
    }
}

fn floats<const N: usize, const B: usize>(numbers: [f32; N]) -> [u8; B] {
    let mut bytes = [0; B];
    bytes.as_chunks_mut::<4>().0.iter_mut().zip(numbers).for_each(|(to, number)| *to = number.to_le_bytes());
    bytes
}

fn of_floats<const N: usize>(bytes: &[u8]) -> [f32; N] {
    let chunks = bytes.as_chunks::<4>().0;
    std::array::from_fn(|i| chunks.get(i).map_or(0.0, |chunk| f32::from_le_bytes(*chunk)))
}

fn texel_and_light((texel, light): &(u32, Vec3)) -> [u8; 16] {
    floats([f32::from_bits(*texel), light.x, light.y, light.z])
}

fn of_texel_and_light(bytes: [u8; 16]) -> Option<(u32, Vec3)> {
    let [texel, x, y, z] = of_floats(&bytes);
    Some((texel.to_bits(), Vec3::new(x, y, z)))
}

fn two_vectors((a, b): &(Vec3, Vec3)) -> [u8; 24] {
    floats([a.x, a.y, a.z, b.x, b.y, b.z])
}

/// Bytes of a packed capture: with room for all of it the writer does not grow, which would take twice as much.
fn packed_bytes(capture: &ProbeCapture, filtered: &[Vec2]) -> usize {
    /// Counts and lengths of lists.
    const NUMBERS: usize = 6 + 8;
    let ProbeCapture { surfels, geometric, emitted, shown, emitter_samples, seen, backs, .. } = capture;
    let light = (emitted.len() + shown.len()) * 16 + emitter_samples.len() * 24;
    let lists = surfels.len() * Surfel::BYTES + geometric.len() * 4 + light;
    8 * NUMBERS + lists + seen.len() * 20 + backs.len() * 4 + filtered.len() * 8
}

/// A capture whose distances have been filtered, and these filtered distances. Inverse: [`unpack`].
pub fn pack(capture: &ProbeCapture, filtered: &[Vec2]) -> Vec<u8> {
    let mut out = Writer(Vec::with_capacity(packed_bytes(capture, filtered)));
    let RayCount { primary, shadow } = capture.rays;
    let counts = [capture.hits_outside_volume, capture.non_finite, capture.light_clamped];
    [capture.texels as u64, primary, shadow].into_iter().chain(counts).for_each(|number| out.number(number));
    out.list(&capture.surfels, |surfel| surfel.to_bytes());
    out.list(&capture.geometric, |normal| normal.to_bytes());
    out.list(&capture.emitted, texel_and_light);
    out.list(&capture.shown, texel_and_light);
    out.list(&capture.emitter_samples, two_vectors);
    out.list(&capture.seen, |seen| floats::<5, 20>(seen.numbers()));
    out.list(&capture.backs, |texel| texel.to_le_bytes());
    out.list(filtered, |distance| floats::<2, 8>(distance.to_array()));
    out.0
}

/// The inverse of [`pack`]; `None` where the bytes are none of a capture.
pub fn unpack(bytes: &[u8]) -> Option<(ProbeCapture, Vec<Vec2>)> {
    let mut from = Reader(bytes);
    let texels = usize::try_from(from.number()?).ok()?;
    let rays = RayCount { primary: from.number()?, shadow: from.number()? };
    let (hits_outside_volume, non_finite, light_clamped) = (from.number()?, from.number()?, from.number()?);
    let capture = ProbeCapture {
        texels,
        surfels: from.list(Surfel::of_bytes)?,
        geometric: from.list(|bytes| Some(PackedNormal::of_bytes(bytes)))?,
        emitted: from.list(of_texel_and_light)?,
        shown: from.list(of_texel_and_light)?,
        emitter_samples: from.list(|bytes: [u8; 24]| {
            let [a, b, c, x, y, z] = of_floats(&bytes);
            Some((Vec3::new(a, b, c), Vec3::new(x, y, z)))
        })?,
        distances: Vec::new(),
        seen: from.list(|bytes: [u8; 20]| Some(Seen::of_numbers(of_floats(&bytes))))?,
        backs: from.list(|bytes| Some(u32::from_le_bytes(bytes)))?,
        rays,
        hits_outside_volume,
        non_finite,
        light_clamped,
    };
    let filtered = from.list(|bytes: [u8; 8]| Some(Vec2::from_array(of_floats(&bytes))))?;
    from.0.is_empty().then_some((capture, filtered))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{Purpose, Random};
    use crate::probe::store::surface::Facing;

    fn capture() -> ProbeCapture {
        let mut random = Random::new(3, Purpose::Capture, 0, 0);
        let mut vector = move || Vec3::new(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
        let surfel = |i: u32, v: Vec3| {
            let mut bytes = [0; Surfel::BYTES];
            let numbers: [u8; 28] = floats([v.x, v.y, v.z, v.z, v.y, v.x, f32::from_bits(i)]);
            bytes[..28].copy_from_slice(&numbers);
            bytes[28..32].copy_from_slice(&PackedNormal::of(v.normalize()).to_bytes());
            bytes[32..38].copy_from_slice(&[1, 2, 3, 4, 5, 6]);
            bytes[38] = Facing::of(v).index();
            Surfel::of_bytes(bytes).unwrap()
        };
        ProbeCapture {
            texels: 64,
            surfels: (0..9).map(|i| surfel(i, vector())).collect(),
            geometric: (0..9).map(|_| PackedNormal::of(vector().normalize())).collect(),
            emitted: vec![(u32::MAX, vector()), (0x7fa0_0000, vector())],
            shown: vec![(5, vector())],
            emitter_samples: vec![(vector(), vector())],
            distances: Vec::new(),
            seen: vec![Seen::of_numbers([0.1, 0.2, 0.3, 4.0, 0.5]); 3],
            backs: vec![4, 9],
            rays: RayCount { primary: 11, shadow: 12 },
            hits_outside_volume: 13,
            non_finite: 14,
            light_clamped: 15,
        }
    }

    #[test]
    fn captures_come_back_bit_by_bit() {
        let filtered = [Vec2::new(1.0, -0.0), Vec2::new(f32::MIN_POSITIVE / 2.0, 3.0)];
        let bytes = pack(&capture(), &filtered);
        let (back, distances) = unpack(&bytes).unwrap();
        assert_eq!(pack(&back, &distances), bytes);
        assert_eq!(format!("{back:?}"), format!("{:?}", capture()));
        assert_eq!(distances, filtered);
    }

    #[test]
    fn other_bytes_are_none() {
        let bytes = pack(&capture(), &[Vec2::ONE]);
        assert!((0..bytes.len()).all(|length| unpack(&bytes[..length]).is_none()));
        assert!(unpack(&[&bytes[..], &[0]].concat()).is_none());
        // A length that no memory holds.
        let mut long = bytes.clone();
        long[48..56].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(unpack(&long).is_none());
        let mut turned = bytes;
        turned[56 + 38] = 6;
        assert!(unpack(&turned).is_none(), "there is no seventh facing");
    }
}
