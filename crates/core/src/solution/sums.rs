//! Sums in one canonical order: terms in the order of a list go in, a sum comes out whose bits a parallel machine can
//! reproduce, since it says which terms are added to which.
//!
//! A gather adds [`GATHER_CHUNK`] consecutive links at a time, from zero and in order, and then the sums of the chunks
//! by [`tree_sum`]. Up to one chunk, that is the plain sum.

use std::ops::Add;

/// Links of a gather that are summed one after the other: long enough for most lists, short enough to share out the
/// longest ones. In the room at an asked error of 0.1 lists have 17 links on average and 419 at most; 49 % of them are
/// longer than 8, 11 % longer than 32, 2 % longer than 128.
pub const GATHER_CHUNK: usize = 32;

/// Sum by the balanced binary tree over the indices: neighbours (0, 1), (2, 3), ... are added, then neighbours of these
/// sums, until one is left; an odd last one passes up as it is. `zero` where there is no value.
pub fn tree_sum<T: Copy + Add<Output = T>>(values: &[T], zero: T) -> T {
    match *values {
        [] => zero,
        [value] => value,
        // Level by level, the left half is the largest power of two that leaves something on the right.
        _ => {
            let (left, right) = values.split_at(values.len().next_power_of_two() / 2);
            tree_sum(left, zero) + tree_sum(right, zero)
        }
    }
}

/// Sum of the terms of a gather: chunks of [`GATHER_CHUNK`], each in order from `zero`, then their sums by
/// [`tree_sum`].
pub fn gather_sum<T: Copy + Add<Output = T>>(terms: impl IntoIterator<Item = T>, zero: T) -> T {
    let mut chunks = Vec::new();
    let (mut sum, mut count) = (zero, 0);
    for term in terms {
        if count == GATHER_CHUNK {
            chunks.push(sum);
            (sum, count) = (zero, 0);
        }
        sum = sum + term;
        count += 1;
    }
    if chunks.is_empty() {
        return sum;
    }
    chunks.push(sum);
    tree_sum(&chunks, zero)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers whose sum shows in its last bits in which order they were added.
    fn numbers(count: usize) -> Vec<f64> {
        (0..count).map(|k| 1.0 / (k as f64 + 1.0)).collect()
    }

    /// The tree as its doc says it, level by level.
    fn level_by_level(mut values: Vec<f64>) -> f64 {
        while values.len() > 1 {
            values = values.chunks(2).map(|pair| if let [one, two] = pair { one + two } else { pair[0] }).collect();
        }
        values.first().copied().unwrap_or(0.0)
    }

    /// Catches a tree of another shape: every length up to several levels, odd ones at each level among them.
    #[test]
    fn the_tree_is_built_level_by_level() {
        for count in 0..200 {
            let values = numbers(count);
            assert_eq!(tree_sum(&values, 0.0).to_bits(), level_by_level(values).to_bits(), "{count}");
        }
    }

    /// Catches chunks that begin at another place, and a short list that is not summed plainly.
    #[test]
    fn a_gather_is_summed_in_chunks() {
        for count in 0..300 {
            let values = numbers(count);
            let sum = gather_sum(values.iter().copied(), 0.0);
            let plain = |values: &[f64]| values.iter().fold(0.0, |sum, value| sum + value);
            let chunks = values.chunks(GATHER_CHUNK).map(plain).collect();
            assert_eq!(sum.to_bits(), level_by_level(chunks).to_bits(), "{count}");
            if count <= GATHER_CHUNK {
                assert_eq!(sum.to_bits(), plain(&values).to_bits(), "{count}");
            }
        }
    }
}
