//! The files of `tests/files`: what is read of each, whether its flux is the one it was made from, and that nothing
//! that may stand in a file makes the reader panic.

#![allow(clippy::unwrap_used, reason = "tests")]

use isolux_photometry::{Format, Kind, MAX_BYTES, OpeningShape, Photometry, Symmetry, Tilt, parse, read};
use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files")
}

/// Bytes of all photometric files by name, in order.
fn all_files() -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| matches!(path.extension().and_then(|ending| ending.to_str()), Some("ies" | "ldt")))
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()))
        .collect();
    files.sort();
    files
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(folder().join(name)).unwrap()
}

fn sound(name: &str) -> Photometry {
    parse(&bytes(name), name).unwrap()
}

/// What a file is, the flux it was made of, and its warnings.
type Row = (&'static str, Format, Kind, Symmetry, f64, &'static [&'static str]);

const SOUND: &[Row] = &[
    ("ies-1986.ies", Format::Ies(1986), Kind::C, Symmetry::Rotational, 1800.0, &[]),
    ("ies-1991.ies", Format::Ies(1991), Kind::C, Symmetry::Quadrants, 1000.0, &[]),
    ("ies-1995-across.ies", Format::Ies(1995), Kind::C, Symmetry::Plane90, 1000.0, &[]),
    (
        "ies-1995-tilt.ies",
        Format::Ies(1995),
        Kind::C,
        Symmetry::Plane0,
        1000.0,
        &["line 6: 3 tilt factors are read and not applied: the lamp is taken as untilted"],
    ),
    ("ies-2002-full.ies", Format::Ies(2002), Kind::C, Symmetry::None, 1000.0, &[]),
    ("ies-2002-absolute.ies", Format::Ies(2002), Kind::C, Symmetry::Rotational, 2500.0, &[]),
    ("ies-2019-generation.ies", Format::Ies(2019), Kind::C, Symmetry::Rotational, 2850.0, &[]),
    ("ies-2002-up.ies", Format::Ies(2002), Kind::C, Symmetry::Rotational, 1000.0, &[]),
    ("ies-2002-isotropic.ies", Format::Ies(2002), Kind::C, Symmetry::Rotational, 1000.0, &[]),
    ("type-a.ies", Format::Ies(2002), Kind::A, Symmetry::None, 1000.0, &[]),
    ("type-b.ies", Format::Ies(2002), Kind::B, Symmetry::None, 1000.0, &[]),
    ("type-c.ies", Format::Ies(2002), Kind::C, Symmetry::None, 1000.0, &[]),
    (
        "type-b-mirrored.ies",
        Format::Ies(2002),
        Kind::B,
        Symmetry::Quadrants,
        1000.0,
        &["line 9: vertical angles begin at 0: mirrored below the axis"],
    ),
    ("bom-crlf.ies", Format::Ies(2002), Kind::C, Symmetry::Rotational, 1000.0, &[]),
    ("latin1-cr.ies", Format::Ies(2002), Kind::C, Symmetry::Rotational, 1000.0, &[]),
    ("split-anywhere.ies", Format::Ies(2002), Kind::C, Symmetry::Quadrants, 1000.0, &[]),
    ("scientific.ies", Format::Ies(2002), Kind::C, Symmetry::Rotational, 1e5, &[]),
    (
        "no-version.ies",
        Format::Ies(1986),
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 1: no line names the version, though there are keywords: read as LM-63-1986"],
    ),
    (
        "unknown-version.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 1: version 'IESNA:LM-63-2047' is not known: read as LM-63-2002"],
    ),
    (
        "middle-of-zones.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 10: vertical angles begin at 2.5: the first row stands for 0, too; \
            angles end at 87.5: the last row stands for 90, too"],
    ),
    (
        "narrow-range.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 10: vertical angles end at 40: dark beyond"],
    ),
    (
        "open-circle.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::None,
        1000.0,
        &["line 11: horizontal angles end at 345: the first one closes the circle"],
    ),
    (
        "eighth.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Other,
        1000.0,
        &["line 10: horizontal angles 0 to 45 are mirrored until they fill the circle"],
    ),
    (
        "negative-candela.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Quadrants,
        1000.0,
        &["line 16: candela values below 0, the first of 1 here: read as 0"],
    ),
    (
        "trailing.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 14: 5 more words after the last value, from '1': ignored"],
    ),
    (
        "tilt-file.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 6: tilt factors in file 'Lamp.tlt' are not read"],
    ),
    (
        "too-bright.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        1500.0,
        &["line 7: the lamps give 1000.0 lm, and the candela values make 1499.0 lm"],
    ),
    (
        "wrong-lumens.ies",
        Format::Ies(2002),
        Kind::C,
        Symmetry::Rotational,
        2500.0,
        &["line 5: _ABSOLUTELUMENS are 250.0 lm, and the candela values make 2503.2 lm"],
    ),
    ("isym0.ldt", Format::Eulumdat, Kind::C, Symmetry::None, 1000.0, &[]),
    ("isym1.ldt", Format::Eulumdat, Kind::C, Symmetry::Rotational, 1000.0, &[]),
    ("isym2.ldt", Format::Eulumdat, Kind::C, Symmetry::Plane0, 2400.0, &[]),
    ("isym3.ldt", Format::Eulumdat, Kind::C, Symmetry::Plane90, 2100.0, &[]),
    ("isym4.ldt", Format::Eulumdat, Kind::C, Symmetry::Quadrants, 1000.0, &[]),
    ("absolute.ldt", Format::Eulumdat, Kind::C, Symmetry::Rotational, 4200.0, &[]),
    (
        "decimal-commas.ldt",
        Format::Eulumdat,
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &[
            "line 25: the luminaire was measured with a tilt of 15 degrees: not turned back",
            "line 26: 2 sets of lamps: the first one is taken, the others are alternatives",
        ],
    ),
    (
        "latin1.ldt",
        Format::Eulumdat,
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 119: 2 more words after the last value, from 'trailing': ignored"],
    ),
    (
        "wrong-ratio.ldt",
        Format::Eulumdat,
        Kind::C,
        Symmetry::Rotational,
        1000.0,
        &["line 23: the light output ratio is 60 %, the intensities make 100.0 %: 1000.0 lm, not 600.0"],
    ),
];

