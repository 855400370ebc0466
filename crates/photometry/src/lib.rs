//! Luminaires as they were measured: the bytes of an IES or EULUMDAT file come in, a [`Photometry`] comes out, which
//! tells the intensity in any direction, the flux, and what the file says of lamps and opening. Where the luminaire
//! hangs, and what it lights, is left to others.
//!
//! # Frame
//!
//! Directions are in the luminaire's frame, which is that of glTF's lights (`KHR_lights_punctual`, `EXT_lights_ies`):
//! the luminaire points along -Z, and the place where both angles of the file are 0 lies there. A luminaire that hangs
//! from a ceiling of a scene with +Y up needs a node that turns -Z downwards.
//!
//! | type | direction of vertical angle V and horizontal angle H |
//! |---|---|
//! | C | `(sin V cos H, sin V sin H, -cos V)`: H is counter-clockwise, seen against the aim (from +Z) |
//! | B | `(cos H sin V, -sin H, -cos H cos V)`: the poles are at +Y and -Y, H is clockwise |
//! | A | `(sin V, -cos V sin H, -cos V cos H)`: the poles are at +X and -X, H is clockwise |
//!
//! So the horizontal photometric plane is X/Y, and V leaves the axis in the plane X/Z at H = 0, for all three, as
//! `EXT_lights_ies` has it. EULUMDAT's C and gamma are H and V of type C. In IES files the length of the luminous
//! opening lies along the plane H = 0, in EULUMDAT along C90: see [`Opening`].
//!
//! # Units
//!
//! Degrees, candela, lumens, watts, metres.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod axis;
mod error;
mod ies;
mod ldt;
mod opening;
mod photometry;
mod text;
mod web;

pub use error::{PhotometryError, Warning};
pub use opening::{Opening, OpeningShape};
pub use photometry::{Format, LampSet, MAX_BYTES, Photometry, Tilt, parse, read};
pub use web::{Grid, Kind, Peak, Symmetry, Web};
