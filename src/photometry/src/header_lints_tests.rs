//! Sixty made-up files with one contradiction each, and files without any.

use crate::{Photometry, Problem, Severity, Tolerance, eulumdat, lm63};

/// A Lambertian table of 1000 cd: pi times as many lumens.
const FLUX_LM: f64 = 3141.6;

/// The parts of an LM-63 file; each file changes one of them.
#[derive(Clone)]
struct Lm63 {
    first: &'static str,
    header: String,
    lamps: &'static str,
    multiplier: &'static str,
    kind: &'static str,
    opening: &'static str,
    ballast: &'static str,
    vertical: Vec<f64>,
    horizontal: Vec<f64>,
    /// Candela of a horizontal and a vertical angle.
    candela: fn(f64, f64) -> f64,
}

fn lambertian(_: f64, gamma: f64) -> f64 {
    (1000.0 * gamma.to_radians().cos()).max(0.0)
}

/// Brighter towards C 0 by half.
fn lopsided(c: f64, gamma: f64) -> f64 {
    lambertian(c, gamma) * (1.0 + 0.5 * c.to_radians().cos() * gamma.to_radians().sin())
}

fn every(step: f64, first: f64, last: f64) -> Vec<f64> {
    (0..=((last - first) / step).round() as u32).map(|k| first + step * f64::from(k)).collect()
}

fn base() -> Lm63 {
    Lm63 {
        first: "IESNA:LM-63-2002",
        header: "[TEST] 1\n[TESTLAB] lab\n[ISSUEDATE] 2026-01-01\n[MANUFAC] maker".into(),
        lamps: "1 -1",
        multiplier: "1",
        kind: "1",
        opening: "2 0 0 0",
        ballast: "1 1 30",
        vertical: every(2.5, 0.0, 90.0),
        horizontal: vec![0.0],
        candela: lambertian,
    }
}

impl Lm63 {
    fn with(header: &str) -> Self {
        let base = base();
        Self { header: format!("{}\n{header}", base.header), ..base }
    }

    fn text(&self) -> String {
        let list = |numbers: &[f64]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        let rows =
            self.horizontal.iter().map(|h| self.vertical.iter().map(|v| (self.candela)(*h, *v)).collect::<Vec<_>>());
        let rows = rows.map(|row| list(&row)).collect::<Vec<_>>().join("\n");
        let (nv, nh) = (self.vertical.len(), self.horizontal.len());
        let Self { first, header, lamps, multiplier, kind, opening, ballast, .. } = self;
        let (vertical, horizontal) = (list(&self.vertical), list(&self.horizontal));
        format!(
            "{first}\n{header}\nTILT=NONE\n{lamps} {multiplier} {nv} {nh} {kind} {opening}\n{ballast}\n{vertical}\n\
             {horizontal}\n{rows}\n"
        )
    }

    fn read(&self) -> Photometry {
        lm63::parse(self.text().as_bytes()).unwrap()
    }
}

/// A EULUMDAT file of the same table; the lines from 1 on may be replaced.
fn ldt(changes: &[(usize, &str)]) -> String {
    let gammas = every(2.5, 0.0, 90.0);
    let mut lines: Vec<String> =
        ["maker", "1", "1", "1", "0", "37", "2.5", "1", "lamp", "1", "a.ldt", "2026"].map(Into::into).into();
    // Body and luminous area of 0.6 m, heights, DFF, LORL, factor, tilt.
    lines.extend(["600", "600", "50", "580", "580", "0", "0", "0", "0", "100", "78.5", "1", "0"].map(String::from));
    lines.extend(["1", "1", "LED", "4000", "840", "80", "30"].map(String::from));
    lines.extend((0..10).map(|_| "0".to_owned()));
    lines.push("0".into());
    lines.extend(gammas.iter().map(ToString::to_string));
    lines.extend(gammas.iter().map(|gamma| (lambertian(0.0, *gamma) / 4.0).to_string()));
    for (line, text) in changes {
        lines[line - 1] = (*text).into();
    }
    lines.join("\r\n")
}

