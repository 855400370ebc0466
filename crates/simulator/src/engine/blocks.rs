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
    /// A block to be filled.
    pub(super) fn unused(&mut self) -> (u32, &mut [u64; BLOCK_WORDS]) {
        let number = self.unused.pop().unwrap_or_else(|| {
            self.blocks.push([0; BLOCK_WORDS]);
            self.blocks.len() as u32 - 1
        });
        (number, &mut self.blocks[number as usize])
    }

    /// Keeps at most [`BLOCK_WORDS`] words.
    pub(super) fn keep<const N: usize>(&mut self, words: &[u64; N]) -> u32 {
        let (number, block) = self.unused();
        block[..N].copy_from_slice(words);
        number
    }

    /// Gives a block back, and its first words; what lies beyond those that were kept means nothing.
    pub(super) fn take<const N: usize>(&mut self, number: u32) -> [u64; N] {
        self.unused.push(number);
        let block = &self.blocks[number as usize];
        std::array::from_fn(|i| block[i])
    }

    pub(super) fn clear(&mut self) {
        self.blocks.clear();
        self.unused.clear();
    }
}