const BROKEN: &[(&str, &str)] = &[
    (
        "broken-short.ies",
        "line 15: expected candela value 38 of 38 (vertical 90, horizontal 90), found the end of the file",
    ),
    ("broken-word.ies", "line 16: expected candela value 38 of 38 (vertical 90, horizontal 90), found 'abc'"),
    ("broken-descending.ies", "line 9: expected vertical angle 3 of 4 above 10 (angles ascend), found '5'"),
    ("broken-duplicate.ies", "line 10: expected horizontal angle 3 of 3 above 90 (angles ascend), found '90'"),
    ("broken-range.ies", "line 10: expected horizontal angles up to 90, 180 or 360, found 0 to 130"),
    ("broken-no-tilt.ies", "line 15: expected a line 'TILT=', found the end of the file"),
    (
        "broken-counts.ies",
        "line 7: expected the number of vertical angles (a whole number from 2 to 36001), found '99999999'",
    ),
    ("broken-type.ies", "line 7: expected the photometric type: 1 (C), 2 (B) or 3 (A), found '7'"),
    ("broken-empty.ies", "line 1: expected a line 'TILT=', found the end of the file"),
    ("broken-short.ldt", "line 331: expected intensity 247 of 247 (plane C180, gamma 90), found the end of the file"),
    ("broken-head.ldt", "line 20: expected the height of the luminous area at C270, found the end of the file"),
    ("broken-symmetry.ldt", "line 3: expected the symmetry, 0 to 4, found '9'"),
    ("broken-planes.ldt", "line 4: expected a number of C-planes that 4 divides (symmetry 4), found '22'"),
    ("broken-flux.ldt", "line 29: expected the flux of the lamps of set 1, above 0, found '0'"),
    ("broken-binary.ldt", "line 3: expected the symmetry, 0 to 4, found the end of the file"),
];

