//! A day of the calendar (UTC), in the one form that sorts by time: `2027-06-30`.

use std::fmt;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct Day(String);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no day; write it like 2027-06-30")]
pub struct NoDay(String);

impl Day {
    pub fn today() -> Self {
        Self::of(SystemTime::now())
    }

    pub fn of(time: SystemTime) -> Self {
        Self(humantime::format_rfc3339_seconds(time).to_string().chars().take(FORM.len()).collect())
    }
}

const FORM: &str = "0000-00-00";

impl TryFrom<String> for Day {
    type Error = NoDay;

    fn try_from(text: String) -> Result<Self, NoDay> {
        let is_formed =
            text.len() == FORM.len() && text.bytes().zip(FORM.bytes()).all(|(b, f)| (b == b'-') == (f == b'-'));
        let is_day = is_formed && humantime::parse_rfc3339_weak(&format!("{text} 00:00:00")).is_ok();
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
        assert_eq!(Day::of(SystemTime::UNIX_EPOCH).to_string(), "1970-01-01");
        assert!(Day::today() > day("2026-01-01").unwrap());
        for wrong in ["", "2027-6-30", "2027-02-29", "2027-13-01", "30-06-2027", "2027/06/30", "2027-06-30T00:00:00Z"] {
            assert_eq!(day(wrong), Err(NoDay(wrong.to_owned())));
        }
    }
}
