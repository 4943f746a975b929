//! Output in blocks: many small pieces become few large writes.

use std::io::Write;

/// Writes blocks of bytes made from items, a few thousand items at a time.
pub(super) fn write_blocks<T>(
    out: &mut dyn Write,
    items: impl IntoIterator<Item = T>,
    mut bytes_of: impl FnMut(&mut Vec<u8>, T),
) -> std::io::Result<()> {
    const BLOCK: usize = 1 << 16;
    let mut block = Vec::with_capacity(BLOCK + 256);
    for item in items {
        bytes_of(&mut block, item);
        if block.len() >= BLOCK {
            out.write_all(&block)?;
            block.clear();
        }
    }
    out.write_all(&block)
}

/// Appends text to a block.
pub(super) fn push(block: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    block.write_fmt(text).expect("a vector takes all bytes");
}
