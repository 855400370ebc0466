//! EULUMDAT: lines come in, a [`Photometry`] comes out. Its first 26 lines have their meaning by their number; numbers
//! follow. Source: the description of A. Stockmar (1990).

use crate::error::PhotometryError;
use crate::opening::Opening;
use crate::photometry::{Format, LampSet, MOST_CANDELA, Photometry, Tilt};
use crate::text::{Notes, Numbers, clean, count_of, count_words, number, shown};
use crate::web::{Kind, Table, Web};

/// Metres per millimetre.
const MILLIMETRE: f64 = 1e-3;

/// How far stated and integrated light output may be apart before a warning, relative.
const OUTPUT_SLACK: f64 = 0.05;

/// How far a plane may be from where its symmetry wants it, degrees.
const PLANE_SLACK: f64 = 0.5;

/// What line 3 holds.
const SYMMETRIES: &str = "the symmetry, 0 to 4";

/// Whether lines 2 to 7 hold numbers, as they do in EULUMDAT.
pub(crate) fn looks_like(lines: &[&str]) -> bool {
    lines.len() > 26 && lines[1..7].iter().all(|line| number(&line.trim().replace(',', ".")).is_some())
}

/// Lines that are taken one by one.
struct Fields<'a, 'b> {
    lines: &'b [&'a str],
    next: usize,
}

impl<'a> Fields<'a, '_> {
    /// The next line as it is, and its number.
    fn line(&mut self, notes: &Notes, what: &str) -> Result<(&'a str, usize), PhotometryError> {
        let Some(line) = self.lines.get(self.next) else {
            return Err(notes.error(self.lines.len(), what, "the end of the file"));
        };
        self.next += 1;
        Ok((line.trim(), self.next))
    }

    fn text(&mut self, notes: &Notes, what: &str) -> Result<String, PhotometryError> {
        Ok(clean(self.line(notes, what)?.0))
    }

    /// A number that has to be there.
    fn number(&mut self, notes: &Notes, what: &str) -> Result<(f64, usize), PhotometryError> {
        let (text, line) = self.line(notes, what)?;
        let first = text.split_whitespace().next().unwrap_or_default();
        match number(&first.trim_end_matches([',', ';']).replace(',', ".")) {
            Some(value) => Ok((value, line)),
            None => Err(notes.error(line, what, shown(text))),
        }
    }

    /// A number that may be left blank, or be something else: then it is `otherwise`, with a warning.
    fn number_or(&mut self, notes: &mut Notes, what: &str, otherwise: f64) -> Result<(f64, usize), PhotometryError> {
        let (text, line) = self.line(notes, what)?;
        self.next -= 1;
        match self.number(notes, what) {
            Ok(found) => Ok(found),
            Err(_) => {
                notes.warn(line, format!("{what} is {}: read as {otherwise}", shown(text)));
                self.next += 1;
                Ok((otherwise, line))
            }
        }
    }

    fn count(&mut self, notes: &Notes, what: &str, least: usize) -> Result<(usize, usize), PhotometryError> {
        let what = count_words(what, least);
        let (value, line) = self.number(notes, &what)?;
        let count = count_of(value, least).ok_or_else(|| notes.error(line, &what, format!("'{value}'")))?;
        Ok((count, line))
    }
}

