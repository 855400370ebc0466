//! IES LM-63 of 1986, 1991, 1995, 2002 and 2019: lines come in, a [`Photometry`] comes out. Sources: LM-63-2002 and
//! LM-63-2019.

use crate::error::PhotometryError;
use crate::opening::Opening;
use crate::photometry::{Format, LampSet, MOST_CANDELA, Photometry, Tilt};
use crate::text::{Notes, Numbers, clean, number, shown};
use crate::web::{Kind, Table, Web};

/// Metres per foot.
const FOOT: f64 = 0.3048;

/// How far the flux may exceed that of the lamps, or differ from what is stated, before a warning: what laboratories
/// differ by.
const FLUX_SLACK: f64 = 1.05;

/// Whether a line is the one that names the version.
pub(crate) fn is_header(line: &str) -> bool {
    let line = line.trim().to_ascii_uppercase();
    line.starts_with("IESNA") || line.starts_with("IES:")
}

/// What follows `TILT=` on a line that has it.
pub(crate) fn tilt_of(line: &str) -> Option<&str> {
    let line = line.trim();
    let (word, rest) = line.split_at_checked(4)?;
    word.eq_ignore_ascii_case("TILT").then(|| rest.trim_start().strip_prefix('='))?.map(str::trim)
}

/// Everything above the numbers.
struct Header {
    year: u16,
    keywords: Vec<(String, String)>,
    labels: Vec<String>,
    /// Index of the line `TILT=`, and what follows the sign.
    tilt_line: usize,
    tilt: String,
}

impl Header {
    fn keyword(&self, names: &[&str]) -> String {
        let found = names.iter().find_map(|name| self.keywords.iter().find(|(key, _)| key == name));
        found.map_or_else(String::new, |(_, value)| value.clone())
    }
}

pub(crate) fn read(lines: &[&str], notes: &mut Notes) -> Result<Photometry, PhotometryError> {
    let header = header(lines, notes)?;
    let mut numbers = Numbers::new(lines, header.tilt_line + 1, false);
    let tilt = tilt(&header, &mut numbers, notes)?;

    let (count, count_line) = numbers.next(notes, "the number of lamps")?;
    let (lumens, lumens_line) = numbers.next(notes, "the lumens per lamp (-1 for absolute photometry)")?;
    let (multiplier, line) = numbers.next(notes, "the candela multiplier")?;
    if multiplier <= 0.0 {
        return Err(notes.error(line, "a candela multiplier above 0", format!("'{multiplier}'")));
    }
    let verticals = numbers.count(notes, "the number of vertical angles", 2)?;
    let horizontals = numbers.count(notes, "the number of horizontal angles", 1)?;
    let expected = "the photometric type: 1 (C), 2 (B) or 3 (A)";
    let kind = match numbers.next(notes, expected)? {
        (1.0, _) => Kind::C,
        (2.0, _) => Kind::B,
        (3.0, _) => Kind::A,
        (other, line) => return Err(notes.error(line, expected, format!("'{other}'"))),
    };
    let opening = opening(&header, &mut numbers, notes)?;
    let ballast = ballast(&header, &mut numbers, notes)?;
    let (watts, _) = numbers.next(notes, "the input watts")?;

    let limits = |is_vertical: bool| match (kind, is_vertical) {
        (Kind::C, true) => (0.0, 180.0),
        (Kind::C, false) => (-360.0, 720.0),
        (Kind::A, true) | (Kind::B, false) => (-90.0, 90.0),
        (Kind::A, false) | (Kind::B, true) => (-180.0, 180.0),
    };
    let (vertical, vertical_lines) = numbers.angles(notes, "vertical", verticals, limits(true))?;
    let (horizontal, horizontal_lines) = numbers.angles(notes, "horizontal", horizontals, limits(false))?;
    let (candela, candela_line) = candela(&vertical, &horizontal, multiplier * ballast, &mut numbers, notes)?;
    numbers.finish(notes);

    let last_line = horizontal_lines[horizontals - 1];
    let (web, [above, around]) = Web::new(Table { kind, vertical, horizontal, candela })
        .map_err(|(expected, found)| notes.error(last_line, &expected, found))?;
    if let Some(note) = above {
        notes.warn(vertical_lines[verticals - 1], note);
    }
    if let Some(note) = around {
        notes.warn(last_line, note);
    }

    let absolute = lumens == -1.0;
    let has_lamps = count > 0.0 && lumens > 0.0 && (count * lumens).is_finite();
    if count <= 0.0 {
        notes.warn(count_line, format!("the number of lamps is {count}: the flux of the lamps is unknown"));
    } else if !absolute && !has_lamps {
        notes.warn(lumens_line, format!("the lumens per lamp are {lumens}: the flux of the lamps is unknown"));
    }
    let all_lumens = has_lamps.then_some(count * lumens);
    let lamp_lumens = all_lumens.map(|lumens| lumens * ballast).filter(|lumens| lumens.is_finite());
    let flux = web.flux();
    if flux <= 0.0 {
        notes.warn(candela_line, "every candela value is 0: no light");
    } else if let Some(lamps) = lamp_lumens.filter(|&lamps| flux > FLUX_SLACK * lamps) {
        notes.warn(lumens_line, format!("the lamps give {lamps:.1} lm, and the candela values make {flux:.1} lm"));
    }
    // Laboratories' own keyword for what no field of the format holds.
    let stated = number(&header.keyword(&["_ABSOLUTELUMENS"])).filter(|&lumens| absolute && lumens > 0.0);
    if let Some(stated) = stated.filter(|&stated| flux > 0.0 && (flux / stated - 1.0).abs() > FLUX_SLACK - 1.0) {
        let message = format!("_ABSOLUTELUMENS are {stated:.1} lm, and the candela values make {flux:.1} lm");
        notes.warn(lumens_line, message);
    }
    let watts = (watts > 0.0).then_some(watts);
    let lamps = LampSet {
        count,
        name: header.keyword(&["LAMP", "LAMPCAT"]),
        lumens: all_lumens,
        watts,
        colour: header.keyword(&["COLORTEMP", "_COLORTEMP"]),
        rendering: header.keyword(&["CRI", "_CRI"]),
    };
    let named = header.keyword(&["LUMINAIRE", "LUMCAT"]);
    notes.warnings.sort_by_key(|warning| warning.line);
    Ok(Photometry {
        file: notes.file.clone(),
        format: Format::Ies(header.year),
        luminaire: if named.is_empty() { header.labels.join(" ") } else { named },
        catalogue: header.keyword(&["LUMCAT"]),
        manufacturer: header.keyword(&["MANUFAC"]),
        absolute,
        lamps: vec![lamps],
        lamp_lumens,
        stated_lumens: stated,
        watts,
        opening,
        tilt,
        keywords: header.keywords,
        web,
        warnings: std::mem::take(&mut notes.warnings),
    })
}

