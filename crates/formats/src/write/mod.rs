//! A scene and the light on its surfaces come in ([`SurfaceMesh`]), or a [`Picture`]; bytes of lit files go out (GLB,
//! PLY, VTU, PNG, EXR), each with a [`Provenance`] of where it comes from; solving and rendering are left to others.
//!
//! Everything is serialised in memory first; [`write_aside`] alone touches the file system.

mod aside;
mod error;
mod glb;
mod image;
mod ply;
mod provenance;
mod surfaces;
mod tone;
mod vtu;

pub use aside::{Recall, write_aside, write_aside_with};
pub use error::WriteError;
pub use glb::{GlbOptions, glb};
pub use image::{Picture, PngOptions, exr, lightmap_exr, lightmap_png, png};
pub use isolux_core::units::Unit;
pub use ply::ply;
pub use provenance::Provenance;
pub use tone::{MIDDLE_GREY, ToneMap, auto_exposure, luminance, srgb_encode, srgb8};
pub use vtu::vtu;

#[cfg(doc)]
use isolux_core::solution::SurfaceMesh;
