//! Two slow models of the protocol, of sets and lists: `Infinite` knows only who holds a line and who has it dirty;
//! `Finite` adds naive lists in order of use, one for each set, and the directory's memory of silently dropped lines.

use isolux_memory::{Cause, Kind, Level};
use std::collections::{BTreeMap, BTreeSet};

/// The row of the README's table that fits, for a processor whose own caches do not settle the access.
fn row(
    kind: Kind,
    c: usize,
    h: usize,
    dirty: Option<usize>,
    near: bool,
    has: bool,
    sharers: &BTreeSet<usize>,
) -> Level {
    let others: BTreeSet<usize> = sharers.iter().copied().filter(|&s| s != c).collect();
    let beyond_home = others.iter().any(|&s| s != h);
    match (kind, dirty) {
        (_, Some(o)) if o == c => Level::Neighbour,
        (_, Some(o)) => {
            if BTreeSet::from([c, h, o]).len() == 3 {
                Level::ThirdCluster
            } else {
                Level::RemoteCache
            }
        }
        (Kind::Read, None) if near => Level::Neighbour,
        (Kind::Read, None) => [Level::RemoteMemory, Level::LocalMemory][usize::from(c == h)],
        (_, None) if beyond_home && c != h => Level::ThirdCluster,
        (_, None) if !others.is_empty() && c == h => Level::RemoteCache,
        (_, None) if c != h => Level::RemoteMemory,
        (_, None) => [Level::LocalMemory, Level::Neighbour][usize::from(has || near)],
    }
}

/// Who lost what when, and all writes ever: causes by looking them up.
#[derive(Default)]
struct History {
    now: u64,
    ever: BTreeSet<(usize, u64)>,
    lost: BTreeMap<(usize, u64), u64>,
    writes: BTreeMap<u64, Vec<u64>>,
}

impl History {
    fn cause(&mut self, p: usize, line: u64, word: u64) -> Cause {
        if self.ever.insert((p, line)) {
            return Cause::Cold;
        }
        match self.lost.remove(&(p, line)) {
            None => Cause::Replacement,
            Some(when) if self.writes.get(&word).is_some_and(|w| w.iter().any(|&t| t >= when)) => Cause::TrueSharing,
            Some(_) => Cause::FalseSharing,
        }
    }
}

/// Sizes and homes that both models share.
#[derive(Clone)]
pub(crate) struct Shape {
    pub(crate) per_cluster: usize,
    pub(crate) line_bytes: u64,
    pub(crate) word_bytes: u64,
    /// Home of each page; `None` for first touch.
    pub(crate) homes: Vec<Option<usize>>,
}

/// Caches that never replace.
pub(crate) struct Infinite {
    shape: Shape,
    holders: BTreeMap<u64, BTreeSet<usize>>,
    dirty: BTreeMap<u64, usize>,
    history: History,
}

impl Infinite {
    pub(crate) fn new(shape: Shape) -> Infinite {
        Infinite { shape, holders: BTreeMap::new(), dirty: BTreeMap::new(), history: History::default() }
    }

    pub(crate) fn access(&mut self, p: usize, address: u64, kind: Kind) -> (Level, Option<Cause>) {
        let (line, word) = (address / self.shape.line_bytes, address / self.shape.word_bytes);
        let cluster = |p: usize| p / self.shape.per_cluster;
        self.history.now += 1;
        let page = (address / 4096) as usize;
        let holders = self.holders.entry(line).or_default();
        let owner = self.dirty.get(&line).copied();
        let has = holders.contains(&p);
        let answer = if has && (kind == Kind::Read || owner == Some(p)) {
            (Level::First, None)
        } else {
            let home = *self.shape.homes[page].get_or_insert(cluster(p));
            let sharers = holders.iter().map(|&q| cluster(q)).collect();
            let near = holders.iter().any(|&q| q != p && cluster(q) == cluster(p));
            let level = row(kind, cluster(p), home, owner.map(cluster), near, has, &sharers);
            (level, (!has).then(|| self.history.cause(p, line, word)))
        };
        if kind == Kind::Read {
            if owner != Some(p) {
                self.dirty.remove(&line);
            }
        } else {
            for &q in holders.iter().filter(|&&q| q != p) {
                self.history.lost.insert((q, line), self.history.now);
            }
            holders.clear();
            self.dirty.insert(line, p);
            self.history.writes.entry(word).or_default().push(self.history.now);
        }
        holders.insert(p);
        answer
    }

    pub(crate) fn holders(&self, line: u64) -> BTreeSet<usize> {
        self.holders.get(&line).cloned().unwrap_or_default()
    }

    pub(crate) fn dirty(&self, line: u64) -> Option<usize> {
        self.dirty.get(&line).copied()
    }
}

