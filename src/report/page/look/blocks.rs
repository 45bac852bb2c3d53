//! Numbers as text in the page: their bytes in planes, deflated, in base64. Undone by `assets/page/look/data.js`.

use std::io;

use serde::Serialize;

use crate::probe::store::textures::{Numbers, Texture};
use crate::report::page::pack::pack_bytes;

/// How a block's numbers lie.
#[derive(Debug, Clone, Serialize)]
pub struct Block {
    pub name: String,
    pub count: usize,
    /// Bytes of a number: 1, 2 or 4.
    pub width: usize,
    /// Whether each is the difference from the one before, its sign in bit 0.
    pub is_difference: bool,
    /// Numbers a texel, where it is a texture.
    pub channels: usize,
    /// Whether the bits are those of floats.
    pub is_float: bool,
    #[serde(skip)]
    pub text: String,
}

impl Block {
    /// Whole numbers of so many bytes.
    ///
    /// # Errors
    /// None in practice: the writer is memory.
    pub fn new(name: &str, width: usize, is_difference: bool, numbers: &[u32]) -> io::Result<Block> {
        let mut before = 0;
        let mut code = |&number: &u32| {
            if !is_difference {
                return number;
            }
            let difference = number.wrapping_sub(before) as i32;
            before = number;
            ((difference << 1) ^ (difference >> 31)) as u32
        };
        let codes: Vec<u32> = numbers.iter().map(&mut code).collect();
        let plane = |byte: usize| codes.iter().map(move |code| (code >> (8 * byte)) as u8);
        let bytes: Vec<u8> = (0..width).flat_map(plane).collect();
        let (count, text) = (numbers.len(), pack_bytes(&bytes)?);
        Ok(Block { name: name.to_owned(), count, width, is_difference, channels: 1, is_float: false, text })
    }

    /// A texture of the look-up.
    ///
    /// # Errors
    /// None in practice.
    pub fn texture(texture: &Texture) -> io::Result<Block> {
        let Texture { name, channels, numbers } = texture;
        let (width, is_difference, is_float, numbers) = match numbers {
            Numbers::F32(numbers) => (4, false, true, numbers.iter().map(|number| number.to_bits()).collect()),
            Numbers::U32(numbers) => (4, true, false, numbers.clone()),
            Numbers::U16(numbers) => {
                (2, false, false, numbers.iter().map(|&number| number.into()).collect::<Vec<u32>>())
            }
        };
        Ok(Block { channels: *channels, is_float, ..Block::new(name, width, is_difference, &numbers)? })
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use flate2::write::ZlibDecoder;

    use super::*;

    /// What the page's script makes of a block.
    fn unpacked(block: &Block) -> Vec<u32> {
        let mut decoder = ZlibDecoder::new(Vec::new());
        decoder.write_all(&STANDARD.decode(&block.text).unwrap()).unwrap();
        let bytes = decoder.finish().unwrap();
        assert_eq!(bytes.len(), block.count * block.width);
        let code = |i| (0..block.width).map(|byte| u32::from(bytes[byte * block.count + i]) << (8 * byte)).sum::<u32>();
        let mut value = 0_i32;
        let mut number = |code: u32| {
            if !block.is_difference {
                return code;
            }
            value = value.wrapping_add((code >> 1) as i32 ^ -((code & 1) as i32));
            value as u32
        };
        (0..block.count).map(code).map(&mut number).collect()
    }

    #[test]
    fn numbers_come_back() {
        let numbers = [0, 7, 3, u32::MAX, 0, 1 << 31, 0x7fff_ffff, 12];
        for is_difference in [false, true] {
            assert_eq!(unpacked(&Block::new("x", 4, is_difference, &numbers).unwrap()), numbers);
        }
        assert_eq!(unpacked(&Block::new("x", 2, false, &[65_535, 256, 0]).unwrap()), [65_535, 256, 0]);
        assert_eq!(unpacked(&Block::new("x", 1, false, &[]).unwrap()), [0; 0]);
        let texture = Texture { name: "t", channels: 2, numbers: Numbers::F32(vec![0.25, -3.0e-7]) };
        let block = Block::texture(&texture).unwrap();
        let floats: Vec<f32> = unpacked(&block).into_iter().map(f32::from_bits).collect();
        assert!(block.is_float && block.channels == 2 && floats == [0.25, -3.0e-7]);
    }
}