/// Catches a file without expectations.
#[test]
fn every_file_is_expected() {
    let mut expected: Vec<&str> = SOUND.iter().map(|row| row.0).chain(BROKEN.iter().map(|row| row.0)).collect();
    expected.sort_unstable();
    assert_eq!(all_files().iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), expected);
}

/// Catches a factor that is left out or applied twice, symmetry that is counted wrongly, and warnings that are lost,
/// wrong or invented.
#[test]
fn sound_files_give_their_flux() {
    for (name, format, kind, symmetry, flux, warnings) in SOUND {
        let found = read(&folder().join(name)).unwrap();
        assert_eq!((found.format, found.web.kind(), found.web.symmetry()), (*format, *kind, *symmetry), "{name}");
        // Tables of 5 degrees miss 0.06 to 0.5 % of these lobes.
        assert!((found.flux() / flux - 1.0).abs() < 0.01, "{name}: {} lm", found.flux());
        let file = folder().join(name).display().to_string();
        let said: Vec<String> = found.warnings.iter().map(ToString::to_string).collect();
        let wanted: Vec<String> = warnings.iter().map(|warning| format!("{file}: {warning}")).collect();
        assert_eq!(said, wanted);
    }
}

/// Catches a broken file that is accepted, and an error without its place.
#[test]
fn broken_files_are_refused_by_line() {
    for (name, message) in BROKEN {
        let error = parse(&bytes(name), name).unwrap_err();
        assert_eq!(error.to_string(), format!("{name}: {message}"));
    }
    let missing = read(&folder().join("missing.ies")).unwrap_err().to_string();
    assert!(missing.ends_with("missing.ies: cannot be read: no such file"), "{missing}");
    let directory = read(&folder()).unwrap_err().to_string();
    assert!(directory.ends_with("files: cannot be read: it is not a regular file"), "{directory}");
    let long = parse(&vec![b' '; MAX_BYTES as usize + 1], "long.ies").unwrap_err().to_string();
    assert_eq!(long, "long.ies: has 16777217 bytes, more than the 16777216 that are read");
    let unknown = parse(b"solid cube\nfacet\n", "cube.stl").unwrap_err().to_string();
    assert_eq!(
        unknown,
        "cube.stl: line 1: expected an IES file (with a line 'TILT=') or an EULUMDAT file, found 'solid cube'"
    );
}

/// The batwing of `make.py` for 1 lm: `u² (1 + 4 s²) (1 + a x + b y + c (x² - y²))`.
fn batwing([x, y, z]: [f64; 3], along: f64, across: f64, quadrants: f64) -> f64 {
    let u = (-z).max(0.0);
    let shape = u * u * (1.0 + 4.0 * (1.0 - u * u));
    shape * (1.0 + along * x + across * y + quadrants * (x * x - y * y)) / (TAU * 13.0 / 15.0)
}

