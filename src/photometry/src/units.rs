//! Photometric quantities as newtypes: the compiler rejects a candela in place of a lux.

use std::fmt;
use std::iter::Sum;
use std::ops::{Add, Div, Mul, Neg, Sub};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $symbol:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f64);

        impl $name {
            /// The unit's symbol.
            pub const SYMBOL: &'static str = $symbol;

            /// The bare number, in the unit of the type.
            pub const fn value(self) -> f64 {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $symbol))
            }
        }

        impl Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl Neg for $name {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl Mul<f64> for $name {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self(self.0 * factor)
            }
        }

        impl Mul<$name> for f64 {
            type Output = $name;
            fn mul(self, quantity: $name) -> $name {
                $name(self * quantity.0)
            }
        }

        impl Div<f64> for $name {
            type Output = Self;
            fn div(self, divisor: f64) -> Self {
                Self(self.0 / divisor)
            }
        }

        impl Div for $name {
            type Output = f64;
            fn div(self, other: Self) -> f64 {
                self.0 / other.0
            }
        }

        impl Sum for $name {
            fn sum<I: Iterator<Item = Self>>(values: I) -> Self {
                Self(values.map(|v| v.0).sum())
            }
        }
    };
}

quantity!(
    /// Luminous intensity \[cd\].
    Candela, "cd"
);
quantity!(
    /// Luminous flux \[lm\].
    Lumen, "lm"
);
quantity!(
    /// Illuminance \[lx\], flux that arrives on a unit of area.
    Lux, "lx"
);
quantity!(
    /// Luminous exitance \[lm/m²\], flux that leaves a unit of area.
    LumenPerSquareMetre, "lm/m²"
);
quantity!(
    /// Luminance \[cd/m²\].
    CandelaPerSquareMetre, "cd/m²"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_add_scale_and_print_with_their_unit() {
        let sum: Lux = [Lux(1.0), Lux(2.5)].into_iter().sum();
        assert_eq!((sum * 2.0 - Lux(1.0)).value(), 6.0);
        assert_eq!(Lumen(6.0) / Lumen(4.0), 1.5);
        assert_eq!(format!("{:.2}", Candela(664.4)), "664.40 cd");
    }
}
