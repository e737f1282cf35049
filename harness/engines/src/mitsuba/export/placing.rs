//! Places and remarks of the frame as XML.

use glam::{DMat3, DVec3};

use crate::frame::Frame;

/// A rotation followed by a translation, as Mitsuba's `matrix` wants them.
pub(super) fn matrix(frame: &Frame, position_m: DVec3, orientation: DMat3) -> String {
    let rows = frame.placed(position_m, orientation).map(|row| row.map(|x| x.to_string()).join(" "));
    rows.join("  ")
}

/// A remark for scene files whose coordinates are not the spec's.
pub(super) fn comment(frame: &Frame) -> String {
    frame.remark().map_or_else(String::new, |text| format!("    <!-- {} -->\n", text.replace('\n', "\n         ")))
}
