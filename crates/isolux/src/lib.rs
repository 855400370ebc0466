//! The facade: settings in, a solved, checked, reopenable solution out.
