//! The figures of a machine: a spec file goes in, checked figures come out, or one error that names the file and the
//! key.

use std::collections::BTreeMap;
use std::path::Path;

use isolux_machine::ClassError;
use isolux_memory::{DASH, Latency, Level, Section, TWO_SOCKET};
use thiserror::Error;

/// The most that one operation may cost. A million units is an operating system's time slice; whoever writes more has
/// mistaken the unit.
const COST_MAX: i64 = 1_000_000;
/// The most processors that a file may allow: what the numbers in the event queue hold, with room to spare.
const PROCESSORS_MAX: i64 = 1 << 20;
/// Bytes of a machine's word; a line of a cache has at least one.
const WORD_BYTES: u64 = 8;

const IDEAL: &str = include_str!("ideal/spec.toml");
const SB_PRAM: &str = include_str!("sb_pram/spec.toml");

/// Why a machine cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SpecError {
    /// Its spec file is wrong.
    #[error(transparent)]
    Figures(#[from] isolux_memory::SpecError),
    /// No built-in machine is called so.
    #[error("there is no machine {name:?}; there are {}", MachineSpec::NAMES.join(", "))]
    NoSuchMachine {
        /// What was asked for.
        name: String,
    },
    /// A number of processors or classes of work that the machine cannot have.
    #[error("{file}: {source}")]
    Machine {
        /// Which file the machine's figures come from.
        file: String,
        /// What is wrong.
        source: ClassError,
    },
    /// A simulator of one kind of memory, and figures of another.
    #[error("{file}: {}", if *caches { "the machine has caches" } else { "the machine has no caches" })]
    Memory {
        /// Which file the machine's figures come from.
        file: String,
        /// Whether they are those of a machine with caches.
        caches: bool,
    },
}

/// A machine's figures, with uniform access to memory or with caches. Immutable, but for the figures of work, which are
/// added.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineSpec {
    pub(crate) file: String,
    name: String,
    processors_max: usize,
    caches: Option<isolux_memory::Spec>,
    pub(crate) load: u64,
    pub(crate) store: u64,
    pub(crate) prefix: u64,
    pub(crate) spin: u64,
    pub(crate) scan: u64,
    pub(crate) take: u64,
    pub(crate) give: u64,
    barrier_base: u64,
    barrier_per_processor: u64,
    barrier_per_level: u64,
    /// Thousandths of a unit by class, and the file that says so.
    work: BTreeMap<String, u64>,
}

fn cost(section: &mut Section<'_>, key: &str, least: i64) -> Result<u64, isolux_memory::SpecError> {
    Ok(section.integer(key, least, COST_MAX)?.unsigned_abs())
}

fn work(section: Section<'_>) -> Result<BTreeMap<String, u64>, isolux_memory::SpecError> {
    Ok(section.decimals(COST_MAX as u32)?.into_iter().collect())
}

impl MachineSpec {
    /// The machines that come along, by name.
    pub const NAMES: [&str; 4] = ["ideal", "sb-pram", "dash", "two-socket"];

    /// A machine that comes along.
    ///
    /// # Errors
    ///
    /// Names those that there are.
    pub fn named(name: &str) -> Result<Self, SpecError> {
        let (file, text) = match name {
            "ideal" => ("ideal/spec.toml", IDEAL),
            "sb-pram" => ("sb_pram/spec.toml", SB_PRAM),
            "dash" => ("dash.toml", DASH),
            "two-socket" => ("two-socket.toml", TWO_SOCKET),
            _ => return Err(SpecError::NoSuchMachine { name: name.to_owned() }),
        };
        Self::from_toml(text, file)
    }

