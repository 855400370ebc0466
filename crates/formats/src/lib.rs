//! Files at both ends: scene files become a [`isolux_core::scene::SceneInput`], surfaces with light on them become
//! files; what is in between is the core's.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr))]

pub mod read;
pub mod write;