/// All that stands up to the line `TILT=`.
fn header(lines: &[&str], notes: &mut Notes) -> Result<Header, PhotometryError> {
    let Some((tilt_line, tilt)) = lines.iter().enumerate().find_map(|(index, line)| Some((index, tilt_of(line)?)))
    else {
        return Err(notes.error(lines.len(), "a line 'TILT='", "the end of the file"));
    };
    let mut header =
        Header { year: 1986, keywords: Vec::new(), labels: Vec::new(), tilt_line, tilt: tilt.trim().to_owned() };
    let mut is_first = true;
    let mut has_version = false;
    for (index, line) in lines[..tilt_line].iter().enumerate() {
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        if is_first && is_header(line) {
            has_version = true;
            header.year = year(line, index + 1, notes);
        } else if let Some((key, value)) = line.strip_prefix('[').and_then(|line| line.split_once(']')) {
            let (key, value) = (clean(key).to_ascii_uppercase(), clean(value));
            match header.keywords.last_mut() {
                Some((_, last)) if key == "MORE" => *last = clean(&format!("{last} {value}")),
                _ => header.keywords.push((key, value)),
            }
        } else {
            header.labels.push(clean(line));
        }
        is_first = false;
    }
    if !has_version && !header.keywords.is_empty() {
        notes.warn(1, "no line names the version, though there are keywords: read as LM-63-1986");
    }
    Ok(header)
}

/// The year of the version that the first line names.
fn year(line: &str, number: usize, notes: &mut Notes) -> u16 {
    let digits = line.rsplit(|letter: char| !letter.is_ascii_digit()).find(|part| part.len() >= 2).unwrap_or_default();
    match digits {
        "1986" | "86" => 1986,
        "1991" | "91" => 1991,
        "1995" | "95" => 1995,
        "2002" | "02" => 2002,
        "2019" | "19" => 2019,
        _ => {
            notes.warn(number, format!("version {} is not known: read as LM-63-2002", shown(line)));
            2002
        }
    }
}

