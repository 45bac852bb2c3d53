//! DirectDraw surfaces with the header of Direct3D 10: arrays of textures of floating-point texels.

/// Texels of a DDS file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texels {
    /// Four halves, `DXGI_FORMAT_R16G16B16A16_FLOAT`.
    Rgba16,
    /// Two floats, `DXGI_FORMAT_R32G32_FLOAT`.
    Rg32,
}

impl Texels {
    pub fn channels(self) -> usize {
        match self {
            Texels::Rgba16 => 4,
            Texels::Rg32 => 2,
        }
    }

    fn format(self) -> u32 {
        match self {
            Texels::Rgba16 => 10,
            Texels::Rg32 => 16,
        }
    }
}

/// Bytes of magic, header and its extension.
const HEAD: usize = 4 + 124 + 20;

/// The words before the texels.
fn head(width: u32, height: u32, layers: u32, texels: Texels) -> Vec<u8> {
    // Caps, height, width, pitch and pixel format are given.
    const FLAGS: u32 = 0x1 | 0x2 | 0x4 | 0x8 | 0x1000;
    const FOUR_CC: u32 = 0x4;
    const TEXTURE: u32 = 0x1000;
    const TEXTURE_2D: u32 = 3;
    // Both formats have eight bytes a texel.
    let mut words = vec![u32::from_le_bytes(*b"DDS "), 124, FLAGS, height, width, 8 * width, 0, 1];
    words.extend([0; 11]);
    words.extend([32, FOUR_CC, u32::from_le_bytes(*b"DX10"), 0, 0, 0, 0, 0]);
    words.extend([TEXTURE, 0, 0, 0, 0]);
    words.extend([texels.format(), TEXTURE_2D, 0, layers, 0]);
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Layers of width × height texels, x fastest, then y.
pub fn write(width: u32, height: u32, layers: u32, texels: Texels, numbers: &[f32]) -> Vec<u8> {
    let mut out = head(width, height, layers, texels);
    match texels {
        Texels::Rgba16 => out.extend(numbers.iter().flat_map(|n| half::f16::from_f32(*n).to_le_bytes())),
        Texels::Rg32 => out.extend(numbers.iter().flat_map(|n| n.to_le_bytes())),
    }
    out
}

/// The numbers of a file of [`write`].
///
/// # Errors
/// It is of another size or format.
pub fn read(width: u32, height: u32, layers: u32, texels: Texels, bytes: &[u8]) -> Result<Vec<f32>, String> {
    let count = u64::from(width) * u64::from(height) * u64::from(layers);
    let is_size = bytes.len() as u64 == HEAD as u64 + 8 * count;
    if !is_size || bytes[..HEAD] != head(width, height, layers, texels) {
        return Err(format!("it is no DDS file of {layers} layers of {width}×{height} texels, {texels:?}"));
    }
    let data = &bytes[HEAD..];
    Ok(match texels {
        Texels::Rgba16 => data.as_chunks::<2>().0.iter().map(|b| half::f16::from_le_bytes(*b).to_f32()).collect(),
        Texels::Rg32 => data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
    })
}
