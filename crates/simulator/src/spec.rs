//! The figures of a machine: a TOML file goes in, checked figures come out, or one error that names the file and the key.

use std::collections::BTreeMap;
use std::path::Path;

use isolux_machine::ClassError;
use thiserror::Error;
use toml::{Table, Value};

/// The most that one operation may cost. A million units is an operating system's time slice; whoever writes more has mistaken
/// the unit.
const COST_MAX: i64 = 1_000_000;
/// The most processors that a file may allow: what the numbers in the event queue hold, with room to spare.
const PROCESSORS_MAX: i64 = 1 << 20;
/// Figures of work are kept in thousandths of a unit.
const PARTS: f64 = 1000.0;

/// Why figures cannot be had.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SpecError {
    /// The file cannot be read.
    #[error("{file}: {reason}")]
    Read {
        /// Which file.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// The file is no TOML.
    #[error("{file}: {reason}")]
    Syntax {
        /// Which file.
        file: String,
        /// What the parser says.
        reason: String,
    },
    /// A figure is not there.
    #[error("{file}: {key} is missing")]
    Missing {
        /// Which file.
        file: String,
        /// The figure, with its table.
        key: String,
    },
    /// A figure is not what it can be.
    #[error("{file}: {key} is {value}; it must be {allowed}")]
    Absurd {
        /// Which file.
        file: String,
        /// The figure, with its table.
        key: String,
        /// What the file says.
        value: String,
        /// What it may say.
        allowed: String,
    },
    /// A key that means nothing, perhaps misspelt.
    #[error("{file}: {key} means nothing here")]
    Unknown {
        /// Which file.
        file: String,
        /// The key, with its table.
        key: String,
    },
    /// A number of processors or classes of work that the machine cannot have.
    #[error("{file}: {source}")]
    Machine {
        /// Which file the machine's figures come from.
        file: String,
        /// What is wrong.
        source: ClassError,
    },
}

/// A machine's figures. Immutable, but for the figures of work, which are added.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    pub(crate) file: String,
    name: String,
    pub(crate) processors_max: usize,
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

/// A table of a file, with what is needed to complain about it.
struct Section<'a> {
    file: &'a str,
    table: &'a Table,
    /// Empty, or the table's name and a dot.
    path: &'static str,
}

impl Section<'_> {
    fn key(&self, key: &str) -> String {
        format!("{}{key}", self.path)
    }

    fn value(&self, key: &str) -> Result<&Value, SpecError> {
        let missing = || SpecError::Missing { file: self.file.to_owned(), key: self.key(key) };
        self.table.get(key).ok_or_else(missing)
    }

    fn absurd(&self, key: &str, value: &Value, allowed: String) -> SpecError {
        let file = self.file.to_owned();
        SpecError::Absurd { file, key: self.key(key), value: value.to_string(), allowed }
    }

    fn whole(&self, key: &str, min: i64, max: i64) -> Result<u64, SpecError> {
        let value = self.value(key)?;
        match value.as_integer() {
            Some(figure) if (min..=max).contains(&figure) => Ok(figure.unsigned_abs()),
            _ => Err(self.absurd(key, value, format!("a whole number from {min} to {max}"))),
        }
    }

    fn section(&self, key: &'static str, path: &'static str) -> Result<Section<'_>, SpecError> {
        let value = self.value(key)?;
        let table = value.as_table().ok_or_else(|| self.absurd(key, value, "a table".to_owned()))?;
        Ok(Section { file: self.file, table, path })
    }

    fn only(&self, keys: &[&str]) -> Result<(), SpecError> {
        match self.table.keys().find(|k| !keys.contains(&k.as_str())) {
            Some(key) => Err(SpecError::Unknown { file: self.file.to_owned(), key: self.key(key) }),
            None => Ok(()),
        }
    }

    fn work(&self) -> Result<BTreeMap<String, u64>, SpecError> {
        let figure = |(class, value): (&String, &Value)| {
            let units = value.as_float().or(value.as_integer().map(|i| i as f64)).unwrap_or(f64::NAN);
            let parts = (units * PARTS).round();
            // The nearest number of thousandths is off by what a decimal fraction is off in binary, a part in 10^16.
            let exact = (units * PARTS - parts).abs() <= parts.abs() * 1e-12;
            if exact && (0.0..=COST_MAX as f64 * PARTS).contains(&parts) {
                Ok((class.clone(), parts as u64))
            } else {
                Err(self.absurd(class, value, format!("from 0 to {COST_MAX}, with at most three decimals")))
            }
        };
        self.table.iter().map(figure).collect()
    }
}

