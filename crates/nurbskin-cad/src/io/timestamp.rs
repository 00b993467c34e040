//! The date and time that a CAD file carries.

use nurbskin_geometry::{Error, Result};

/// A date and time, given by the caller: writers do not look at a clock, so that equal dates make equal bytes. Only
/// [`now`](Self::now) does.
///
/// The default is 2000-01-01 00:00:00, which stands for "not told".
///
/// ```
/// use nurbskin_cad::io::Timestamp;
/// assert_eq!(Timestamp::new(2007, 1, 29, 10, 54, 34)?.to_string(), "20070129.105434");
/// assert_eq!(Timestamp::from_unix_seconds(951_782_400)?.to_string(), "20000229.000000");
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp {
    year: u32,
    month: u32,
    day: u32,
    hour: u32,
    minute: u32,
    second: u32,
}

impl Default for Timestamp {
    fn default() -> Self {
        Self {
            year: 2000,
            month: 1,
            day: 1,
            hour: 0,
            minute: 0,
            second: 0,
        }
    }
}

impl Timestamp {
    /// A date (year 1 to 9999) and a time of day.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the calendar or the clock has no such moment.
    pub fn new(
        year: u32,
        month: u32,
        day: u32,
        hour: u32,
        minute: u32,
        second: u32,
    ) -> Result<Self> {
        let leap =
            year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
        let days = match month {
            2 if leap => 29,
            2 => 28,
            4 | 6 | 9 | 11 => 30,
            _ => 31,
        };
        let valid = (1..=9999).contains(&year)
            && (1..=12).contains(&month)
            && (1..=days).contains(&day)
            && hour < 24
            && minute < 60
            && second < 60;
        if !valid {
            return Err(Error::invalid(format!(
                "{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} is not a date and time"
            )));
        }
        Ok(Self {
            year,
            month,
            day,
            hour,
            minute,
            second,
        })
    }

    /// The moment (UTC) this many seconds after 1970-01-01 00:00, as clocks and `SOURCE_DATE_EPOCH` count.
    ///
    /// # Errors
    /// [`Error::Invalid`] after the year 9999.
    pub fn from_unix_seconds(seconds: u64) -> Result<Self> {
        // Years are counted from March, so that a leap day ends its year; 400 years are 146 097 days, and the
        // day 0000-03-01 lies 719 468 days before 1970-01-01.
        let days = seconds / 86_400 + 719_468;
        let (era, day) = (days / 146_097, days % 146_097);
        let year_of_era = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
        let day_of_year = day - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        // Five months from March have 153 days, over and over.
        let month_from_march = (5 * day_of_year + 2) / 153;
        let day_of_month = day_of_year - (153 * month_from_march + 2) / 5 + 1;
        let month = (month_from_march + 2) % 12 + 1;
        let year = era * 400 + year_of_era + u64::from(month <= 2);
        let small = |x: u64| u32::try_from(x).unwrap_or(u32::MAX);
        let of_day = seconds % 86_400;
        Self::new(
            small(year),
            small(month),
            small(day_of_month),
            small(of_day / 3600),
            small(of_day / 60 % 60),
            small(of_day % 60),
        )
    }
}

/// The variable that stands for the clock where it is set.
const EPOCH: &str = "SOURCE_DATE_EPOCH";

impl Timestamp {
    /// Now (UTC, to the second), or the time that the environment's `SOURCE_DATE_EPOCH` names in seconds since
    /// 1970-01-01 00:00. The one place where a clock and the environment are read: call it once for all files of a run.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `SOURCE_DATE_EPOCH` is not a number of seconds.
    pub fn now() -> Result<Self> {
        match std::env::var_os(EPOCH) {
            Some(text) => Self::of_epoch(&text.to_string_lossy()),
            None => {
                let since = web_time::SystemTime::now().duration_since(web_time::UNIX_EPOCH);
                // A clock before 1970 is not set.
                since.map_or(Ok(Self::default()), |since| {
                    Self::from_unix_seconds(since.as_secs())
                })
            }
        }
    }

    /// The time that a value of `SOURCE_DATE_EPOCH` names.
    fn of_epoch(text: &str) -> Result<Self> {
        let seconds = text.trim().parse().ok();
        let time = seconds.and_then(|seconds| Self::from_unix_seconds(seconds).ok());
        time.ok_or_else(|| {
            Error::invalid(format!(
                "{EPOCH} is `{text}`, and should be a number of seconds since 1970-01-01 UTC"
            ))
        })
    }
}

impl Timestamp {
    /// As ISO 8601 and STEP write it: `YYYY-MM-DDThh:mm:ss`.
    #[must_use]
    pub fn iso(&self) -> String {
        format!(
            "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
            self.year, self.month, self.day, self.hour, self.minute, self.second
        )
    }
}

impl std::fmt::Display for Timestamp {
    /// As IGES writes it: `YYYYMMDD.HHNNSS`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:04}{:02}{:02}.{:02}{:02}{:02}",
            self.year, self.month, self.day, self.hour, self.minute, self.second
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_names_a_time() {
        let time = Timestamp::of_epoch(" 1700000000\n").unwrap();
        assert_eq!(time.iso(), "2023-11-14T22:13:20");
        for text in ["", "soon", "-1", "1.5", "99999999999999"] {
            let error = Timestamp::of_epoch(text).unwrap_err().to_string();
            assert!(error.contains("SOURCE_DATE_EPOCH"), "{error}");
        }
        assert!(Timestamp::now().unwrap() > Timestamp::default());
    }

    #[test]
    fn unix_seconds_follow_the_calendar() {
        for (seconds, text) in [
            (0, "19700101.000000"),
            (946_684_800, "20000101.000000"),
            (951_868_799, "20000229.235959"),
            (1_709_164_800, "20240229.000000"),
            (1_735_689_599, "20241231.235959"),
            (4_107_542_400, "21000301.000000"),
        ] {
            assert_eq!(
                Timestamp::from_unix_seconds(seconds).unwrap().to_string(),
                text
            );
        }
        assert_eq!(Timestamp::default().iso(), "2000-01-01T00:00:00");
        assert!(Timestamp::from_unix_seconds(u64::MAX).is_err());
        assert!(Timestamp::new(2100, 2, 29, 0, 0, 0).is_err());
        assert!(Timestamp::new(2000, 13, 1, 0, 0, 0).is_err());
    }
}
