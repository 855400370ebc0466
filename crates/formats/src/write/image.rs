//! A rendered picture of linear radiance comes in; an 8-bit sRGB PNG (tone-mapped) or a linear float OpenEXR goes
//! out, each with its provenance. Lightmaps, pictures of irradiance, become 16-bit linear PNG or OpenEXR.

use super::tone::{srgb8, unit};
use super::{Provenance, ToneMap, Unit, WriteError};
use exr::prelude as ex;
use isolux_core::units::Rgb;
use std::io::Cursor;

/// Linear radiance (cd/m² or W/(m² sr)), of lightmaps irradiance (lm/m² or W/m²), row by row from the top left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<Rgb>,
}

impl Picture {
    /// Invariants: neither side is zero, there are as many pixels as the sides say, every band is finite as a 32-bit
    /// float.
    ///
    /// # Errors
    /// [`WriteError`] naming the first that is broken.
    pub fn check(&self) -> Result<(), WriteError> {
        let (width, height) = (self.width, self.height);
        let expected = u64::from(width) * u64::from(height);
        if expected == 0 || expected != self.pixels.len() as u64 {
            return Err(WriteError::PictureSize { width, height, pixels: self.pixels.len() });
        }
        match self.pixels.iter().position(|pixel| !pixel.0.iter().all(|&band| (band as f32).is_finite())) {
            None => Ok(()),
            Some(index) => Err(WriteError::Pixel {
                x: (index % width as usize) as u32,
                y: (index / width as usize) as u32,
                value: self.pixels[index].0,
            }),
        }
    }
}

/// How [`png()`] writes.
#[derive(Clone, Debug, PartialEq)]
pub struct PngOptions {
    /// Factor on radiance before the tone map.
    pub exposure: f64,
    /// Tone map.
    pub tone: ToneMap,
    /// Where the solution comes from.
    pub provenance: Provenance,
}

/// The picture as PNG: exposed, tone-mapped, 8 bits a band with the sRGB transfer function. The provenance is in `iTXt`
/// chunks `isolux:KEY`.
///
/// # Errors
/// [`WriteError`] where the picture breaks an invariant of [`Picture::check`], or exposure or white point is not a
/// positive number.
pub fn png(picture: &Picture, options: &PngOptions) -> Result<Vec<u8>, WriteError> {
    picture.check()?;
    let PngOptions { exposure, tone, ref provenance } = *options;
    if !(exposure.is_finite() && exposure > 0.0) {
        return Err(WriteError::Exposure { exposure });
    }
    if let ToneMap::Reinhard { white } = tone
        && !(white.is_finite() && white > 0.0)
    {
        return Err(WriteError::White { white });
    }
    let codes: Vec<u8> = picture.pixels.iter().flat_map(|&pixel| tone.apply(pixel * exposure).0.map(srgb8)).collect();
    encode_png(picture, &codes, exposure, tone, provenance)
        .map_err(|error| WriteError::Encode { format: "PNG", message: error.to_string() })
}

/// A lightmap as PNG of 16 bits a band, linear: `value / scale`, cut to `[0, 1]`. It carries neither gamma nor colour space, so
/// that no reader converts it. The provenance is in `iTXt` chunks `isolux:KEY`, the scale in `isolux:scale`.
///
/// # Errors
/// [`WriteError`] where the picture breaks an invariant of [`Picture::check`], or the scale is not a positive number.
pub fn lightmap_png(picture: &Picture, scale: f64, provenance: &Provenance) -> Result<Vec<u8>, WriteError> {
    picture.check()?;
    if !(scale.is_finite() && scale > 0.0) {
        return Err(WriteError::Exposure { exposure: scale });
    }
    let code = |value: f64| ((65_535.0 * unit(value / scale)).round() as u16).to_be_bytes();
    let codes: Vec<u8> = picture.pixels.iter().flat_map(|pixel| pixel.0).flat_map(code).collect();
    encode_lightmap(picture, &codes, scale, provenance)
        .map_err(|error| WriteError::Encode { format: "PNG", message: error.to_string() })
}

fn encode_lightmap(
    picture: &Picture,
    codes: &[u8],
    scale: f64,
    provenance: &Provenance,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.add_text_chunk("Software".to_owned(), latin1(&provenance.generator()))?;
    for (key, value) in provenance.entries(None) {
        encoder.add_itxt_chunk(format!("isolux:{key}"), value.replace('\0', " "))?;
    }
    encoder.add_itxt_chunk("isolux:scale".to_owned(), scale.to_string())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(codes)?;
    writer.finish()?;
    Ok(bytes)
}