/// The contradictory LM-63 files with their codes.
fn contradictory_lm63() -> Vec<(&'static str, Lm63)> {
    [contradictory_texts(), contradictory_records(), contradictory_planes()].concat()
}

/// Files of relative photometry with these lamps.
fn relative(lamps: &'static str, header: &str) -> Lm63 {
    Lm63 { lamps, ..Lm63::with(header) }
}

/// Files with a text that contradicts their numbers.
fn contradictory_texts() -> Vec<(&'static str, Lm63)> {
    let with = |code: &'static str, header: &str| (code, Lm63::with(header));
    let editions = ["IESNA91", "IESNA:LM-63-1995", "IES:LM-63-2019"];
    let mut all: Vec<(&'static str, Lm63)> = [
        "[_TOTALLUMINAIRELUMENS] 1570.8",
        "[_ABSOLUTELUMENS] 1570.8",
        "[LUMENS] 3800",
        "[_LUMINAIRE_LUMENS] 6283",
        "[LUMINAIRELUMENS] 2,500",
        "[_DELIVEREDLUMENS] 3.1",
        "[_FLUX] 2000 lm",
        "[OTHER] Total luminaire flux 2000 lm",
        "[MORE] nothing\n[OTHER] luminous flux: 9000 lumens",
        "[LUMINAIRE] Panel 6000 lm 4000 K",
        "[_TOTAL_LM] 314",
        "[OTHER] output 1,200 lumens",
    ]
    .map(|header| with("header/stated-lumens", header))
    .into();
    all.extend(
        editions.map(|first| ("header/stated-lumens", Lm63 { first, ..Lm63::with("[_TOTALLUMINAIRELUMENS] 1570.8") })),
    );
    all.extend([
        ("header/lamp-lumens", Lm63::with("[LAMP] LED 1570 lm")),
        ("header/lamp-lumens", Lm63::with("[_LAMPLUMENS] 2000")),
        ("header/lamp-lumens", relative("1 4000", "[LAMP] 2600 lm")),
        ("header/lamp-lumens", relative("2 2000", "[LAMPCAT] T5 HO 3300 lm")),
        ("header/lamp-count", relative("1 4000", "[LAMP] 2 x 36 W")),
        ("header/lamp-count", relative("4 1000", "[LAMP] 2x fluorescent")),
    ]);
    all.extend(
        [
            "[_INTENSITYUNITS] mW/sr",
            "[TEST] measured in RADIOMETRIC UNITS",
            "[OTHER] candela -> W/sr",
            "[OTHER] PPF 60 \u{b5}mol/s",
            "[_UNITS] mW/cm2 at 1 m",
        ]
        .map(|header| with("header/units", header)),
    );
    all.extend(
        ["[NEARFIELD] 0.5 1.0 2.0", "[NEARFIELD] Test distance of 100 cm", "[nearfield] 1 m"]
            .map(|header| with("header/near-field", header)),
    );
    all
}

/// Files with a record that contradicts a text or another number.
fn contradictory_records() -> Vec<(&'static str, Lm63)> {
    let ballast = |ballast: &'static str| Lm63 { ballast, ..base() };
    vec![
        ("header/ballast-factor", ballast("0.88 1 30")),
        ("header/ballast-factor", Lm63 { lamps: "1 4000", ..ballast("2.2 1 30") }),
        ("header/ballast-factor", Lm63 { lamps: "1 4000", ..ballast("0.05 1 0") }),
        ("header/ballast-factor", relative("1 4000", "[BALLAST] electronic, BF=0.88")),
        ("header/ballast-factor", relative("1 4000", "[BALLASTFACTOR] 0.9")),
        ("lm63/ballast-lamp-factor", ballast("1 0.93 30")),
        ("header/stated-watts", Lm63::with("[_INPUTWATTS] 36")),
        ("header/stated-watts", Lm63::with("[WATT] 58 W")),
        ("header/stated-watts", Lm63::with("[_INPUTPOWER] 15")),
        ("header/stated-efficacy", Lm63::with("[OTHER] 140 lm/W")),
        ("header/stated-efficacy", Lm63::with("[_EFFICACY] 80")),
        ("header/efficacy", ballast("1 1 3")),
        ("header/multiplier", Lm63 { lamps: "1 4000", multiplier: "2", ..base() }),
        ("flux", Lm63 { lamps: "1 2600", ..base() }),
        ("header/output-ratio", Lm63 { lamps: "1 100000", ..base() }),
    ]
}