/// Catches planes that are mirrored or turned the wrong way: all around, at the angles of the table, intensities are
/// those of the formula that the file was made of.
#[test]
fn symmetry_is_made_good() {
    let rows = [
        ("ies-1991.ies", 1000.0, 0.0, 0.0, 0.5),
        ("ies-1995-across.ies", 1000.0, 0.0, 0.5, 0.0),
        ("ies-1995-tilt.ies", 1000.0, 0.5, 0.0, 0.0),
        ("ies-2002-full.ies", 1000.0, 0.4, 0.3, 0.0),
        ("open-circle.ies", 1000.0, 0.4, 0.3, 0.0),
        ("isym0.ldt", 1000.0, 0.4, 0.3, 0.0),
        ("isym2.ldt", 2400.0, 0.5, 0.0, 0.0),
        ("isym3.ldt", 2100.0, 0.0, 0.5, 0.0),
        ("isym4.ldt", 1000.0, 0.0, 0.0, 0.5),
    ];
    for (name, flux, along, across, quadrants) in rows {
        let found = sound(name);
        for v in 0..18 {
            for h in 0..24 {
                let (sin_v, cos_v) = (5.0 * f64::from(v)).to_radians().sin_cos();
                let (sin_h, cos_h) = (15.0 * f64::from(h)).to_radians().sin_cos();
                let direction = [sin_v * cos_h, sin_v * sin_h, -cos_v];
                let wanted = flux * batwing(direction, along, across, quadrants);
                // Six digits are printed; of values down to a thousandth of the peak.
                let error = (found.intensity(direction) - wanted).abs();
                assert!(error < 1e-5 * wanted + 1e-3, "{name} {v} {h}: {} {wanted}", found.intensity(direction));
            }
        }
        assert_eq!(found.intensity([0.3, 0.2, 0.5]), 0.0, "{name}");
    }
}

/// Catches a type whose angles are read in another's frame: one floodlight, skewed to +X and +Y, in three tables.
#[test]
fn all_types_have_one_light() {
    let tables = ["type-a.ies", "type-b.ies", "type-c.ies"].map(sound);
    let mut state = 7;
    for _ in 0..2000 {
        let z = 2.0 * uniform(&mut state) - 1.0;
        let (sin, cos) = (TAU * uniform(&mut state)).sin_cos();
        let side = (1.0 - z * z).sqrt();
        let [x, y, z] = [side * cos, side * sin, z];
        let wanted = 1000.0 * (-z).max(0.0).powi(3) * (1.0 + 0.6 * x + 0.3 * y) / (TAU / 4.0);
        for table in &tables {
            // Linear between rows of 5 degrees: 0.0873^2 / 8 times second derivatives that add up to 7 x 637 cd.
            let error = (table.intensity([x, y, z]) - wanted).abs();
            assert!(error < 4.3, "{:?} {x} {y} {z}: {error}", table.web.kind());
        }
    }
    for table in &tables {
        assert_eq!(table.downward(), Some(1.0));
        let [along, across] = table.beam();
        // 70.4 and 73.7 degrees; the skew along X is the stronger one.
        assert!((along.unwrap() - 70.4).abs() < 0.1 && (across.unwrap() - 73.7).abs() < 0.1);
    }
}

/// Catches a light that depends on the azimuth where one plane stands for all, and a wrong width of known lobes.
#[test]
fn rotational_lights_are_round() {
    for (name, power) in [("bom-crlf.ies", 1), ("isym1.ldt", 1), ("ies-2002-absolute.ies", 8), ("absolute.ldt", 4)] {
        let found = sound(name);
        for tilt in [0.1, 0.7, 1.4_f64] {
            let (side, down) = tilt.sin_cos();
            let here = found.intensity([side, 0.0, -down]);
            for turn in 1..12 {
                let (sin, cos) = f64::from(turn).sin_cos();
                let there = found.intensity([side * cos, side * sin, -down]);
                // The angle from the nadir is found with an error of 1e-14.
                assert!((there - here).abs() < 1e-9, "{name}");
            }
        }
        let half = 2.0 * 0.5_f64.powf(1.0 / f64::from(power)).acos().to_degrees();
        let [along, across] = found.beam();
        assert_eq!(along, across);
        // A tenth of a degree: what a line between rows of 5 degrees misses.
        assert!((along.unwrap() - half).abs() < 0.1, "{name}: {along:?} {half}");
    }
}

