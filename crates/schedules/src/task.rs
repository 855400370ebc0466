//! Tasks as words: what is to be done, and for whom.

use isolux_machine::{Cause, Mark};

/// Words of a task.
pub(crate) const TASK_WORDS: usize = 3;

/// A task's words: kind, number of visibilities and element; then up to four links or whatever the kind needs.
pub(crate) type Words = [u64; TASK_WORDS];

/// Most visibilities of one task.
pub(crate) const VISIBILITIES_MAX: usize = 4;

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    /// B: the polygon at this place of the order goes into the tree.
    Insert { at: u32 },
    /// B': the pieces of a list go into the tree below a node.
    Partition { node: u32, first: u32 },
    /// All F-tasks of a root, where the tree is there already.
    Factors { root: u32, at: u32 },
    /// F: form factors of two roots.
    Factor { a: u32, b: u32 },
    /// R: an element is refined and gathers.
    Refine { element: u32 },
    /// V, V': links of an element get what they lack.
    Visibility { element: u32, count: u32, links: [u32; VISIBILITIES_MAX] },
    /// A: an element's vertices get their values.
    Interpolate { element: u32 },
}

const INSERT: u64 = 1;
const PARTITION: u64 = 2;
const FACTORS: u64 = 3;
const FACTOR: u64 = 4;
const REFINE: u64 = 5;
const VISIBILITY: u64 = 6;
const INTERPOLATE: u64 = 7;

fn pair(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

fn parts(word: u64) -> [u32; 2] {
    [word as u32, (word >> 32) as u32]
}

impl Task {
    pub(crate) fn words(self) -> Words {
        let word = |kind: u64, count: u32, element: u32| kind | u64::from(count) << 8 | u64::from(element) << 32;
        match self {
            Task::Insert { at } => [word(INSERT, 0, at), 0, 0],
            Task::Partition { node, first } => [word(PARTITION, 0, node), first.into(), 0],
            Task::Factors { root, at } => [word(FACTORS, 0, root), at.into(), 0],
            Task::Factor { a, b } => [word(FACTOR, 0, a), b.into(), 0],
            Task::Refine { element } => [word(REFINE, 0, element), 0, 0],
            Task::Visibility { element, count, links: [a, b, c, d] } => {
                [word(VISIBILITY, count, element), pair(a, b), pair(c, d)]
            }
            Task::Interpolate { element } => [word(INTERPOLATE, 0, element), 0, 0],
        }
    }

    pub(crate) fn from_words(words: Words) -> Task {
        let (count, element) = ((words[0] >> 8) as u32 & 0xff, (words[0] >> 32) as u32);
        let ([a, b], [c, d]) = (parts(words[1]), parts(words[2]));
        match words[0] & 0xff {
            INSERT => Task::Insert { at: element },
            PARTITION => Task::Partition { node: element, first: a },
            FACTORS => Task::Factors { root: element, at: a },
            FACTOR => Task::Factor { a: element, b: a },
            REFINE => Task::Refine { element },
            VISIBILITY => Task::Visibility { element, count, links: [a, b, c, d] },
            _ => Task::Interpolate { element },
        }
    }

    /// What its time goes to.
    pub(crate) fn mark(self) -> Mark {
        let label = match self {
            Task::Insert { .. } | Task::Partition { .. } => "B",
            Task::Factors { .. } | Task::Factor { .. } => "F",
            Task::Refine { .. } => "R",
            Task::Visibility { .. } => "V",
            Task::Interpolate { .. } => "A",
        };
        Mark::new(Cause::Work, label)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches two fields that share bits, and a kind that is taken for another.
    #[test]
    fn tasks_come_back_from_their_words() {
        let big = u32::MAX - 1;
        for task in [
            Task::Insert { at: big },
            Task::Partition { node: big, first: big },
            Task::Factors { root: big, at: big },
            Task::Factor { a: big, b: 7 },
            Task::Refine { element: big },
            Task::Visibility { element: big, count: 4, links: [big, 1, 2, big] },
            Task::Interpolate { element: big },
        ] {
            assert_eq!(Task::from_words(task.words()), task);
        }
    }
}
