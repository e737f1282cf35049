//! A calendar day (UTC), written so that it sorts by time: `2027-06-30`.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A calendar day (UTC).
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct Day(String);

/// A text that is no day.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no day; write it like 2027-06-30")]
pub struct NoDay(String);

impl Day {
    /// The day of a moment in the form of RFC 3339, UTC.
    pub fn of_timestamp(timestamp: &str) -> Result<Self, NoDay> {
        timestamp.chars().take(FORM.len()).collect::<String>().try_into()
    }
}

/// Digits and dashes of a day.
const FORM: &str = "0000-00-00";

impl TryFrom<String> for Day {
    type Error = NoDay;

    fn try_from(text: String) -> Result<Self, NoDay> {
        let is_well_formed =
            text.len() == FORM.len() && text.bytes().zip(FORM.bytes()).all(|(b, f)| (b == b'-') == (f == b'-'));
        let is_day = is_well_formed && humantime::parse_rfc3339_weak(&format!("{text} 00:00:00")).is_ok();
        if is_day { Ok(Self(text)) } else { Err(NoDay(text)) }
    }
}

impl fmt::Display for Day {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_read_in_one_form_and_sort_by_time() {
        let day = |text: &str| Day::try_from(text.to_owned());
        assert!(day("2026-12-31").unwrap() < day("2027-01-01").unwrap());
        assert_eq!(Day::of_timestamp("1970-01-01T00:00:00Z"), day("1970-01-01"));
        for wrong in ["", "2027-6-30", "2027-02-29", "2027-13-01", "30-06-2027", "2027/06/30", "2027-06-30T00:00:00Z"] {
            assert_eq!(day(wrong), Err(NoDay(wrong.to_owned())));
        }
    }

    #[test]
    fn a_day_is_written_as_it_is_read() {
        assert_eq!(Day::try_from("2027-06-30".to_owned()).unwrap().to_string(), "2027-06-30");
        assert_eq!(Day::of_timestamp("2027-6-30"), Err(NoDay("2027-6-30".to_owned())));
    }
}
