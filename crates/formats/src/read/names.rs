//! Unique names: a repeated name gets `#2`, `#3`, the first keeps it as it is.

use super::error::clean;
use std::collections::{HashMap, HashSet};

/// Names given out so far.
#[derive(Default)]
pub(super) struct Names {
    taken: HashSet<String>,
    repeats: HashMap<String, usize>,
}

impl Names {
    /// `wanted` if it is free, else `wanted#2`, `wanted#3`, ...; `fallback` where `wanted` says nothing.
    pub(super) fn unique(&mut self, wanted: Option<&str>, fallback: impl FnOnce() -> String) -> String {
        let wanted = wanted.map(clean).filter(|name| !name.is_empty()).unwrap_or_else(fallback);
        if self.taken.insert(wanted.clone()) {
            return wanted;
        }
        let repeats = self.repeats.entry(wanted.clone()).or_insert(1);
        loop {
            *repeats += 1;
            let name = format!("{wanted}#{repeats}");
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Names;

    /// Catches a suffix that collides with a name which already carries one.
    #[test]
    fn repeated_names_are_numbered_past_taken_ones() {
        let mut names = Names::default();
        let given: Vec<String> =
            ["a", "a#2", "a", " a\n", ""].iter().map(|name| names.unique(Some(name), || "node 4".into())).collect();
        assert_eq!(given, ["a", "a#2", "a#3", "a#4", "node 4"]);
    }
}
