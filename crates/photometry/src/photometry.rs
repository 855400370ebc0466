//! What a photometric file says, whichever format it has: the web, the lamps, the opening, and what was mended.

use crate::error::{PhotometryError, Warning};
use crate::opening::Opening;
use crate::text::{Notes, decode, lines, shown};
use crate::web::Web;
use crate::{ies, ldt};
use std::io::Read;
use std::path::Path;

/// Longest file that is read, bytes: a table of every degree of the sphere has half a megabyte.
pub const MAX_BYTES: u64 = 16 << 20;

/// Which format a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// IES LM-63 of a year: 1986 where the file names no version.
    Ies(u16),
    /// EULUMDAT.
    Eulumdat,
}

impl Format {
    /// Name as people write it.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Format::Ies(year) => format!("IES LM-63-{year}"),
            Format::Eulumdat => "EULUMDAT".into(),
        }
    }
}

/// What the file says of the lamp's output by tilt. No intensity depends on it here.
#[derive(Clone, Debug, PartialEq)]
pub enum Tilt {
    /// It does not depend on it, or the file does not say.
    None,
    /// The file has factors for angles of tilt.
    Included {
        /// Position of the lamp in the luminaire: 1 vertical, 2 horizontal, 3 horizontal and turned with the luminaire.
        geometry: u8,
        /// Angles of tilt, degrees.
        angles: Vec<f64>,
        /// Factors on the lamp's output.
        factors: Vec<f64>,
    },
    /// The factors are in another file, which is not read.
    File(String),
    /// EULUMDAT: the luminaire was tilted by so many degrees when it was measured.
    Measured(f64),
}

/// Lamps that a luminaire may be fitted with.
#[derive(Clone, Debug, PartialEq)]
pub struct LampSet {
    /// How many.
    pub count: f64,
    /// What they are.
    pub name: String,
    /// Flux of all of them, lumens; `None` with absolute photometry of IES files.
    pub lumens: Option<f64>,
    /// Power, watts, ballast included.
    pub watts: Option<f64>,
    /// Colour of their light, as the file words it.
    pub colour: String,
    /// Colour rendering, as the file words it.
    pub rendering: String,
}

/// A luminaire as a file describes it. The crate's page says in which frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Name of the file.
    pub file: String,
    /// Its format.
    pub format: Format,
    /// Name of the luminaire; the file's label lines where it has no keywords.
    pub luminaire: String,
    /// Its number in a catalogue.
    pub catalogue: String,
    /// Who makes it.
    pub manufacturer: String,
    /// Whether intensities were measured as they are: not per lumen of the lamps.
    pub absolute: bool,
    /// Lamps; those of the first entry are in it.
    pub lamps: Vec<LampSet>,
    /// Flux of the lamps, lumens, the ballast's factor included; `None` where the file does not say.
    pub lamp_lumens: Option<f64>,
    /// Flux of the luminaire as the file states it, lumens: of EULUMDAT the lamps' flux by the light output ratio, of
    /// absolute IES files that of the keyword `_ABSOLUTELUMENS`; `None` where the file does not say.
    pub stated_lumens: Option<f64>,
    /// Power of the luminaire, watts.
    pub watts: Option<f64>,
    /// What the light comes out of.
    pub opening: Opening,
    /// Lamp output by tilt.
    pub tilt: Tilt,
    /// IES keywords and their values in the file's order, continued lines joined; of EULUMDAT its other text fields.
    pub keywords: Vec<(String, String)>,
    /// Intensities.
    pub web: Web,
    /// What was mended, assumed or left out, in the order of lines.
    pub warnings: Vec<Warning>,
}

impl Photometry {
    /// Intensity in candela in a direction of the luminaire's frame, see [`Web::intensity`].
    #[must_use]
    pub fn intensity(&self, direction: [f64; 3]) -> f64 {
        self.web.intensity(direction)
    }

    /// Flux in lumens, integrated, see [`Web::flux`].
    #[must_use]
    pub fn flux(&self) -> f64 {
        self.web.flux()
    }

    /// Share of the flux that goes into the half space of -Z; `None` where there is no light. With a luminaire that
    /// hangs, the downward flux fraction.
    #[must_use]
    pub fn downward(&self) -> Option<f64> {
        let flux = self.flux();
        (flux > 0.0).then(|| (self.web.flux_down() / flux).clamp(0.0, 1.0))
    }

    /// Share of the flux that does not go into the half space of -Z.
    #[must_use]
    pub fn upward(&self) -> Option<f64> {
        self.downward().map(|down| 1.0 - down)
    }

