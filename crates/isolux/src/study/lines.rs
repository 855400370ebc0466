//! How long the organisations are: the lines of code that are their own.

use std::collections::BTreeMap;

/// Sources of an organisation, tests left out.
macro_rules! sources {
    ($($file:literal),*) => { [$(include_str!(concat!("../../../schedules/src/", $file))),*] };
}

/// Lines of code by organisation: what is neither blank nor comment nor test, of the files that are its own, its queues and
/// loops among them. What both kinds of tasks share is listed by itself.
#[must_use]
pub fn schedule_lines() -> BTreeMap<&'static str, usize> {
    let splash = sources!("splash/mod.rs", "splash/build.rs", "splash/visibility.rs", "splash/interpolate.rs");
    let sbpram = sources!(
        "sbpram/mod.rs",
        "sbpram/build.rs",
        "sbpram/pairs.rs",
        "sbpram/visibility.rs",
        "sbpram/interpolate.rs"
    );
    let wavefront = sources!(
        "wavefront/mod.rs",
        "wavefront/tree.rs",
        "wavefront/rounds.rs",
        "wavefront/rows.rs",
        "wavefront/gather.rs"
    );
    let shared =
        sources!("phases/mod.rs", "phases/lists.rs", "phases/refine.rs", "phases/gather.rs", "phases/vertices.rs");
    let distributed = lines(include_str!("../../../machine/src/protocols/distributed.rs"));
    let parallel = lines(include_str!("../../../machine/src/protocols/parallel_queue.rs"));
    let loops = lines(include_str!("../../../machine/src/protocols/parallel_loop.rs"));
    BTreeMap::from([
        ("splash", total(&splash) + distributed),
        ("sbpram", total(&sbpram) + parallel + loops),
        ("wavefront", total(&wavefront) + loops),
        ("shared by splash and sbpram", total(&shared)),
    ])
}

fn total(sources: &[&str]) -> usize {
    sources.iter().map(|source| lines(source)).sum()
}

fn lines(source: &str) -> usize {
    let code = source.split("#[cfg(test)]").next().unwrap_or(source);
    code.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//")).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches comments, blanks and tests that count, and code that does not.
    #[test]
    fn only_code_counts() {
        assert_eq!(lines("//! What.\n\nfn f() {\n    // Why.\n    g();\n}\n\n#[cfg(test)]\nmod tests {}\n"), 3);
        assert!(schedule_lines().values().all(|&lines| lines > 10));
    }
}
