//! Identity of a scene: a hash over everything that its links depend on.