fn parse(text: &str, file: &str) -> Result<Table, SpecError> {
    let one_line = |e: toml::de::Error| e.to_string().lines().collect::<Vec<_>>().join(" ");
    text.parse().map_err(|e| SpecError::Syntax { file: file.to_owned(), reason: one_line(e) })
}

fn read(file: &Path) -> Result<(String, String), SpecError> {
    let name = file.display().to_string();
    match std::fs::read_to_string(file) {
        Ok(text) => Ok((text, name)),
        Err(e) => Err(SpecError::Read { file: name, reason: e.to_string() }),
    }
}

impl Spec {
    /// Figures from a file.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn open(file: &Path) -> Result<Self, SpecError> {
        let (text, name) = read(file)?;
        Self::from_toml(&text, &name)
    }

    /// Figures from a text; errors name `file`.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, SpecError> {
        let table = &parse(text, file)?;
        let top = Section { file, table, path: "" };
        top.only(&["name", "processors_max", "operation", "wait", "lock", "barrier", "work"])?;
        let name = top.value("name")?;
        let name = name.as_str().ok_or_else(|| top.absurd("name", name, "a text".to_owned()))?;
        let operation = top.section("operation", "operation.")?;
        operation.only(&["load", "store", "prefix"])?;
        let wait = top.section("wait", "wait.")?;
        wait.only(&["spin", "scan"])?;
        let lock = top.section("lock", "lock.")?;
        lock.only(&["take", "give"])?;
        let barrier = top.section("barrier", "barrier.")?;
        barrier.only(&["base", "per_processor", "per_level"])?;
        Ok(Self {
            file: file.to_owned(),
            name: name.to_owned(),
            processors_max: top.whole("processors_max", 1, PROCESSORS_MAX)? as usize,
            load: operation.whole("load", 1, COST_MAX)?,
            store: operation.whole("store", 1, COST_MAX)?,
            prefix: operation.whole("prefix", 1, COST_MAX)?,
            spin: wait.whole("spin", 1, COST_MAX)?,
            scan: wait.whole("scan", 1, COST_MAX)?,
            take: lock.whole("take", 1, COST_MAX)?,
            give: lock.whole("give", 1, COST_MAX)?,
            barrier_base: barrier.whole("base", 1, COST_MAX)?,
            barrier_per_processor: barrier.whole("per_processor", 0, COST_MAX)?,
            barrier_per_level: barrier.whole("per_level", 0, COST_MAX)?,
            work: top.section("work", "work.")?.work()?,
        })
    }

    /// Figures that come with the crate; a test opens each.
    pub(crate) fn built_in(text: &str, file: &str) -> Self {
        Self::from_toml(text, file).unwrap_or_else(|e| unreachable!("built-in figures: {e}"))
    }

    /// Adds a program's figures of work, of a file that has nothing but a table `work`. Figures of the same name are replaced.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn add_work(&mut self, text: &str, file: &str) -> Result<(), SpecError> {
        let table = &parse(text, file)?;
        let top = Section { file, table, path: "" };
        top.only(&["work"])?;
        self.work.extend(top.section("work", "work.")?.work()?);
        Ok(())
    }

    /// [`Spec::add_work`] with a file's text.
    ///
    /// # Errors
    ///
    /// Names the file and the key.
    pub fn open_work(&mut self, file: &Path) -> Result<(), SpecError> {
        let (text, name) = read(file)?;
        self.add_work(&text, &name)
    }

    /// The machine's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What a barrier costs each of so many processors once all are there: base + processors x `per_processor` + levels x
    /// `per_level`, where levels is the logarithm to base 2, rounded up.
    pub fn barrier(&self, processors: usize) -> u64 {
        let levels = u64::from(processors.max(1).next_power_of_two().trailing_zeros());
        self.barrier_base + self.barrier_per_processor * processors as u64 + self.barrier_per_level * levels
    }

    /// Thousandths of a unit for one of a class of work.
    pub(crate) fn work(&self, class: &str) -> Result<u64, SpecError> {
        let missing = || SpecError::Missing { file: self.file.clone(), key: format!("work.{class}") };
        self.work.get(class).copied().ok_or_else(missing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches built-in figures that cannot be opened, and the paper's that are not the paper's.
    #[test]
    fn built_in_figures_are_those_of_the_sources() {
        let ideal = Spec::ideal();
        let (name, load, store, prefix) = (ideal.name(), ideal.load, ideal.store, ideal.prefix);
        assert_eq!((name, load, store, prefix, ideal.barrier(1000)), ("ideal", 1, 1, 1, 1));
        let sb_pram = Spec::sb_pram();
        assert_eq!((sb_pram.name(), sb_pram.processors_max), ("sb-pram", 16_384));
        assert_eq!((sb_pram.load, sb_pram.store, sb_pram.prefix), (1, 1, 2));
        assert_eq!(sb_pram.barrier(2), sb_pram.barrier(16_384));
    }

    /// Catches a missing, absurd or misspelt figure that goes unnoticed, and an error that names the wrong place.
    #[test]
    fn errors_name_file_and_key() {
        let good = include_str!("sb_pram/spec.toml");
        let told = |from: &str, to: &str| {
            assert!(good.contains(from), "the test is out of date: {from}");
            Spec::from_toml(&good.replace(from, to), "my.toml").expect_err("is wrong").to_string()
        };
        assert_eq!(told("prefix = 2", "# prefix"), "my.toml: operation.prefix is missing");
        assert_eq!(
            told("prefix = 2", "prefix = 0"),
            "my.toml: operation.prefix is 0; it must be a whole number from 1 to 1000000"
        );
        assert_eq!(
            told("load = 1", "load = 1.5"),
            "my.toml: operation.load is 1.5; it must be a whole number from 1 to 1000000"
        );
        assert_eq!(told("per_level = 0", "per_levle = 0"), "my.toml: barrier.per_levle means nothing here");
        assert_eq!(told("[lock]", "[locks]"), "my.toml: locks means nothing here");
        assert_eq!(
            told("[work]", "[work]\nray = -1"),
            "my.toml: work.ray is -1; it must be from 0 to 1000000, with at most three decimals"
        );
        assert_eq!(
            told("[work]", "[work]\nray = 0.1234"),
            "my.toml: work.ray is 0.1234; it must be from 0 to 1000000, with at most three decimals"
        );
        assert!(told("[work]", "[work").starts_with("my.toml: TOML parse error"));
        let missing = Spec::open(Path::new("no/such/file.toml")).expect_err("is not there").to_string();
        assert!(missing.starts_with("no/such/file.toml: "), "{missing}");
    }

    /// Catches figures of work that are rounded, or lost when a program brings its own.
    #[test]
    fn work_is_added_exactly() {
        let mut spec = Spec::ideal();
        assert_eq!(spec.work("ray").expect_err("not yet").to_string(), "ideal/spec.toml: work.ray is missing");
        spec.add_work("[work]\nray = 10.1\nbox = 3", "work.toml").expect("sound");
        spec.add_work("[work]\nbox = 4.005", "work.toml").expect("sound");
        assert_eq!((spec.work("ray"), spec.work("box")), (Ok(10_100), Ok(4_005)));
        let error = spec.add_work("[lock]\ntake = 1", "work.toml").expect_err("is no work");
        assert_eq!(error, SpecError::Unknown { file: "work.toml".to_owned(), key: "lock".to_owned() });
    }

    /// Catches a barrier formula that leaves a term out or takes the wrong logarithm.
    #[test]
    fn a_barrier_costs_its_formula() {
        let text = include_str!("ideal/spec.toml")
            .replace("base = 1 ", "base = 100 ")
            .replace("per_processor = 0", "per_processor = 7")
            .replace("per_level = 0", "per_level = 1000");
        let spec = Spec::from_toml(&text, "x").expect("sound");
        assert_eq!([1, 2, 5, 8].map(|p| spec.barrier(p)), [107, 1114, 3135, 3156]);
    }
}