/// Catches another way of writing the same file that is read differently.
#[test]
fn writing_makes_no_difference() {
    let plain = sound("bom-crlf.ies");
    assert_eq!(plain.luminaire, "Test luminaire");
    let latin = sound("latin1-cr.ies");
    assert_eq!((latin.luminaire.as_str(), latin.manufacturer.as_str()), ("Düse 40°", "Lüster & Söhne"));
    assert_eq!(plain.web, latin.web);
    let split = sound("split-anywhere.ies");
    let rows = plain.web.vertical().len();
    assert_eq!(split.web.candela()[..rows], *plain.web.candela());
    assert_eq!(split.web.candela()[rows..], *plain.web.candela());
    assert_eq!(sound("scientific.ies").lamp_lumens, Some(1e5));
    assert_eq!(sound("latin1.ldt").manufacturer, "Lüster");
    let wide: Vec<u8> = [0xFF, 0xFE]
        .into_iter()
        .chain(String::from_utf8(bytes("trailing.ies")).unwrap().encode_utf16().flat_map(u16::to_le_bytes))
        .collect();
    assert_eq!(parse(&wide, "trailing.ies").unwrap(), sound("trailing.ies"));
}

/// Catches facts of the file that are lost, or land in another field.
#[test]
fn facts_are_kept() {
    let old = sound("ies-1986.ies");
    assert_eq!(old.luminaire, "Made-up trough two lamps");
    assert_eq!((old.lamps[0].count, old.lamps[0].lumens, old.lamp_lumens), (2.0, Some(2000.0), Some(1800.0)));
    assert_eq!((old.opening.shape, old.opening.size), (OpeningShape::Rectangle, [4.0 * 0.3048, 0.3048, 0.0]));
    assert_eq!((old.watts, old.absolute, old.stated_lumens), (Some(10.0), false, None));
    assert!((old.output_ratio().unwrap() - 1.0).abs() < 0.01);

    let absolute = sound("ies-2002-absolute.ies");
    assert!(absolute.absolute);
    assert_eq!((absolute.lamp_lumens, absolute.stated_lumens, absolute.output_ratio()), (None, Some(2500.0), None));
    assert_eq!(absolute.opening.shape, OpeningShape::Disc);

    let late = sound("no-version.ies");
    assert_eq!(late.luminaire, "Named late and at length");
    assert_eq!(late.lamps[0].colour, "4000");
    assert_eq!(late.keywords.len(), 3);

    let tilted = Tilt::Included { geometry: 1, angles: vec![0.0, 45.0, 90.0], factors: vec![1.0, 0.95, 0.9] };
    assert_eq!(sound("ies-1995-tilt.ies").tilt, tilted);
    assert_eq!(sound("tilt-file.ies").tilt, Tilt::File("Lamp.tlt".into()));

    let two = sound("isym2.ldt");
    assert_eq!((two.lamps[0].count, two.lamp_lumens, two.stated_lumens), (2.0, Some(3000.0), Some(2400.0)));
    assert!((two.output_ratio().unwrap() - 0.8).abs() < 0.008);
    assert_eq!((two.opening.shape, two.opening.size), (OpeningShape::Rectangle, [0.3, 0.6, 0.0]));
    assert_eq!(sound("isym1.ldt").opening.shape, OpeningShape::VerticalCylinder);
    let both = sound("decimal-commas.ldt");
    assert_eq!((both.watts, both.lamps[1].watts), (Some(12.5), Some(5.5)));
    assert_eq!(both.tilt, Tilt::Measured(15.0));
    let fixed = sound("absolute.ldt");
    assert!(fixed.absolute);
    assert_eq!((fixed.lamps[0].count, fixed.stated_lumens), (1.0, Some(4200.0)));
}