    /// Figures from a file. One with caches has the tables `first_level` and `latency`, one with uniform access the
    /// table `operation`.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn open(file: &Path) -> Result<Self, SpecError> {
        let (name, text) = isolux_memory::read(file)?;
        Self::from_toml(&text, &name)
    }

    /// Figures from a text; errors name `file`.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, SpecError> {
        let mut top = Section::parse(file, text)?;
        let caches = ["latency", "first_level", "second_level", "clusters"].iter().any(|key| top.has(key));
        let caches = if caches { Some(isolux_memory::Spec::take(&mut top)?) } else { None };
        let (name, processors_max, costs) = match &caches {
            Some(memory) if memory.line_bytes() < WORD_BYTES => {
                let reason = format!("a line has at least one word of {WORD_BYTES} bytes");
                return Err(top.absurd("line_bytes", memory.line_bytes(), reason).into());
            }
            Some(memory) => {
                let hit = u64::from(Latency::clocks(&memory.latency(), Level::First));
                (memory.name().to_owned(), memory.processors(), [hit; 3])
            }
            None => {
                let name = top.text("name")?;
                let processors_max = top.integer("processors_max", 1, PROCESSORS_MAX)? as usize;
                let mut operation = top.required("operation")?;
                let costs = ["load", "store", "prefix"].map(|key| cost(&mut operation, key, 1));
                let [load, store, prefix] = costs;
                let costs = [load?, store?, prefix?];
                operation.done()?;
                (name, processors_max, costs)
            }
        };
        let [load, store, prefix] = costs;
        let mut wait = top.required("wait")?;
        let (spin, scan) = (cost(&mut wait, "spin", 1)?, cost(&mut wait, "scan", 1)?);
        wait.done()?;
        let mut lock = top.required("lock")?;
        let (take, give) = (cost(&mut lock, "take", 1)?, cost(&mut lock, "give", 1)?);
        lock.done()?;
        let mut barrier = top.required("barrier")?;
        let barrier_base = cost(&mut barrier, "base", 1)?;
        let barrier_per_processor = cost(&mut barrier, "per_processor", 0)?;
        let barrier_per_level = cost(&mut barrier, "per_level", 0)?;
        barrier.done()?;
        let work = work(top.required("work")?)?;
        top.done()?;
        Ok(Self {
            file: file.to_owned(),
            name,
            processors_max,
            caches,
            load,
            store,
            prefix,
            spin,
            scan,
            take,
            give,
            barrier_base,
            barrier_per_processor,
            barrier_per_level,
            work,
        })
    }

    /// Adds a program's figures of work, of a text that has nothing but a table `work`. Figures of the same name are
    /// replaced.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn add_work(&mut self, text: &str, file: &str) -> Result<(), SpecError> {
        let mut top = Section::parse(file, text)?;
        let figures = work(top.required("work")?)?;
        top.done()?;
        self.work.extend(figures);
        Ok(())
    }

    /// As [`MachineSpec::add_work`], but figures that are there stay.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn default_work(&mut self, text: &str, file: &str) -> Result<(), SpecError> {
        let own = std::mem::take(&mut self.work);
        let added = self.add_work(text, file);
        self.work.extend(own);
        added
    }

    /// [`MachineSpec::add_work`] with a file's text.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn open_work(&mut self, file: &Path) -> Result<(), SpecError> {
        let (name, text) = isolux_memory::read(file)?;
        self.add_work(&text, &name)
    }

    /// The machine's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The most processors that it can have.
    pub fn processors_max(&self) -> usize {
        self.processors_max
    }

    /// The figures of its memory, if it has caches: then it is simulated by [`crate::CacheSimulator`], else by
    /// [`crate::Simulator`].
    pub fn caches(&self) -> Option<&isolux_memory::Spec> {
        self.caches.as_ref()
    }

    /// What a barrier costs each of so many processors once all are there: base + processors x `per_processor` + levels
    /// x `per_level`, where levels is the logarithm to base 2, rounded up.
    pub fn barrier(&self, processors: usize) -> u64 {
        let levels = u64::from(processors.max(1).next_power_of_two().trailing_zeros());
        self.barrier_base + self.barrier_per_processor * processors as u64 + self.barrier_per_level * levels
    }

    /// Thousandths of a unit for one of a class of work.
    pub(crate) fn work(&self, class: &str) -> Result<u64, SpecError> {
        let missing =
            || isolux_memory::SpecError::Missing { file: self.file.clone(), key: format!("work.{class}") }.into();
        self.work.get(class).copied().ok_or_else(missing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> MachineSpec {
        MachineSpec::named(name).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Catches built-in figures that cannot be opened, and the paper's that are not the paper's.
    #[test]
    fn built_in_figures_are_those_of_the_sources() {
        for name in MachineSpec::NAMES {
            assert_eq!(named(name).name(), name);
        }
        let ideal = named("ideal");
        assert_eq!((ideal.load, ideal.store, ideal.prefix, ideal.barrier(1000)), (1, 1, 1, 1));
        let sb_pram = named("sb-pram");
        assert_eq!((sb_pram.load, sb_pram.store, sb_pram.prefix), (1, 1, 2));
        assert_eq!((sb_pram.barrier(2), sb_pram.caches()), (sb_pram.barrier(16_384), None));
        let dash = named("dash");
        assert_eq!((dash.load, dash.store, dash.prefix, dash.barrier(64)), (1, 1, 1, 8 + 64 * 135));
        assert_eq!(dash.caches(), Some(&isolux_memory::Spec::dash().expect("comes along")));
        assert_eq!(named("two-socket").load, 4);
        let most = MachineSpec::NAMES.map(|name| named(name).processors_max());
        assert_eq!(most, [16_384, 16_384, 64, 56]);
        assert_eq!(
            MachineSpec::named("cray").expect_err("did not come along").to_string(),
            "there is no machine \"cray\"; there are ideal, sb-pram, dash, two-socket"
        );
    }

    /// Catches a missing, absurd or misspelt figure that goes unnoticed, and an error that names the wrong place.
    #[test]
    fn errors_name_file_and_key() {
        let told = |text: &str, from: &str, to: &str| {
            assert!(text.contains(from), "the test is out of date: {from}");
            let error = MachineSpec::from_toml(&text.replace(from, to), "my.toml").expect_err("is wrong").to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
            error.strip_prefix("my.toml: ").expect("names the file").to_owned()
        };
        for (from, to, expected) in [
            ("prefix = 2", "# prefix", "operation.prefix is missing"),
            ("prefix = 2", "prefix = 0", "operation.prefix = 0: must lie in 1 to 1000000"),
            ("load = 1", "load = 1.5", "operation.load must be an integer, not float"),
            ("load = 1", "load = 1\nlaod = 1", "operation.laod is not a figure of a machine"),
            ("per_level = 0", "per_levle = 0", "barrier.per_level is missing"),
            ("[lock]", "[locks]", "lock is missing"),
            ("[lock]", "[locks]\n[lock]", "locks is not a figure of a machine"),
            ("processors_max = 16384", "processors_max = 0", "processors_max = 0: must lie in 1 to 1048576"),
            ("[work]", "[work]\nray = -1", "work.ray = -1: must lie in 0 to 1000000, with at most three decimals"),
            (
                "[work]",
                "[work]\nray = 0.1234",
                "work.ray = 0.1234: must lie in 0 to 1000000, with at most three decimals",
            ),
            ("[work]", "[work]\nray = 'much'", "work.ray must be a number, not string"),
            // A uniform machine has no caches, and one with caches has all of them.
            ("[lock]", "[latency]\n[lock]", "clock_mhz is missing"),
        ] {
            assert_eq!(told(SB_PRAM, from, to), expected);
        }
        for (from, to, expected) in [
            ("neighbour = 30", "neighbour = 0", "latency.neighbour = 0: must lie in 1 to 1000000"),
            ("[latency]", "[latencies]", "latency is missing"),
            ("spin = 3", "spin = 0", "wait.spin = 0: must lie in 1 to 1000000"),
            ("[wait]", "[operation]\nload = 1\n[wait]", "operation is not a figure of a machine"),
            ("line_bytes = 16", "line_bytes = 4", "line_bytes = 4: a line has at least one word of 8 bytes"),
        ] {
            assert_eq!(told(DASH, from, to), expected);
        }
        assert!(told(SB_PRAM, "[work]", "[work").starts_with("line "));
        let missing = MachineSpec::open(Path::new("no/such/file.toml")).expect_err("is not there").to_string();
        assert!(missing.starts_with("no/such/file.toml: cannot be read: "), "{missing}");
    }

    /// Catches figures of work that are rounded, or lost when a program brings its own.
    #[test]
    fn work_is_added_exactly() {
        let mut spec = named("ideal");
        assert_eq!(spec.work("ray").expect_err("not yet").to_string(), "ideal/spec.toml: work.ray is missing");
        spec.add_work("[work]\nray = 10.1\nbox = 3", "work.toml").expect("sound");
        spec.add_work("[work]\nbox = 4.005", "work.toml").expect("sound");
        assert_eq!((spec.work("ray"), spec.work("box")), (Ok(10_100), Ok(4_005)));
        let error = spec.add_work("[lock]\ntake = 1", "work.toml").expect_err("is no work");
        assert_eq!(error.to_string(), "work.toml: work is missing");
        let error = spec.add_work("[work]\n[lock]\ntake = 1", "work.toml").expect_err("is not only work");
        assert_eq!(error.to_string(), "work.toml: lock is not a figure of a machine");
    }

    /// Catches a barrier formula that leaves a term out or takes the wrong logarithm.
    #[test]
    fn a_barrier_costs_its_formula() {
        let text = IDEAL
            .replace("base = 1 ", "base = 100 ")
            .replace("per_processor = 0", "per_processor = 7")
            .replace("per_level = 0", "per_level = 1000");
        let spec = MachineSpec::from_toml(&text, "x").expect("sound");
        assert_eq!([1, 2, 5, 8].map(|p| spec.barrier(p)), [107, 1114, 3135, 3156]);
    }
}