fn tilt(header: &Header, numbers: &mut Numbers<'_>, notes: &mut Notes) -> Result<Tilt, PhotometryError> {
    let line = header.tilt_line + 1;
    match header.tilt.to_ascii_uppercase().as_str() {
        "NONE" => Ok(Tilt::None),
        "" => {
            notes.warn(line, "nothing follows 'TILT=': read as NONE");
            Ok(Tilt::None)
        }
        "INCLUDE" => {
            let expected = "the lamp's position: 1, 2 or 3";
            let geometry = match numbers.next(notes, expected)? {
                (1.0, _) => 1,
                (2.0, _) => 2,
                (3.0, _) => 3,
                (other, line) => return Err(notes.error(line, expected, format!("'{other}'"))),
            };
            let count = numbers.count(notes, "the number of tilt angles", 1)?;
            let (angles, _) = numbers.angles(notes, "tilt", count, (-180.0, 180.0))?;
            let mut factors = Vec::new();
            for index in 1..=count {
                factors.push(numbers.next(notes, &format!("tilt factor {index} of {count}"))?.0);
            }
            notes.warn(line, format!("{count} tilt factors are read and not applied: the lamp is taken as untilted"));
            Ok(Tilt::Included { geometry, angles, factors })
        }
        _ => {
            let file = clean(&header.tilt);
            notes.warn(line, format!("tilt factors in file {} are not read", shown(&file)));
            Ok(Tilt::File(file))
        }
    }
}

/// The units, and three dimensions.
fn opening(header: &Header, numbers: &mut Numbers<'_>, notes: &mut Notes) -> Result<Opening, PhotometryError> {
    let (units, line) = numbers.next(notes, "the units: 1 (feet) or 2 (metres)")?;
    let mut size = [0.0; 3];
    for (value, what) in size.iter_mut().zip(["width", "length", "height"]) {
        *value = numbers.next(notes, &format!("the {what} of the luminous opening"))?.0;
    }
    let metres = match units {
        1.0 => FOOT,
        2.0 => 1.0,
        other => {
            notes.warn(line, format!("the units are '{other}', neither 1 (feet) nor 2 (metres): no opening"));
            return Ok(Opening::POINT);
        }
    };
    let [width, length, height] = size.map(|value| value * metres);
    Ok(Opening::of_ies(width, length, height, header.year <= 1995))
}

/// The ballast's factor, with that of ballast and lamp, which is a different thing in later versions.
fn ballast(header: &Header, numbers: &mut Numbers<'_>, notes: &mut Notes) -> Result<f64, PhotometryError> {
    let mut positive = |what: &str, notes: &mut Notes| match numbers.next(notes, what)? {
        (value, _) if value > 0.0 => Ok(value),
        (value, line) => {
            notes.warn(line, format!("{what} is {value}: read as 1"));
            Ok(1.0)
        }
    };
    let factor = positive("the ballast factor", notes)?;
    match header.year {
        ..2002 => Ok(factor * positive("the ballast-lamp photometric factor", notes)?),
        // 2002 keeps the place for later; from 2019 on it tells how the file was made, as 1.1 for a laboratory.
        year => {
            let what = if year >= 2019 { "the file generation type" } else { "the number for future use" };
            let (value, line) = numbers.next(notes, what)?;
            if year < 2019 && value != 1.0 {
                notes.warn(line, format!("{what} is {value} instead of 1: not applied"));
            }
            Ok(factor)
        }
    }
}

/// Candela values with all factors, and the line of the first.
fn candela(
    vertical: &[f64],
    horizontal: &[f64],
    factor: f64,
    numbers: &mut Numbers<'_>,
    notes: &mut Notes,
) -> Result<(Vec<f64>, usize), PhotometryError> {
    let (_, first_line) = numbers.left();
    let count = vertical.len() * horizontal.len();
    let mut candela = Vec::new();
    let mut negative: Option<(usize, usize)> = None;
    for (column, h) in horizontal.iter().enumerate() {
        for (row, v) in vertical.iter().enumerate() {
            let place = column * vertical.len() + row + 1;
            // Words are put together only where they are needed.
            let (value, line) = match numbers.next(notes, "") {
                Err(PhotometryError::Malformed { file, line, found, .. }) => {
                    let expected = format!("candela value {place} of {count} (vertical {v}, horizontal {h})");
                    return Err(PhotometryError::Malformed { file, line, expected, found });
                }
                other => other?,
            };
            let value = value * factor;
            if value.is_nan() || value > MOST_CANDELA {
                let expected =
                    format!("candela value {place} of {count} of at most {MOST_CANDELA:e}, with all factors");
                return Err(notes.error(line, &expected, format!("'{value:e}'")));
            }
            if value < 0.0 {
                negative = Some(negative.map_or((line, 1), |(first, many)| (first, many + 1)));
            }
            candela.push(value.max(0.0));
        }
    }
    if let Some((line, many)) = negative {
        notes.warn(line, format!("candela values below 0, the first of {many} here: read as 0"));
    }
    Ok((candela, first_line))
}