pub(crate) fn read(lines: &[&str], notes: &mut Notes) -> Result<Photometry, PhotometryError> {
    let mut fields = Fields { lines, next: 0 };
    let manufacturer = fields.text(notes, "the company")?;
    let (_, _) = fields.number_or(notes, "the type of the luminaire", 1.0)?;
    let (symmetry, symmetry_line) = fields.number(notes, SYMMETRIES)?;
    let symmetry = match symmetry {
        0.0 | 1.0 | 2.0 | 3.0 | 4.0 => symmetry as usize,
        other => return Err(notes.error(symmetry_line, SYMMETRIES, format!("'{other}'"))),
    };
    let (planes, planes_line) = fields.count(notes, "the number of C-planes", 1)?;
    fields.number_or(notes, "the distance between C-planes", 0.0)?;
    let divisor = match symmetry {
        2 => 2,
        3 | 4 => 4,
        _ => 1,
    };
    if planes % divisor != 0 {
        let expected = format!("a number of C-planes that {divisor} divides (symmetry {symmetry})");
        return Err(notes.error(planes_line, &expected, format!("'{planes}'")));
    }
    let (gammas, _) = fields.count(notes, "the number of gamma angles", 2)?;
    fields.number_or(notes, "the distance between gamma angles", 0.0)?;
    let mut keywords = Vec::new();
    let report = fields.text(notes, "the number of the measurement")?;
    let luminaire = fields.text(notes, "the name of the luminaire")?;
    let catalogue = fields.text(notes, "the number of the luminaire")?;
    let file_name = fields.text(notes, "the name of the file")?;
    let date = fields.text(notes, "the date")?;
    keywords.extend([("REPORT", report), ("FILE", file_name), ("DATE", date)].map(|(key, value)| (key.into(), value)));
    for what in ["the length of the luminaire", "the width of the luminaire", "the height of the luminaire"] {
        fields.number_or(notes, what, 0.0)?;
    }
    let (length, _) = fields.number_or(notes, "the length of the luminous area", 0.0)?;
    let (width, _) = fields.number_or(notes, "the width of the luminous area", 0.0)?;
    let mut height = 0.0_f64;
    for plane in [0, 90, 180, 270] {
        height = height.max(fields.number_or(notes, &format!("the height of the luminous area at C{plane}"), 0.0)?.0);
    }
    let (down, down_line) = fields.number_or(notes, "the downward flux fraction", 0.0)?;
    let (output, output_line) = fields.number_or(notes, "the light output ratio of the luminaire", 0.0)?;
    let (mut conversion, conversion_line) = fields.number_or(notes, "the conversion factor", 1.0)?;
    if conversion <= 0.0 {
        notes.warn(conversion_line, format!("the conversion factor is {conversion}: read as 1"));
        conversion = 1.0;
    }
    let (tilt, tilt_line) = fields.number_or(notes, "the tilt of the luminaire", 0.0)?;
    if tilt != 0.0 {
        notes.warn(tilt_line, format!("the luminaire was measured with a tilt of {tilt} degrees: not turned back"));
    }
    let (lamps, absolute, lumens) = lamp_sets(&mut fields, notes)?;

    let mut numbers = Numbers::new(lines, fields.next, true);
    for index in 1..=10 {
        numbers.next(notes, &format!("direct ratio {index} of 10"))?;
    }
    let (c_planes, c_lines) = numbers.angles(notes, "C", planes, (-360.0, 720.0))?;
    let (vertical, gamma_lines) = numbers.angles(notes, "gamma", gammas, (0.0, 180.0))?;
    let horizontal = stored(symmetry, &c_planes);
    expect_planes(symmetry, &horizontal, c_lines[planes - 1], notes)?;
    let candela = intensities(&vertical, &horizontal, conversion * lumens / 1000.0, &mut numbers, notes)?;
    let values_line = numbers.left().1;
    numbers.finish(notes);

    // A plane that stands for all is C0, whatever the list begins with.
    let (web, [above, around]) = Web::new(Table { kind: Kind::C, vertical, horizontal, candela })
        .map_err(|(expected, found)| notes.error(c_lines[planes - 1], &expected.replace("horizontal", "C"), found))?;
    if let Some(note) = above {
        notes.warn(gamma_lines[gammas - 1], note.replace("vertical", "gamma"));
    }
    // That the first plane closes the circle is the format's rule.
    if let Some(note) = around.filter(|note| !note.ends_with("closes the circle")) {
        notes.warn(c_lines[planes - 1], note.replace("horizontal", "C"));
    }

    let stated_lumens = (output > 0.0).then_some(lumens * output / 100.0).filter(|lumens| lumens.is_finite());
    let flux = web.flux();
    if flux <= 0.0 {
        notes.warn(values_line, "every intensity is 0: no light");
    } else if let Some(stated) = stated_lumens.filter(|&stated| (flux / stated - 1.0).abs() > OUTPUT_SLACK) {
        let ratio = 100.0 * flux / lumens;
        let made = format!("the intensities make {ratio:.1} %: {flux:.1} lm, not {stated:.1}");
        notes.warn(output_line, format!("the light output ratio is {output} %, {made}"));
    }
    let is_down = 100.0 * web.flux_down() / flux;
    if flux > 0.0 && down > 0.0 && (is_down - down).abs() > 100.0 * OUTPUT_SLACK {
        notes.warn(down_line, format!("the downward flux fraction is {down} %, the intensities make {is_down:.1} %"));
    }
    let opening = Opening::of_ldt(length * MILLIMETRE, width * MILLIMETRE, height * MILLIMETRE);
    notes.warnings.sort_by_key(|warning| warning.line);
    Ok(Photometry {
        file: notes.file.clone(),
        format: Format::Eulumdat,
        luminaire,
        catalogue,
        manufacturer,
        absolute,
        lamp_lumens: Some(lumens),
        stated_lumens,
        watts: lamps.first().and_then(|set| set.watts),
        lamps,
        opening,
        tilt: if tilt == 0.0 { Tilt::None } else { Tilt::Measured(tilt) },
        keywords,
        web,
        warnings: std::mem::take(&mut notes.warnings),
    })
}

