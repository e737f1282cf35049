//! The figures of a report as text and as JSON.

use std::path::Path;

use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};

use super::*;

/// An absolute panel of 600 x 300 mm, cos downward, narrower across C 90.
fn panel() -> Photometry {
    let gamma: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
    let planes = [1, 2].map(|power| gamma.iter().map(move |g| 1000.0 * g.to_radians().cos().max(0.0).powi(power)));
    let candela = planes.into_iter().flatten().collect();
    let distribution = LuminousIntensityDistribution::new(vec![0.0, 90.0], gamma.clone(), candela).unwrap();
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 };
    Photometry { opening, ..Photometry::of(distribution) }
}

fn figures(photometry: &Photometry) -> Figures {
    Figures::compute(Path::new("panel.ies"), photometry, Spacing::Quarter)
}

#[test]
fn the_report_reads_well() {
    insta::assert_snapshot!(figures(&panel()).to_string());
}

#[test]
fn every_figure_of_the_record_is_there_or_says_why_not() {
    let record = serde_json::to_value(figures(&panel())).unwrap();
    assert_eq!(record["schema"], "luxproof-photometric-report/1");
    assert_eq!(record["ugr"]["rooms"].as_array().unwrap().len(), 19);
    assert!((record["luminance"]["rows"][0]["cd_per_m2"][0].as_f64().unwrap() - 1000.0 / 0.18).abs() < 1e-6);
    let [sum, exact] = ["mid_zone_lm", "exact_lm"].map(|key| {
        record["zonal_lumens"]["zones"].as_array().unwrap().iter().map(|zone| zone[key].as_f64().unwrap()).sum::<f64>()
    });
    assert!((exact - record["flux_lm"].as_f64().unwrap()).abs() < 1e-9 && sum != exact);
    let dark = Photometry::of(LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![0.0; 2]).unwrap());
    let record = serde_json::to_value(figures(&dark)).unwrap();
    for key in ["beam", "nema_type", "bug", "cie_flux_code_percent", "spacing_criterion", "ugr"] {
        assert!(record[key]["not_available"].as_str().is_some_and(|reason| reason.len() > 10), "{key}: {record}");
    }
    assert!(figures(&dark).to_string().contains("not available: every intensity is zero"));
}

#[test]
fn the_isocandela_line_lies_where_the_intensity_is() {
    let cosine: Vec<f64> = (0..=90).map(f64::from).collect();
    let candela = cosine.iter().map(|g| g.to_radians().cos()).collect();
    let round = Photometry::of(LuminousIntensityDistribution::axial(cosine, candela).unwrap());
    let svg = isocandela::diagram("a.ies", &round).unwrap();
    let line = svg.split("stroke=\"#fb8022\" d=\"").nth(1).unwrap().split('"').next().unwrap();
    // Half the largest intensity at gamma 60: two thirds of 135 units up from the foot at 44 + 135.
    let points: Vec<&str> = line.split(['M', 'L']).filter(|p| !p.is_empty()).collect();
    assert!(points.len() >= 360, "{line}");
    for point in points {
        let y: f64 = point.split(' ').nth(1).unwrap().parse().unwrap();
        assert!((y - (44.0 + 135.0 / 3.0)).abs() < 0.11, "{point}");
    }
}

#[test]
fn a_cone_is_as_wide_as_its_beam_and_a_wide_beam_has_none() {
    let spot = LuminousIntensityDistribution::axial(vec![0.0, 30.0, 60.0], vec![900.0, 450.0, 0.0]).unwrap();
    let svg = cone::diagram("a.ies", &Photometry::of(spot)).unwrap();
    // 2 tan 30 per metre; 900 cd / 9.
    assert!(svg.contains(">3.46 m<") && svg.contains(">3 m: 100 lx<") && svg.contains("60.0°"), "{svg}");
    let even = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![1.0; 2]).unwrap();
    assert!(cone::diagram("a.ies", &Photometry::of(even.clone())).unwrap_err().contains("90.0 degrees"));
    assert!(isocandela::diagram("a.ies", &Photometry::of(even.scaled(0.0))).is_err());
}
