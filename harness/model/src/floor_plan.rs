//! A case seen from above: what a report draws of room, luminaires and bodies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// More luminaires and bodies than this are not drawn.
pub const MAX_DRAWN: usize = 500;

/// A case seen from above. All lengths are in metres; points are in the comparisons.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FloorPlan {
    /// Extent of the room along x and y from its corner at the origin; null in free field.
    pub room_m: Option<[f64; 2]>,
    pub luminaires: Vec<PlanLuminaire>,
    /// Opposite corners of the bodies' bounding boxes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies_m: Vec<[[f64; 2]; 2]>,
}

/// A luminaire seen from above.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlanLuminaire {
    /// Its name in the spec.
    pub name: String,
    /// Its photometric centre.
    pub at_m: [f64; 3],
    /// The corners of the rectangle around its opening; those of a point coincide.
    pub corners_m: [[f64; 2]; 4],
}