/// The sets of lamps, whether photometry is absolute, and the flux of the first set.
fn lamp_sets(fields: &mut Fields<'_, '_>, notes: &mut Notes) -> Result<(Vec<LampSet>, bool, f64), PhotometryError> {
    let (count, count_line) = fields.count(notes, "the number of sets of lamps", 1)?;
    let (mut sets, mut absolute, mut first) = (Vec::new(), false, 0.0);
    for set in 1..=count {
        let (lamps, _) = fields.number(notes, &format!("the number of lamps of set {set}"))?;
        let name = fields.text(notes, &format!("the type of the lamps of set {set}"))?;
        let (lumens, line) = fields.number(notes, &format!("the flux of the lamps of set {set}"))?;
        let colour = fields.text(notes, &format!("the colour of the lamps of set {set}"))?;
        let rendering = fields.text(notes, &format!("the colour rendering of set {set}"))?;
        let (watts, _) = fields.number_or(notes, &format!("the power of set {set}"), 0.0)?;
        if set == 1 {
            if lumens <= 0.0 {
                // Intensities are per 1000 lm of it.
                return Err(notes.error(line, "the flux of the lamps of set 1, above 0", format!("'{lumens}'")));
            }
            (absolute, first) = (lamps < 0.0, lumens);
        }
        let watts = (watts > 0.0).then_some(watts);
        sets.push(LampSet { count: lamps.abs(), name, lumens: Some(lumens), watts, colour, rendering });
    }
    if count > 1 {
        notes.warn(count_line, format!("{count} sets of lamps: the first one is taken, the others are alternatives"));
    }
    Ok((sets, absolute, first))
}

/// The C-planes whose intensities the file has, ascending: which depends on the symmetry, and their number with it.
fn stored(symmetry: usize, planes: &[f64]) -> Vec<f64> {
    let count = planes.len();
    match symmetry {
        1 => vec![0.0],
        2 => planes[..=count / 2].to_vec(),
        // From C270 over C0 to C90.
        3 => {
            let turn = |plane: usize| if plane < count { 0.0 } else { 360.0 };
            let from = 3 * count / 4;
            (from..=from + count / 2).map(|plane| planes[plane % count] + turn(plane)).collect()
        }
        4 => planes[..=count / 4].to_vec(),
        _ => planes.to_vec(),
    }
}

/// Planes that a symmetry mirrors have to begin and end at its mirrors.
fn expect_planes(symmetry: usize, planes: &[f64], line: usize, notes: &Notes) -> Result<(), PhotometryError> {
    let (begin, end) = match symmetry {
        2 => (0.0, 180.0),
        3 => (270.0, 450.0),
        4 => (0.0, 90.0),
        _ => return Ok(()),
    };
    let (first, last) = (planes[0], planes[planes.len() - 1]);
    if (first - begin).abs() > PLANE_SLACK || (last - end).abs() > PLANE_SLACK {
        let expected = format!("C-planes of which those of symmetry {symmetry} go from {begin} to {end}");
        return Err(notes.error(line, &expected, format!("{first} to {last}")));
    }
    Ok(())
}

/// Candela of all planes that are stored.
fn intensities(
    vertical: &[f64],
    horizontal: &[f64],
    factor: f64,
    numbers: &mut Numbers<'_>,
    notes: &mut Notes,
) -> Result<Vec<f64>, PhotometryError> {
    let count = vertical.len() * horizontal.len();
    let mut candela = Vec::new();
    let mut negative: Option<(usize, usize)> = None;
    for (column, plane) in horizontal.iter().enumerate() {
        for (row, gamma) in vertical.iter().enumerate() {
            let place = column * vertical.len() + row + 1;
            let (value, line) = match numbers.next(notes, "") {
                Err(PhotometryError::Malformed { file, line, found, .. }) => {
                    let expected = format!("intensity {place} of {count} (plane C{plane}, gamma {gamma})");
                    return Err(PhotometryError::Malformed { file, line, expected, found });
                }
                other => other?,
            };
            let value = value * factor;
            if value.is_nan() || value > MOST_CANDELA {
                let expected = format!("intensity {place} of {count} of at most {MOST_CANDELA:e} cd, with all factors");
                return Err(notes.error(line, &expected, format!("'{value:e}'")));
            }
            if value < 0.0 {
                negative = Some(negative.map_or((line, 1), |(first, many)| (first, many + 1)));
            }
            candela.push(value.max(0.0));
        }
    }
    if let Some((line, many)) = negative {
        notes.warn(line, format!("intensities below 0, the first of {many} here: read as 0"));
    }
    Ok(candela)
}
