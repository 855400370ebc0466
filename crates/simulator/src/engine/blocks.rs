//! Blocks of words on their way: those to be stored, from issue to effect, and those loaded, from effect to resumption.
//! So an operation stays small whatever it carries.

use isolux_machine::BLOCK_WORDS;

/// The blocks, by number; a number is used again once its block is taken.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    blocks: Vec<[u64; BLOCK_WORDS]>,
    unused: Vec<u32>,
}

impl Blocks {
    /// Keeps at most [`BLOCK_WORDS`] words.
    pub(super) fn keep(&mut self, words: &[u64]) -> u32 {
        let number = self.unused.pop().unwrap_or_else(|| {
            self.blocks.push([0; BLOCK_WORDS]);
            self.blocks.len() as u32 - 1
        });
        self.blocks[number as usize][..words.len()].copy_from_slice(words);
        number
    }

    /// Gives a block back; what lies beyond its words means nothing.
    pub(super) fn take(&mut self, number: u32) -> [u64; BLOCK_WORDS] {
        self.unused.push(number);
        self.blocks[number as usize]
    }

    pub(super) fn clear(&mut self) {
        self.blocks.clear();
        self.unused.clear();
    }
}
