//! Decompression of zstd, for the chunks of an MCAP recording.

use std::io::{Cursor, Read};

use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{McapError, McapResult};
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

/// Decompressor of zstd that takes all compressed bytes of a chunk at once.
#[derive(Default)]
pub(super) struct ZstdDecompressor {
    chunk: Cursor<Vec<u8>>,
    decoder: FrameDecoder,
    is_in_frame: bool,
}

impl ZstdDecompressor {
    /// Begins the next frame with content. Returns false at the end of the chunk.
    fn begin_frame(&mut self) -> McapResult<bool> {
        while self.chunk.position() < self.chunk.get_ref().len() as u64 {
            match self.decoder.init(&mut self.chunk) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                    length,
                    ..
                })) => self.chunk.set_position(self.chunk.position() + u64::from(length)),
                Err(error) => return Err(decompression_error(error)),
            }
        }
        Ok(false)
    }

    /// Writes the next bytes to `output` and returns their number, 0 at the end of the chunk.
    fn read(&mut self, output: &mut [u8]) -> McapResult<usize> {
        loop {
            if !self.is_in_frame {
                self.is_in_frame = self.begin_frame()?;
                if !self.is_in_frame {
                    return Ok(0);
                }
            }
            // One block at a time bounds the memory: a few bytes can stand for many blocks.
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                let block = self.decoder.decode_blocks(&mut self.chunk, BlockDecodingStrategy::UptoBlocks(1));
                block.map_err(decompression_error)?;
            }
            match self.decoder.read(output).map_err(decompression_error)? {
                0 => self.is_in_frame = false,
                count => return Ok(count),
            }
        }
    }
}

impl Decompressor for ZstdDecompressor {
    fn next_read_size(&self) -> usize {
        // The reader reduces it to what is left of the chunk.
        if self.chunk.get_ref().is_empty() { usize::MAX } else { 0 }
    }

    fn decompress(&mut self, compressed: &[u8], output: &mut [u8]) -> McapResult<DecompressResult> {
        if !compressed.is_empty() {
            (self.chunk, self.is_in_frame) = (Cursor::new(compressed.to_vec()), false);
        }
        Ok(DecompressResult { consumed: compressed.len(), wrote: self.read(output)? })
    }

    fn reset(&mut self) -> McapResult<()> {
        (self.chunk, self.is_in_frame) = (Cursor::default(), false);
        Ok(())
    }

    fn name(&self) -> &'static str {
        "zstd"
    }
}

/// Returns the error for bytes that are not zstd.
fn decompression_error(error: impl ToString) -> McapError {
    McapError::DecompressionError(error.to_string())
}

#[cfg(test)]
mod tests {
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

    use super::*;

    /// Decompresses a chunk in outputs of `step` bytes.
    fn decompressed(chunk: &[u8], step: usize) -> McapResult<Vec<u8>> {
        let (mut decompressor, mut compressed) = (ZstdDecompressor::default(), chunk);
        let (mut found, mut output) = (Vec::new(), vec![0; step]);
        loop {
            let DecompressResult { consumed, wrote } = decompressor.decompress(compressed, &mut output)?;
            compressed = &compressed[consumed..];
            if wrote == 0 {
                return Ok(found);
            }
            found.extend_from_slice(&output[..wrote]);
        }
    }

    /// Returns bytes of which half are noise.
    fn bytes(count: u32) -> Vec<u8> {
        (0..count).map(|k| if k % 2 == 0 { (k.wrapping_mul(2_654_435_761) >> 24) as u8 } else { 7 }).collect()
    }

    #[test]
    fn frames_are_decompressed_one_after_the_other() {
        let parts = [bytes(300_000), Vec::new(), bytes(10)];
        // RFC 8878, section 3.1.2: magic number, length, content.
        let skipped = [&0x184D_2A50_u32.to_le_bytes()[..], &3_u32.to_le_bytes(), b"abc"].concat();
        let mut chunk = skipped.clone();
        for part in &parts {
            chunk.extend(compress_to_vec(&part[..], CompressionLevel::Fastest));
            chunk.extend_from_slice(&skipped);
        }
        for step in [1, 1000, 1 << 20] {
            assert_eq!(decompressed(&chunk, step).expect("zstd"), parts.concat());
        }
    }

    #[test]
    fn damaged_frames_are_errors() {
        let chunk = compress_to_vec(&bytes(300_000)[..], CompressionLevel::Fastest);
        for length in [1, 3, 10, chunk.len() / 2, chunk.len() - 1] {
            assert!(decompressed(&chunk[..length], 1000).is_err(), "{length} bytes");
        }
        assert!(decompressed(b"LZ4 or text", 1000).is_err());
    }

    /// RFC 8878, section 3.1.1.2: a block of one repeated byte is four bytes long and stands for up to 128 KiB.
    #[test]
    fn a_small_chunk_that_stands_for_gibibytes_needs_little_memory() {
        let frame = [0xFD2F_B528_u32.to_le_bytes().to_vec(), vec![0x00, 0x58]].concat(); // Window of 2 MiB.
        let block = ((128_u32 << 10) << 3 | 1 << 1).to_le_bytes();
        let mut chunk = frame;
        for _ in 0..16_384 {
            chunk.extend_from_slice(&block[..3]);
            chunk.push(9);
        }
        let used = allocation_counter::measure(|| {
            let mut decompressor = ZstdDecompressor::default();
            let result = decompressor.decompress(&chunk, &mut [0; 1000]).expect("zstd");
            assert_eq!((result.consumed, result.wrote), (chunk.len(), 1000));
        });
        assert!(used.bytes_max < 20 << 20, "{} bytes", used.bytes_max);
    }
}