fn encode_png(
    picture: &Picture,
    codes: &[u8],
    exposure: f64,
    tone: ToneMap,
    provenance: &Provenance,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    encoder.add_text_chunk("Software".to_owned(), latin1(&provenance.generator()))?;
    for (key, value) in provenance.entries(Some(exposure)) {
        // A zero byte would end the text early.
        encoder.add_itxt_chunk(format!("isolux:{key}"), value.replace('\0', " "))?;
    }
    let tone = match tone {
        ToneMap::Clip => "clip".to_owned(),
        ToneMap::Reinhard { white } => format!("reinhard2002 white={white}"),
    };
    encoder.add_itxt_chunk("isolux:toneMap".to_owned(), tone)?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(codes)?;
    writer.finish()?;
    Ok(bytes)
}

/// What a Latin-1 chunk can hold of `text`.
fn latin1(text: &str) -> String {
    text.chars().map(|c| if matches!(c, ' '..='~') { c } else { '?' }).collect()
}

/// The picture as OpenEXR: channels R, G, B of linear 32-bit radiance (Rec. 709 primaries), ZIP compressed, nothing
/// exposed or tone-mapped. The provenance is JSON text in the standard attribute `comments`; `software` names the
/// version, `unit` the unit, `whiteLuminance` is 1 for photometric pictures (a pixel of (1,1,1) is 1 cd/m²).
///
/// # Errors
/// [`WriteError`] where the picture breaks an invariant of [`Picture::check`].
pub fn exr(picture: &Picture, provenance: &Provenance) -> Result<Vec<u8>, WriteError> {
    let white = (provenance.unit == Unit::Photometric).then_some(1.0);
    encode_exr(picture, provenance, provenance.unit.radiance(), white)
}

/// A lightmap as OpenEXR: as [`exr()`], but of irradiance, which the attribute `unit` says, and without `whiteLuminance`.
///
/// # Errors
/// [`WriteError`] where the picture breaks an invariant of [`Picture::check`].
pub fn lightmap_exr(picture: &Picture, provenance: &Provenance) -> Result<Vec<u8>, WriteError> {
    encode_exr(picture, provenance, provenance.unit.per_area(), None)
}

fn encode_exr(
    picture: &Picture,
    provenance: &Provenance,
    unit: &str,
    white_luminance: Option<f32>,
) -> Result<Vec<u8>, WriteError> {
    picture.check()?;
    let comments = serde_json::to_string(&provenance.json(None))
        .map_err(|error| WriteError::Encode { format: "EXR", message: error.to_string() })?;
    let width = picture.width as usize;
    let mut layer = ex::LayerAttributes {
        software_name: Some(text(&latin1(&provenance.generator()))),
        comments: Some(text(&ascii_json(&comments))),
        white_luminance,
        ..ex::LayerAttributes::default()
    };
    // The encoder keeps free attributes in a hash map: only one, so that no order can differ from run to run.
    layer.other.insert(text("unit"), ex::AttributeValue::Text(text(unit)));
    let channels = ex::SpecificChannels::rgb(|at: ex::Vec2<usize>| {
        let [r, g, b] = picture.pixels[at.y() * width + at.x()].0.map(|band| band as f32);
        (r, g, b)
    });
    let encoding = ex::Encoding { compression: ex::Compression::ZIP16, ..ex::Encoding::FAST_LOSSLESS };
    let layer = ex::Layer::new((width, picture.height as usize), layer, encoding, channels);
    let mut image = ex::Image::from_layer(layer);
    // ITU-R BT.709-6, items 1.3 and 1.4.
    image.attributes.chromaticities = Some(exr::meta::attribute::Chromaticities {
        red: ex::Vec2(0.64, 0.33),
        green: ex::Vec2(0.30, 0.60),
        blue: ex::Vec2(0.15, 0.06),
        white: ex::Vec2(0.3127, 0.3290),
    });
    let mut bytes = Cursor::new(Vec::new());
    ex::WritableImage::write(&image)
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|error| WriteError::Encode { format: "EXR", message: error.to_string() })?;
    Ok(bytes.into_inner())
}

/// Text of an attribute; the caller gives ASCII.
fn text(ascii: &str) -> ex::Text {
    ex::Text::from_slice_unchecked(ascii.as_bytes())
}

/// The same JSON in ASCII: other characters become `\uXXXX` (they can stand in strings only).
fn ascii_json(json: &str) -> String {
    let mut ascii = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                ascii.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    ascii
}