/// Files with planes that contradict a text or each other.
fn contradictory_planes() -> Vec<(&'static str, Lm63)> {
    vec![
        (
            "header/symmetry",
            Lm63 {
                horizontal: every(45.0, 0.0, 180.0),
                candela: lopsided,
                ..Lm63::with("[DISTRIBUTION] axially symmetric")
            },
        ),
        (
            "header/symmetry",
            Lm63 {
                horizontal: every(45.0, 0.0, 180.0),
                candela: lopsided,
                ..Lm63::with("[DISTRIBUTION] Quadrilateral Symmetry")
            },
        ),
        ("header/symmetry", Lm63::with("[DISTRIBUTION] asymmetric")),
        ("planes/edge", Lm63 { vertical: every(2.5, 0.0, 85.0), ..base() }),
        ("planes/edge", Lm63 { vertical: every(5.0, 10.0, 90.0), ..base() }),
        (
            "planes/edge",
            Lm63 {
                kind: "2",
                vertical: every(10.0, -60.0, 60.0),
                horizontal: every(10.0, -60.0, 60.0),
                candela: |h, v| 100.0 - 0.5 * (h.abs() + v.abs()),
                ..base()
            },
        ),
        (
            "planes/single",
            Lm63 { kind: "2", vertical: every(10.0, -90.0, 90.0), candela: |_, v| lambertian(0.0, v), ..base() },
        ),
        (
            "planes/single",
            Lm63 { kind: "3", vertical: every(10.0, -90.0, 90.0), candela: |_, v| lambertian(0.0, v), ..base() },
        ),
        (
            "planes/open-circle",
            Lm63 {
                horizontal: every(45.0, 0.0, 360.0),
                candela: |c, g| lambertian(c, g) * (1.0 + c / 3600.0),
                ..base()
            },
        ),
        ("planes/open-circle", Lm63 { horizontal: every(45.0, 0.0, 315.0), ..base() }),
        (
            "planes/pole",
            Lm63 {
                horizontal: every(90.0, 0.0, 360.0),
                candela: |c, g| lambertian(c, g) + if g == 0.0 { c % 360.0 } else { 0.0 },
                ..base()
            },
        ),
    ]
}

/// The contradictory EULUMDAT files with their codes and lines.
fn contradictory_ldt() -> Vec<(&'static str, usize, String)> {
    vec![
        ("ldt/output-ratio", 23, ldt(&[(23, "60")])),
        ("ldt/output-ratio", 23, ldt(&[(23, "99")])),
        ("ldt/downward-flux", 22, ldt(&[(22, "80")])),
        ("ldt/conversion-factor", 24, ldt(&[(24, "1.2"), (23, "94.25")])),
        ("ldt/measured-tilt", 25, ldt(&[(25, "15")])),
        ("ldt/gamma-step", 7, ldt(&[(7, "5")])),
        ("ldt/opening", 16, ldt(&[(16, "1200")])),
        ("header/efficacy", 29, ldt(&[(32, "3")])),
        ("flux", 0, ldt(&[(29, "4000"), (24, "2"), (23, "157")])),
        ("header/units", 9, ldt(&[(9, "UV lamp, mW/sr")])),
    ]
}