    /// Light output ratio: flux of the luminaire by that of its lamps; `None` where that is not stated.
    #[must_use]
    pub fn output_ratio(&self) -> Option<f64> {
        self.lamp_lumens.filter(|&lumens| !self.absolute && lumens > 0.0).map(|lumens| self.flux() / lumens)
    }

    /// Beam angles, degrees: to half of the highest intensity, see [`Web::spread`].
    #[must_use]
    pub fn beam(&self) -> [Option<f64>; 2] {
        self.web.spread(0.5)
    }

    /// Field angles, degrees: to a tenth of the highest intensity, see [`Web::spread`].
    #[must_use]
    pub fn field(&self) -> [Option<f64>; 2] {
        self.web.spread(0.1)
    }

    /// The same distribution with another flux in lumens: intensities are multiplied, once.
    ///
    /// # Errors
    /// [`PhotometryError::Scale`] where `lumens` is no finite number of 0 or more, or where there is no light to scale.
    pub fn with_flux(&self, lumens: f64) -> Result<Photometry, PhotometryError> {
        let scale = |reason| PhotometryError::Scale { file: self.file.clone(), lumens, reason };
        if !lumens.is_finite() || lumens < 0.0 {
            return Err(scale("expected a finite number of lumens, 0 or more"));
        }
        let factor = lumens / self.flux();
        if !factor.is_finite() || self.web.peak().candela * factor > MOST_CANDELA {
            return Err(scale("its own flux is too small"));
        }
        let by = |value: Option<f64>| value.map(|value| value * factor);
        let lamps = self.lamps.iter().map(|set| LampSet { lumens: by(set.lumens), ..set.clone() }).collect();
        Ok(Photometry {
            web: self.web.scaled(factor),
            lamps,
            lamp_lumens: by(self.lamp_lumens),
            stated_lumens: by(self.stated_lumens),
            ..self.clone()
        })
    }
}

/// Most candela that a table may hold: a million times the strongest searchlight's, and far from where sums overflow.
pub(crate) const MOST_CANDELA: f64 = 1e15;

/// Reads a photometric file. Its content tells the format, its name where that does not.
///
/// # Errors
/// [`PhotometryError`] where it cannot be read, is too long, or is broken; each names the file, and the line.
pub fn read(path: &Path) -> Result<Photometry, PhotometryError> {
    let name = crate::text::clean(&path.display().to_string());
    let io = |reason: String| PhotometryError::Io { file: name.clone(), reason };
    let metadata = std::fs::metadata(path).map_err(|error| io(reason(&error)))?;
    if !metadata.is_file() {
        // A pipe or a device may never end.
        return Err(io("it is not a regular file".into()));
    }
    if metadata.len() > MAX_BYTES {
        return Err(PhotometryError::TooLarge { file: name, bytes: metadata.len(), limit: MAX_BYTES });
    }
    let file = std::fs::File::open(path).map_err(|error| io(reason(&error)))?;
    let mut bytes = Vec::new();
    file.take(metadata.len()).read_to_end(&mut bytes).map_err(|error| io(reason(&error)))?;
    parse(&bytes, &name)
}

/// In words of ours where people meet it often.
fn reason(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no such file".to_owned(),
        std::io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        _ => error.to_string(),
    }
}

/// Reads the bytes of a photometric file; `name` is that of the file, for messages, and its ending counts where the
/// content does not tell the format.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: &[u8], name: &str) -> Result<Photometry, PhotometryError> {
    let mut notes = Notes::new(name);
    if bytes.len() as u64 > MAX_BYTES {
        return Err(PhotometryError::TooLarge { file: notes.file, bytes: bytes.len() as u64, limit: MAX_BYTES });
    }
    let text = decode(bytes);
    let lines = lines(&text);
    let ending = Path::new(name).extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let has_tilt = lines.iter().any(|line| ies::tilt_of(line).is_some());
    let starts_like_ies = lines.iter().find(|line| !line.trim().is_empty()).is_some_and(|line| ies::is_header(line));
    if has_tilt || starts_like_ies || ending.as_deref() == Some("ies") {
        ies::read(&lines, &mut notes)
    } else if ending.as_deref() == Some("ldt") || ldt::looks_like(&lines) {
        ldt::read(&lines, &mut notes)
    } else {
        let found = lines.first().map_or_else(|| "an empty file".into(), |line| shown(line));
        Err(PhotometryError::UnknownFormat { file: notes.file, found })
    }
}
