//! What documents say of files of figures: the errors of `docs/machines/index.md` are told as they stand there.

#![allow(clippy::unwrap_used)]

use isolux_simulator::MachineSpec;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Catches a message that is worded otherwise than the document quotes it, and an example that no longer opens.
#[test]
fn errors_are_told_as_quoted() {
    let sound = std::fs::read_to_string(root().join("crates/simulator/examples/my_machine.toml")).unwrap();
    assert_eq!(MachineSpec::from_toml(&sound, "my_machine.toml").unwrap().name(), "dear-prefix");
    let page = std::fs::read_to_string(root().join("docs/machines/index.md")).unwrap();
    let rows: Vec<Vec<&str>> = page
        .lines()
        .filter(|line| line.contains("`my_machine.toml: "))
        .map(|line| line.split('`').skip(1).step_by(2).collect())
        .collect();
    assert!(rows.len() > 5);
    for row in rows {
        let [from, to, message] = row[..] else { panic!("{row:?}") };
        assert!(sound.contains(from), "{from}");
        let wrong = sound.replace(from, &to.replace("\\n", "\n"));
        assert_eq!(MachineSpec::from_toml(&wrong, "my_machine.toml").expect_err(to).to_string(), message);
    }
}