/// One level of one processor: for each set, its lines from the least to the most recently used.
#[derive(Clone)]
struct Lists {
    ways: usize,
    sets: Vec<Vec<u64>>,
}

impl Lists {
    fn new((bytes, ways): (u64, u64), line_bytes: u64) -> Lists {
        Lists { ways: ways as usize, sets: vec![Vec::new(); (bytes / line_bytes / ways) as usize] }
    }

    fn set(&mut self, line: u64) -> &mut Vec<u64> {
        let sets = self.sets.len() as u64;
        &mut self.sets[(line % sets) as usize]
    }

    fn has(&mut self, line: u64) -> bool {
        self.set(line).contains(&line)
    }

    fn drop(&mut self, line: u64) {
        self.set(line).retain(|&other| other != line);
    }

    /// Makes the line the most recent; what had to leave.
    fn touch(&mut self, line: u64) -> Option<u64> {
        let ways = self.ways;
        self.drop(line);
        let set = self.set(line);
        set.push(line);
        (set.len() > ways).then(|| set.remove(0))
    }
}

/// Caches of one or two levels (bytes and ways of each) that replace.
pub(crate) struct Finite {
    shape: Shape,
    first: Vec<Lists>,
    second: Option<Vec<Lists>>,
    sharers: BTreeMap<u64, BTreeSet<usize>>,
    dirty: BTreeMap<u64, usize>,
    history: History,
    pub(crate) writebacks: u64,
    pub(crate) invalidations: u64,
}

impl Finite {
    pub(crate) fn new(shape: Shape, processors: usize, first: (u64, u64), second: Option<(u64, u64)>) -> Finite {
        let lists = |size| vec![Lists::new(size, shape.line_bytes); processors];
        Finite {
            first: lists(first),
            second: second.map(lists),
            shape,
            sharers: BTreeMap::new(),
            dirty: BTreeMap::new(),
            history: History::default(),
            writebacks: 0,
            invalidations: 0,
        }
    }

    fn last(&mut self, p: usize) -> &mut Lists {
        match &mut self.second {
            Some(second) => &mut second[p],
            None => &mut self.first[p],
        }
    }

    pub(crate) fn access(&mut self, p: usize, address: u64, kind: Kind) -> (Level, Option<Cause>) {
        let (line, word) = (address / self.shape.line_bytes, address / self.shape.word_bytes);
        let per_cluster = self.shape.per_cluster;
        let cluster = |p: usize| p / per_cluster;
        let processors = self.first.len();
        self.history.now += 1;
        let page = (address / 4096) as usize;
        let owner = self.dirty.get(&line).copied();
        let in_first = self.first[p].has(line);
        let has = self.last(p).has(line);
        let settled = has && (kind == Kind::Read || owner == Some(p));
        let answer = if settled {
            (if in_first { Level::First } else { Level::Second }, None)
        } else {
            let home = *self.shape.homes[page].get_or_insert(cluster(p));
            let near = (0..processors).any(|q| q != p && cluster(q) == cluster(p) && self.last(q).has(line));
            let sharers = self.sharers.get(&line).cloned().unwrap_or_default();
            let level = row(kind, cluster(p), home, owner.map(cluster), near, has, &sharers);
            if kind == Kind::Read {
                // A line that a neighbour has is known to be in this cluster.
                self.sharers.entry(line).or_default().insert(cluster(p));
                self.writebacks += u64::from(self.dirty.remove(&line).is_some());
            } else {
                for q in (0..processors).filter(|&q| q != p) {
                    if self.last(q).has(line) {
                        self.last(q).drop(line);
                        self.first[q].drop(line);
                        self.history.lost.insert((q, line), self.history.now);
                        self.invalidations += 1;
                    }
                }
                self.sharers.insert(line, BTreeSet::from([cluster(p)]));
                self.dirty.insert(line, p);
            }
            (level, (!has).then(|| self.history.cause(p, line, word)))
        };
        if kind != Kind::Read {
            self.history.writes.entry(word).or_default().push(self.history.now);
        }
        // The last level hears of what the first does not settle alone.
        if (!(in_first && settled) || self.second.is_none())
            && let Some(left) = self.last(p).touch(line)
        {
            self.first[p].drop(left);
            if self.dirty.get(&left) == Some(&p) {
                self.dirty.remove(&left);
                self.sharers.remove(&left);
                self.writebacks += 1;
            }
        }
        if self.second.is_some() {
            self.first[p].touch(line);
        }
        answer
    }

    pub(crate) fn has(&mut self, p: usize, line: u64) -> bool {
        self.last(p).has(line)
    }

    pub(crate) fn dirty(&self, line: u64) -> Option<usize> {
        self.dirty.get(&line).copied()
    }

    /// The directory's sharing clusters.
    pub(crate) fn sharers(&self, line: u64) -> BTreeSet<usize> {
        self.sharers.get(&line).cloned().unwrap_or_default()
    }
}
