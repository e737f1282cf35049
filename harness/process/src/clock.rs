//! Moments as files write them.

use std::time::{Duration, SystemTime};

/// A moment by RFC 3339, in seconds. A clock that is wrong by decades shows the nearest moment that has such a form.
pub fn timestamp(time: SystemTime) -> String {
    // 9999-12-31T23:59:59Z
    const LAST: Duration = Duration::from_secs(253_402_300_799);
    let since = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().min(LAST);
    humantime::format_rfc3339_seconds(SystemTime::UNIX_EPOCH + since).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_is_wrong_by_decades_shows_the_nearest_moment_that_has_a_form() {
        let year = Duration::from_secs(366 * 86_400);
        assert_eq!(timestamp(SystemTime::UNIX_EPOCH - year), "1970-01-01T00:00:00Z");
        assert_eq!(timestamp(SystemTime::UNIX_EPOCH + year * 20_000), "9999-12-31T23:59:59Z");
    }
}