#[test]
fn sixty_contradictory_headers_are_each_linted_with_their_code_and_a_warning() {
    let (lm63, ldt) = (contradictory_lm63(), contradictory_ldt());
    assert!(lm63.len() + ldt.len() >= 60, "{} {}", lm63.len(), ldt.len());
    for (code, file) in lm63 {
        let read = file.read();
        let lint = read.lints.iter().find(|lint| lint.code == code);
        let lint = lint.unwrap_or_else(|| panic!("{code} is not in {:?} of\n{}", read.lints, file.text()));
        assert_eq!(lint.severity, Severity::Warning, "{code}");
        assert!(lint.line > 0 || code == "flux", "{code}");
    }
    for (code, line, text) in ldt {
        let read = eulumdat::parse(text.as_bytes()).unwrap();
        let lint = read.lints.iter().find(|lint| lint.code == code);
        let lint = lint.unwrap_or_else(|| panic!("{code} is not in {:?}", read.lints));
        assert_eq!((lint.severity, lint.line), (Severity::Warning, line), "{code}");
    }
}

#[test]
fn files_that_agree_with_their_headers_have_no_warning() {
    let good = [
        base(),
        Lm63::with(&format!(
            "[_TOTALLUMINAIRELUMENS] {FLUX_LM}\n[_ABSOLUTELUMENS] 3140\n[LUMINAIRE] Panel 3200 lm\n[OTHER] 104.7 lm/W, 30 W"
        )),
        Lm63 { lamps: "2 2000", ..Lm63::with("[LAMP] 2 x 54 W, 2000 lm\n[BALLAST] BF=1.0\n[_INPUTWATTS] 30.5") },
        Lm63 {
            lamps: "1 4000",
            ballast: "0.88 1 30",
            ..Lm63::with("[BALLASTFACTOR] 0.88\n[DISTRIBUTION] Quadrilateral Symmetry")
        },
        Lm63 {
            horizontal: every(45.0, 0.0, 360.0),
            ..Lm63::with("[LUMCAT] ABC-3600LM-840\n[DISTRIBUTION] axially symmetric")
        },
    ];
    for file in good {
        let warnings: Vec<_> =
            file.read().lints.into_iter().filter(|lint| lint.severity == Severity::Warning).collect();
        assert_eq!(warnings, [], "{}", file.text());
    }
    let read = eulumdat::parse(ldt(&[]).as_bytes()).unwrap();
    assert!(read.lints.iter().all(|lint| lint.severity == Severity::Note), "{:?}", read.lints);
}

#[test]
fn a_ratio_that_is_the_multiplier_is_named() {
    // As in a public file: the stated lumens lack the multiplier.
    let file = Lm63 { multiplier: "1.32", ..Lm63::with(&format!("[_TOTALLUMINAIRELUMENS] {FLUX_LM}")) };
    let read = file.read();
    let lint = read.lints.iter().find(|lint| lint.code == "header/stated-lumens").unwrap();
    assert!(lint.message.ends_with("the ratio is the candela multiplier"), "{}", lint.message);
}

#[test]
fn a_missing_ballast_record_is_reported_as_such() {
    for vertical in [every(2.5, 0.0, 90.0), every(2.5, 90.0, 180.0)] {
        let text = Lm63 { ballast: "", vertical, ..base() }.text();
        for tolerance in [Tolerance::Strict, Tolerance::Harmless] {
            let error = lm63::read(text.as_bytes(), |_| Err(String::new()), tolerance).unwrap_err();
            assert_eq!((error.problem, error.line), (Problem::MissingBallastRecord, 9));
        }
    }
}

#[test]
fn a_single_plane_of_types_a_and_b_stands_for_the_same_range() {
    // Even over the half space of -90 to 90: 2 pi sr. Type C with one plane is axial, by LM-63.
    for (kind, vertical) in [("2", every(10.0, -90.0, 90.0)), ("3", every(10.0, -90.0, 90.0))] {
        let flux = Lm63 { kind, vertical, candela: |_, _| 100.0, ..base() }.read().distribution.flux().value();
        assert!((flux / (200.0 * std::f64::consts::PI) - 1.0).abs() < 1e-9, "{kind} {flux}");
    }
}
