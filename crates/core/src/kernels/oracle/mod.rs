//! Decides for one link: keep it, split its receiver, split its source.
