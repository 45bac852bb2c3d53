//! An opened OpenEXR file and its blocks of pixels, in order.
//!
//! A header may claim any size. The memory that it makes the decoder allocate is therefore bounded by the size of the
//! file or of the block. Blocks are decompressed on rayon's threads: on the decoder's own threads a damaged block would
//! end a thread instead of returning an error.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::reader::Reader;
use exr::error::{Error as ExrError, Result as ExrResult};
use exr::meta::header::Header;
use exr::prelude::Compression;
use rayon::prelude::*;

use super::error::ImageError;
use super::exr_window::Window;
use crate::system::input::open_file;

const FORMAT: &str = "OpenEXR";

/// First bytes of a file.
pub(super) const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Largest expansion of a compressed byte. Deflate reaches 1032 (RFC 1951: 258 bytes in 2 bits); it is doubled for
/// headroom. The Huffman runs of PIZ (512 bytes in 10 bits) and the other compressions stay below.
const MAX_EXPANSION: u64 = 2 * 1032;

/// Largest expansion of DWA. Before it deflates, DWA stores a flat block of 8 × 8 samples as one number: a factor of
/// 64.
const MAX_EXPANSION_DWA: u64 = 64 * MAX_EXPANSION;

/// Decoded pictures up to this size are accepted from a file of any size: 4096 × 2048 black pixels take about a
/// thousand bytes in DWA.
const HARMLESS_BYTES: u64 = 64 << 20;

/// Least bytes of a block: its entry in the table of offsets (8), its coordinate (4) and its length (4).
const MIN_BLOCK_BYTES: u64 = 16;

/// Most pixels of a picture: 32768 × 16384, an environment map with twice the resolution of the finest in circulation.
const MAX_PIXELS: u64 = 1 << 29;

/// Number of counters at the start of a DWA block, 64 bits each (OpenEXR, `internal_dwa_compressor.h`). The first is a
/// version and the last the kind of compression; the others are sizes.
const DWA_COUNTERS: usize = 11;

/// Side of DWA's squares of samples. Pictures are padded to a multiple of it.
const DWA_BLOCK: usize = 8;

/// A file whose headers have been read and checked against the file's size.
pub(super) struct ExrFile<'a, R> {
    path: &'a Path,
    reader: Reader<R>,
}

impl<'a> ExrFile<'a, BufReader<File>> {
    /// Opens a file of the disk. See [`ExrFile::new`].
    pub(super) fn open(path: &'a Path) -> Result<Self, ImageError> {
        let open_error = |cause| ImageError::Open { path: path.to_owned(), cause };
        let file = open_file(path).map_err(open_error)?;
        let file_bytes = file.metadata().map_err(open_error)?.len();
        ExrFile::new(path, BufReader::new(file), file_bytes)
    }
}

impl<'a, R: Read + Seek> ExrFile<'a, R> {
    /// Reads the headers of a file of `file_bytes`. Refuses those that claim more than a file of this size can hold.
    pub(super) fn new(path: &'a Path, content: R, file_bytes: u64) -> Result<Self, ImageError> {
        // `false` accepts headers that break minor rules, because files in use do. Data is still read strictly.
        let reader = exr::block::read(content, false).map_err(|error| exr_error(path, error))?;
        for header in reader.headers() {
            if !is_plausible(header, file_bytes) {
                let (width, height) = largest(header);
                return Err(ImageError::ImplausibleSize { path: path.to_owned(), width, height, file_bytes });
            }
        }
        Ok(ExrFile { path, reader })
    }

    pub(super) fn headers(&self) -> &[Header] {
        self.reader.headers()
    }

