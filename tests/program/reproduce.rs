//! `luxproof reproduce` of a standard's printed tables and of a study.

use luxproof::standard_tables::filled_template;

use crate::support::{Folder, root};

#[test]
fn the_template_is_printed_and_a_filled_in_copy_is_judged() {
    let folder = Folder::new(&[]);
    folder.luxproof(&["reproduce", "cie171"]).exits(0).prints("luxproof_printed: 1");
    let right = filled_template(2);
    folder.write("copy.yaml", &right);
    folder.luxproof(&["reproduce", "cie171", "--printed", "copy.yaml"]).exits(0).prints("1152 of 1152 printed cells");
    // Sky 5 at A under the roof of 4 m: 45.12 % by quadrature, and A alone is changed.
    assert_eq!(right.matches("sky-5: 45.12 ").count(), 1);
    folder.write("copy.yaml", &right.replace("sky-5: 45.12 ", "sky-5: 46.74 "));
    let judged = folder.luxproof(&["reproduce", "cie171", "--printed", "copy.yaml"]).exits(1);
    let judged = judged.prints("1151 of 1152").prints("roof-4m-wall sky-5 A: 46.74 % printed").prints("+3.58 %");
    judged.prints("5 of 5 other points under this sky and 15 of 15 other skies at this point follow the derivation");
}

#[test]
fn a_copy_that_is_not_filled_in_is_an_input_error() {
    let folder = Folder::new(&[]);
    folder.write("copy.yaml", luxproof::standard_tables::TEMPLATE);
    folder.luxproof(&["reproduce", "cie171", "--printed", "copy.yaml"]).exits(2);
    folder.luxproof(&["reproduce", "cie171", "--printed", "absent.yaml"]).exits(2);
    folder.luxproof(&["reproduce", "copy.yaml", "--printed", "copy.yaml"]).exits(2);
}

#[test]
fn a_study_says_what_explains_its_deviations_and_what_stays_open() {
    let study = root().join("reference/studies/cycles-cie171-2026").display().to_string();
    let folder = Folder::new(&[]);
    let explained = folder.luxproof(&["reproduce", &study]).exits(4);
    let explained = explained.prints("30 of 38 published deviations are explained: 13 by causes, 17 as scatter alone");
    let explained = explained.prints("No engine runs").prints("rest +2.35 ± 3.80 %: within scatter");
    explained.prints("standard -5.30 % (share 93 %)").prints("open");
}
