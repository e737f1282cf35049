//! Error budgets: the components of the uncertainty of a deviation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The source of an error, in the order of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[derive(strum::IntoStaticStr, strum::VariantArray)]
#[strum(serialize_all = "snake_case", const_into_str)]
pub enum Source {
    /// Chance in the reading: the standard error of sampled light.
    #[strum(to_string = "Monte Carlo")]
    MonteCarlo,
    /// The error bound of a deterministic reading: discretisation and read-out. Older reports call a part of it `instrument`.
    #[serde(alias = "instrument")]
    Discretisation,
    /// The error of the reference.
    Reference,
    /// Rounding of a printed reference.
    Rounding,
    /// The last digit of the photometric file's candela table, where the reference comes from elsewhere.
    Input,
}

/// The distribution of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Normal, or Student's t where degrees of freedom are known.
    Normal,
    /// Uniform between two bounds.
    Rectangular,
}

/// One component of an error budget.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Component {
    pub source: Source,
    /// Standard uncertainty, in the quantity's unit.
    pub uncertainty: f64,
    pub shape: Shape,
    /// Degrees of freedom of the standard uncertainty, where it is estimated from few values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
}

impl Component {
    /// A normal component; no degrees of freedom mean many.
    pub const fn normal(source: Source, uncertainty: f64, degrees_of_freedom: Option<f64>) -> Self {
        Self { source, uncertainty, shape: Shape::Normal, degrees_of_freedom }
    }

    /// A uniform component within a bound (GUM 4.3.7).
    pub fn within(source: Source, bound: f64) -> Self {
        Self { source, uncertainty: bound / 3f64.sqrt(), shape: Shape::Rectangular, degrees_of_freedom: None }
    }
}

/// The uncertainty of a deviation by component.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ErrorBudget {
    /// The components that are not zero.
    pub components: Vec<Component>,
    /// Combined standard uncertainty, in the quantity's unit.
    pub combined: f64,
    /// Effective degrees of freedom, where they are few.
    pub degrees_of_freedom: Option<f64>,
    /// Expanded over combined standard uncertainty.
    pub coverage_factor: f64,
    /// Half width of the deviation's interval in the verdict.
    pub expanded: f64,
    /// The components with chance widened as it counts at this stage; equal to `components` at a single stage.
    #[serde(skip)]
    pub counted: Vec<Component>,
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_bound_is_a_rectangular_component_of_its_half_width_over_the_root_of_three() {
        // GUM 4.3.7: u^2 = a^2 / 3.
        let bounded = Component::within(Source::Rounding, 0.6);
        assert!((bounded.uncertainty.powi(2) - 0.36 / 3.0).abs() < 1e-15, "{bounded:?}");
        assert_eq!((bounded.source, bounded.shape), (Source::Rounding, Shape::Rectangular));
        let normal = Component::normal(Source::MonteCarlo, 0.2, Some(7.0));
        assert_eq!((normal.uncertainty, normal.shape, normal.degrees_of_freedom), (0.2, Shape::Normal, Some(7.0)));
    }
}