    /// Calls `take` with each decompressed block of one part, at full resolution.
    pub(super) fn for_each_block(
        self,
        part: usize,
        mut take: impl FnMut(&UncompressedBlock),
    ) -> Result<(), ImageError> {
        let path = self.path;
        let meta = self.reader.meta_data().clone();
        let header = &meta.headers[part];
        let decode_all = || {
            let is_wanted = |block_part: usize, is_full_size: bool| block_part == part && is_full_size;
            let chunks = self
                .reader
                .filter_chunks(true, |_, tile, block| is_wanted(block.layer, tile.is_largest_resolution_level()))?;
            let mut chunks = chunks.into_iter();
            // One block per thread at a time bounds the memory.
            loop {
                let batch: Vec<Chunk> = chunks.by_ref().take(rayon::current_num_threads()).collect::<ExrResult<_>>()?;
                if batch.is_empty() {
                    return Ok(());
                }
                for chunk in &batch {
                    // A table of offsets may point to another part's block.
                    if chunk.layer_index != part {
                        return Err(ExrError::Invalid("a block belongs to another part".into()));
                    }
                    check_block(header, &chunk.compressed_block)?;
                }
                let decompress = |chunk| UncompressedBlock::decompress_chunk(chunk, &meta, true);
                let blocks: Vec<UncompressedBlock> = batch.into_par_iter().map(decompress).collect::<ExrResult<_>>()?;
                blocks.iter().for_each(&mut take);
            }
        };
        decode_all().map_err(|error| exr_error(path, error))
    }
}

fn is_plausible(header: &Header, file_bytes: u64) -> bool {
    let (width, height) = largest(header);
    let pixels = (width as u64).saturating_mul(height as u64);
    let bytes = pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
    let expansion = if is_dwa(header) { MAX_EXPANSION_DWA } else { MAX_EXPANSION };
    pixels <= MAX_PIXELS
        && bytes <= file_bytes.saturating_mul(expansion).max(HARMLESS_BYTES)
        && (header.chunk_count as u64).saturating_mul(MIN_BLOCK_BYTES) <= file_bytes
}

/// Width and height of the larger of the pixels that are stored and the picture that they are put into.
fn largest(header: &Header) -> (usize, usize) {
    let [stored, shown] = [header.layer_size, Window::of(header).size].map(|size| (size.width(), size.height()));
    let area = |(width, height): (usize, usize)| width.saturating_mul(height);
    if area(stored) >= area(shown) { stored } else { shown }
}

fn is_dwa(header: &Header) -> bool {
    matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_))
}

/// Refuses a DWA block whose counters claim more data than its pixels can have. The decoder would allocate that much.
fn check_block(header: &Header, block: &CompressedBlock) -> ExrResult<()> {
    let bytes = match block {
        CompressedBlock::ScanLine(lines) => &lines.compressed_pixels_le,
        CompressedBlock::Tile(tile) => &tile.compressed_pixels_le,
        _ => return Ok(()),
    };
    if !is_dwa(header) {
        return Ok(());
    }
    let size = header.get_absolute_block_pixel_coordinates(header.get_block_data_indices(block)?)?.size;
    // A block that compression did not shrink is stored uncompressed and has no counters.
    if bytes.len() == size.area() * header.channels.bytes_per_pixel {
        return Ok(());
    }
    let padded = size.width().next_multiple_of(DWA_BLOCK) * size.height().next_multiple_of(DWA_BLOCK);
    // Doubled, because data without repetition grows a little when it is encoded.
    let limit = 2 * padded as u64 * header.channels.bytes_per_pixel as u64;
    let (counters, _) = bytes.as_chunks::<8>();
    let sizes = counters.iter().take(DWA_COUNTERS - 1).skip(1).map(|counter| u64::from_le_bytes(*counter));
    match sizes.max() {
        Some(largest) if largest > limit => {
            Err(ExrError::Invalid("a block claims more data than it has pixels".into()))
        }
        _ => Ok(()),
    }
}

fn exr_error(path: &Path, error: ExrError) -> ImageError {
    let path = path.to_owned();
    match error {
        ExrError::Io(cause) => ImageError::Open { path, cause },
        ExrError::NotSupported(reason) => ImageError::Unsupported { path, format: FORMAT, reason: reason.into_owned() },
        ExrError::Invalid(reason) => ImageError::Damaged { path, format: FORMAT, reason: reason.into_owned() },
        ExrError::Aborted => ImageError::Damaged { path, format: FORMAT, reason: "reading was aborted".to_owned() },
    }
}