/// Catches shares of the flux that are taken from the wrong side, and peaks in the wrong place.
#[test]
fn light_goes_where_it_goes() {
    let up = sound("ies-2002-up.ies");
    assert_eq!((up.downward(), up.upward()), (Some(0.0), Some(1.0)));
    assert!((up.intensity([0.0, 0.0, 1.0]) - 1000.0 / PI).abs() < 1e-3);
    assert_eq!((up.web.peak().vertical, up.web.peak().direction[2]), (180.0, 1.0));
    // 120 degrees about the zenith; rows hold six digits.
    assert!((up.beam()[0].unwrap() - 120.0).abs() < 1e-3);
    let even = sound("ies-2002-isotropic.ies");
    assert!((even.downward().unwrap() - 0.5).abs() < 1e-12);
    assert!((even.intensity([0.3, -0.4, 0.1]) - 1000.0 / (4.0 * PI)).abs() < 1e-3);
    let aside = sound("ies-1995-tilt.ies").web.peak();
    assert!(aside.direction[0] > 0.4 && aside.direction[1].abs() < 1e-12, "{aside:?}");
    let across = sound("isym3.ldt").web.peak();
    assert!(across.direction[1] > 0.4 && across.direction[0].abs() < 1e-12, "{across:?}");
}

/// Catches a scale that is applied twice (candela squared), or not to everything.
#[test]
fn scaling_is_linear() {
    let plain = sound("isym2.ldt");
    let scaled = plain.with_flux(5000.0).unwrap();
    let factor = 5000.0 / plain.flux();
    // Rounding of one product and a sum.
    assert!((scaled.flux() - 5000.0).abs() < 1e-9);
    assert!((scaled.lamp_lumens.unwrap() / (3000.0 * factor) - 1.0).abs() < 1e-15);
    let direction = [0.3, 0.1, -0.8];
    assert!((scaled.intensity(direction) / plain.intensity(direction) / factor - 1.0).abs() < 1e-12);
    assert_eq!(plain.with_flux(0.0).unwrap().flux(), 0.0);
    for lumens in [-1.0, f64::NAN, f64::INFINITY, 1e300] {
        let error = plain.with_flux(lumens).unwrap_err().to_string();
        assert!(error.starts_with("isym2.ldt: cannot be scaled to "), "{error}");
    }
    assert!(plain.with_flux(0.0).unwrap().with_flux(1.0).is_err());
}

/// A number in [0, 1), the same in every run (xorshift64*).
fn uniform(state: &mut u64) -> f64 {
    (next(state) >> 11) as f64 / (1_u64 << 53) as f64
}

fn next(state: &mut u64) -> u64 {
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    state.wrapping_mul(0x2545_F491_4F6C_DD1D)
}

/// One damage to a file: what disks, editors and other programs do, and numbers that no luminaire has.
fn damage(bytes: &mut Vec<u8>, state: &mut u64) {
    const WORDS: &[&str] = &[
        "0",
        "-1",
        "1e308",
        "-1e308",
        "1e-320",
        "nan",
        "inf",
        "99999999999",
        "0.5",
        "360",
        "180",
        "90",
        "\n",
        "\r",
        " ",
        ",",
        "\u{0}",
        "\u{1A}",
        "TILT=",
        "TILT=INCLUDE",
        "[",
        "]",
        "ü",
        "1.1.1",
        "1,5",
        "2147483648",
    ];
    let at = |state: &mut u64, length: usize| (next(state) % (length as u64 + 1)) as usize;
    let place = at(state, bytes.len());
    match next(state) % 6 {
        0 if !bytes.is_empty() => {
            let place = place.min(bytes.len() - 1);
            bytes[place] = next(state) as u8;
        }
        1 => bytes.truncate(place),
        2 => {
            let end = (place + at(state, 12)).min(bytes.len());
            bytes.drain(place..end);
        }
        3 => {
            let word = WORDS[at(state, WORDS.len() - 1)];
            bytes.splice(place..place, word.bytes());
        }
        4 => {
            // A whole number becomes another one.
            let start = bytes[place..].iter().position(u8::is_ascii_digit).map_or(place, |found| place + found);
            let end = bytes[start..].iter().position(|byte| !byte.is_ascii_digit()).map_or(bytes.len(), |e| start + e);
            bytes.splice(start..end, WORDS[at(state, WORDS.len() - 1)].bytes());
        }
        _ => {
            let end = (place + at(state, 200)).min(bytes.len());
            let copy = bytes[place..end].to_vec();
            let target = at(state, bytes.len());
            bytes.splice(target..target, copy);
        }
    }
}

