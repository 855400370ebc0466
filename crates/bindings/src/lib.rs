//! The Python extension module: arrays in and out, an exhaustive map of errors, and nothing else.