/// Catches a panic, an answer that is no number, and an error or warning that is not one line with its place, over
/// 300,000 damaged files.
#[test]
fn damaged_files_never_panic() {
    let files = all_files();
    let rounds = 300_000 / files.len() + 1;
    let mut state = 20_261_123;
    let (mut read, mut refused) = (0, 0);
    for (name, original) in &files {
        for _ in 0..rounds {
            let mut bytes = original.clone();
            for _ in 0..1 + next(&mut state) % 3 {
                damage(&mut bytes, &mut state);
            }
            match parse(&bytes, name) {
                Ok(found) => {
                    read += 1;
                    assert!(found.flux() >= 0.0 && found.flux().is_finite(), "{name}");
                    assert!(found.downward().is_none_or(|share| (0.0..=1.0).contains(&share)));
                    for direction in [[0.0, 0.0, -1.0], [0.6, 0.1, -0.2], [-0.3, 0.8, 0.4], [0.0, -1.0, 0.0]] {
                        let candela = found.intensity(direction);
                        assert!(candela >= 0.0 && candela <= found.web.peak().candela * (1.0 + 1e-12), "{name}");
                    }
                    for width in [found.beam(), found.field()].concat().into_iter().flatten() {
                        assert!((0.0..=360.0).contains(&width), "{name}: {width}");
                    }
                    for warning in &found.warnings {
                        let text = warning.to_string();
                        assert!(text.starts_with(&format!("{name}: line ")) && !text.contains(['\n', '\r']), "{text}");
                    }
                }
                Err(error) => {
                    refused += 1;
                    let text = error.to_string();
                    assert!(text.starts_with(&format!("{name}: line ")) && !text.contains(['\n', '\r']), "{text}");
                }
            }
        }
    }
    // Both ways are gone often, or the damage is of no use.
    assert!(read > 30_000 && refused > 30_000, "{read} read, {refused} refused");
}

/// Catches a file whose numbers are all right and far too many: the counts are bounded, and what they ask for is there.
#[test]
fn large_tables_are_read_and_larger_ones_refused() {
    let table = |verticals: usize, horizontals: usize| {
        let mut text = format!("TILT=NONE\n1 -1 1 {verticals} {horizontals} 1 2 0 0 0\n1 1 1\n");
        let list = |count: usize, end: f64| (0..count).map(move |i| end * i as f64 / (count as f64 - 1.0));
        for angle in list(verticals, 180.0).chain(list(horizontals, 15.0)) {
            text += &format!("{angle}\n");
        }
        text + &"1\n".repeat(verticals * horizontals)
    };
    let fine = parse(table(2, 36_001).as_bytes(), "fine.ies").unwrap();
    // Rounding of a million additions.
    assert!((fine.flux() - 4.0 * PI).abs() < 1e-9);
    assert_eq!(fine.web.symmetry(), Symmetry::Other);
    let finer = parse(table(2, 36_002).as_bytes(), "finer.ies").unwrap_err().to_string();
    let expected = "expected the number of horizontal angles (a whole number from 1 to 36001), found '36002'";
    assert_eq!(finer, format!("finer.ies: line 2: {expected}"));
}

/// Catches bytes that no file has: none, noise, and one value all through.
#[test]
fn noise_never_panics() {
    let mut state = 1;
    for length in 0..2000 {
        let noise: Vec<u8> = (0..length).map(|_| next(&mut state) as u8).collect();
        for name in ["noise.ies", "noise.ldt", "noise"] {
            assert!(parse(&noise, name).is_err());
        }
    }
    for byte in 0..=255 {
        for name in ["same.ies", "same.ldt", "same"] {
            assert!(parse(&[byte; 500], name).is_err());
        }
    }
}
